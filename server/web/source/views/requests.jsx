// The audit log: changes, sign-ins and rejected requests, newest first, a row for each request.
import { useState } from 'preact/hooks';
import { useRead } from '../api.js';
import * as format from '../format.js';
import { newest } from '../logs.js';
import { Table, column, figure } from '../table.jsx';
import { List } from '../widgets.jsx';
import { Field } from './choosing.jsx';

const pageEntries = 200;
const actions = {
  acknowledgeAttention: 'acknowledge a reason for attention',
  adoptModel: 'change the model',
  annulMission: 'annul a mission',
  cancelDiagnosis: 'cancel a diagnosis',
  createSession: 'sign in',
  deleteSession: 'sign out',
  putFloorPlan: 'store a floor plan',
  putRobot: 'store the robot file',
  putRobotPlace: 'set map and level',
  removeFloorPlan: 'remove a floor plan',
  removeRobot: 'remove the robot',
  requestMission: 'begin or end a mission',
  startDiagnosis: 'start a diagnosis',
};

// One row for each request, whose beginning and end are entries with its id.
function rowsOf(entries) {
  const rows = new Map();
  for (const { request_id: request, detail, ...entry } of entries) {
    const key = request ?? entry.id;
    rows.set(key, { ...entry, key, detail: { ...detail, ...rows.get(key)?.detail } });
  }
  return [...rows.values()];
}

const what = ({ action, detail: { path = '' } }) => {
  const [, kind, id] = /^\/v1\/(robots|missions|diagnoses)\/([^/]+)/.exec(path) ?? [];
  const of = kind && (kind === 'robots' ? id : `${kind.replace(/e?s$/, '')} ${id}`);
  return `${actions[action] ?? action}${of ? `: ${of}` : ''}`;
};

// The request as it came, on demand.
const Detail = ({ of: { method, path, ...rest } }) => (
  <details>
    <summary>{[method, path].filter(Boolean).join(' ')}</summary>
    {format.members(rest)}
  </details>
);

const columns = [
  column('time', 'Time', (e) => format.time(e.utime_us), { class: 'when' }),
  column('actor', 'Who', (e) => e.actor ?? '–'),
  column('address', 'From', (e) => e.address ?? 'the service'),
  column('action', 'What', what, { head: true }),
  figure('status', 'Answer', (e) => e.detail.status ?? '–'),
  column('detail', 'Request', (e) => <Detail of={e.detail} />, { class: 'words' }),
];

export const Older = ({ onClick }) => (
  <p class="fold">
    <button type="button" onClick={onClick}>
      Show older entries
    </button>
  </p>
);

async function readEntries(count, signal) {
  const { entries, next } = await newest('/v1/audit', {}, count, signal);
  return { rows: rowsOf(entries), next };
}

export function Requests() {
  const [count, setCount] = useState(pageEntries);
  const [text, setText] = useState('');
  const read = useRead((signal) => readEntries(count, signal), `${count}`);
  const kept = ({ rows }) =>
    rows.filter((e) =>
      `${e.actor} ${e.address} ${what(e)} ${JSON.stringify(e.detail)}`.toLowerCase().includes(text),
    );
  return (
    <>
      <div class="filters">
        <Field label="Contains">
          <input type="search" onInput={(e) => setText(e.currentTarget.value.trim().toLowerCase())} />
        </Field>
      </div>
      <List
        of={read}
        what="the audit"
        from={kept}
        none={text ? 'No request matches' : 'No request yet'}
        more="Requests that change something, refusals and sign-ins are listed here."
      >
        {(rows) => <Table class="events" columns={columns} rows={rows} keyOf={(e) => e.key} />}
      </List>
      {read.value?.next && <Older onClick={() => setCount(count + pageEntries)} />}
    </>
  );
}
