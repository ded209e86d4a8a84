// The event log, and the audit log: changes, sign-ins and rejected requests; newest first.
import { useState } from 'preact/hooks';
import * as format from '../format.js';
import { useNewest } from '../logs.js';
import { useChoices } from '../route.js';
import { Table, column, figure } from '../table.jsx';
import { Button, Choice, Heading, List, useTitleOf } from '../widgets.jsx';
import { RobotField, TextField } from './choosing.jsx';
import { Events, useEvents } from './events.jsx';

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

// One row for each request: its beginning and end are entries with its id.
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

// A log, of useNewest(), below its fields, as a List.
const Log = ({ of, fields, ...list }) => (
  <>
    <div class="filters">{fields}</div>
    <List of={of} {...list} />
    {of.value?.next && (
      <p class="fold">
        <Button onClick={of.more}>Show older entries</Button>
      </p>
    )}
  </>
);

function Requests() {
  const [text, setText] = useState('');
  const wanted = text.trim().toLowerCase();
  const kept = ({ entries }) =>
    rowsOf(entries).filter((e) =>
      `${e.actor} ${e.address} ${what(e)} ${JSON.stringify(e.detail)}`.toLowerCase().includes(wanted),
    );
  return (
    <Log
      of={useNewest('/v1/audit', {}, pageEntries)}
      fields={<TextField label="Contains" type="search" value={text} onChange={setText} />}
      what="the audit"
      from={kept}
      none={text ? 'No request matches' : 'No request yet'}
      more="Requests that change something, refusals and sign-ins are listed here."
    >
      {(rows) => <Table class="events" columns={columns} rows={rows} keyOf={(e) => e.key} />}
    </Log>
  );
}

const step = 200;
const subjects = { '': 'Robots and models', requests: 'Requests' };

// Events of robots and their models, newest first.
function RobotEvents({ given: { robot }, change }) {
  const events = useEvents(robot, step, 5 * step);
  const fields = [
    <RobotField value={robot} onChange={(id) => change({ robot: id })} />,
    <Button onClick={events.reload}>Refresh</Button>,
  ];
  return (
    <Log
      of={events}
      fields={fields}
      what="the log"
      none="Nothing has happened yet"
      more="Adoptions, drifts and diagnoses are listed here."
      from={({ entries }) => entries}
    >
      {(list) => <Events events={list} />}
    </Log>
  );
}

export function Audit({ given: asked }) {
  useTitleOf('Log');
  const [given, change] = useChoices(asked);
  const subject = given.of === 'requests' ? 'requests' : '';
  return (
    <>
      <Heading
        title="Log"
        note={
          subject ? 'changes, sign-ins and rejected requests' : 'what happened to robots and their models'
        }
      >
        <span class="spring" />
        <Choice label="Of" options={subjects} value={subject} onChange={(of) => change({ of })} />
      </Heading>
      {subject ? <Requests /> : <RobotEvents given={given} change={change} />}
    </>
  );
}
