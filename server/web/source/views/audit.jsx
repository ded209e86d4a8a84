// The event log, and the audit log: changes, sign-ins and rejected requests; newest first.
import { useState } from 'preact/hooks';
import { energy } from '../energy.js';
import * as format from '../format.js';
import { useNewest } from '../logs.js';
import { missionLink, robotLink, useChoices } from '../route.js';
import { Table, column, figure } from '../table.jsx';
import { Answer, Button, Choice, Heading } from '../widgets.jsx';
import { RobotField, TextField } from './choosing.jsx';
import { verdictTitle } from './jobs.jsx';

export const origins = {
  diagnosis: 'a diagnosis',
  proposal: 'a proposal',
  file: 'a robot file',
  http: 'an upload',
};

const kinds = {
  model_adopted: [
    'Model adopted',
    (d) => {
      const test = format.known(d.error_before)
        ? `; energy error ${format.share(d.error_before, 2)} before, ${format.share(d.error_after, 2)} after`
        : '';
      return `version ${d.model_version} from ${origins[d.origin] ?? format.words(d.origin ?? 'a request')}${test}`;
    },
  ],
  model_activated: [
    'Model put in force',
    (d) => `version ${d.model_version}, was version ${d.previous_version}`,
  ],
  gap_drift: [
    'Consumption changed',
    (d) =>
      `${format.words(d.quantity ?? 'energy')} by ${format.signed(format.share(d.ratio_after / d.ratio_before - 1, 1))} since ${format.date(d.utime_us)}; measured over modelled ${format.fixed(d.ratio_before, 3)} before, ${format.fixed(d.ratio_after, 3)} after`,
  ],
  gap_sibling: [
    'Compared with its kind',
    (d) => `${d.stands_out ? 'stands out' : 'no longer stands out'}, ratio ${format.fixed(d.ratio, 3)}`,
  ],
  gap_diagnosed: [
    'Diagnosed',
    (d) => `${verdictTitle(d)}${d.effects?.length > 0 ? `: ${d.effects.map(format.words).join(', ')}` : ''}`,
  ],
  proposal_dismissed: ['Proposal dismissed', (d) => d.reason],
  undeclared_payload: [
    'Undeclared payload',
    (d) =>
      `${format.withDeviation(Math.abs(d.undeclared_kg), d.undeclared_sd_kg)} kg ${d.undeclared_kg < 0 ? 'less' : 'more'} than declared`,
  ],
  contradiction: ['Telemetry contradicted', (d) => d.says],
  contradiction_ended: ['Telemetry no longer contradicted', (d) => d.message],
  robot_silent: ['Silent', (d) => d.message],
  robot_back: ['Telemetry resumed', (d) => `silent since ${format.time(d.since_utime_us)}`],
  charge_low: ['Charge low', (d) => d.message],
  charge_restored: ['Charge restored', (d) => `low since ${format.time(d.since_utime_us)}`],
  mission_annulled: ['Mission annulled', (d) => d.reason],
  mission_id_reused: ['Mission id reused', (d) => d.mission_id],
  robot_removed: [
    'Robot removed',
    (d) =>
      d.history === 'purge'
        ? `with its history, ${format.count(d.missions_deleted, 'mission')}`
        : 'its history is kept',
  ],
  charged: [
    'Charged',
    (d) =>
      `${format.text(energy(d.charged_j))}, ${format.share(d.start_charge)} to ${format.share(d.end_charge)}`,
  ],
};

const titleOf = (event) => kinds[event.kind]?.[0] ?? format.words(event.kind);

const mostShown = 110; // characters; the whole on a click

function EventDetail({ of: { kind, detail } }) {
  const diagnosis = detail.diagnosis_id;
  const mission = detail.mission_id ?? `mission ${detail.mission}`;
  const text = String(kinds[kind] ? kinds[kind][1](detail) : format.members(detail));
  return (
    <>
      {text.length > mostShown ? (
        <details>
          <summary>{text.slice(0, text.lastIndexOf(' ', mostShown))} …</summary>
          {text}
        </details>
      ) : (
        text
      )}
      {detail.mission && [' · ', <a href={missionLink(detail.mission)}>{mission}</a>]}
      {diagnosis && [' · ', <a href={`#/gap/${diagnosis}`}>diagnosis {diagnosis}</a>]}
    </>
  );
}

const eventColumns = [
  column('time', 'Time', (e) => format.time(e.utime_us), { class: 'when' }),
  column('robot', 'Robot', (e) => (e.robot_id ? <a href={robotLink(e.robot_id)}>{e.robot_id}</a> : '–')),
  column('what', 'What', titleOf, { head: true }),
  column('detail', 'Detail', (e) => <EventDetail of={e} />, { class: 'words' }),
];

export function Events({ events, withRobot = true }) {
  const shown = eventColumns.filter(({ key }) => withRobot || key !== 'robot');
  return <Table class="events" columns={shown} rows={events} />;
}

// As useNewest(): of a robot, or of all.
export const useEvents = (robotId, ...counts) => useNewest('/v1/event-log', { robot_id: robotId }, ...counts);

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
const requestCell = ({ detail: { method, path, ...rest } }) => (
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
  column('detail', 'Request', requestCell, { class: 'words' }),
];

// A log, of useNewest(), below its fields, as an Answer.
const Log = ({ of, fields, ...list }) => (
  <>
    <div class="wrap filters">{fields}</div>
    <Answer of={of} {...list} />
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
      {(rows) => <Table class="events" columns={columns} rows={rows} />}
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
      none="No events yet"
      more="Adoptions, drifts with their diagnoses, silence and contradictory telemetry are listed here."
      from={({ entries }) => entries}
    >
      {(list) => <Events events={list} />}
    </Log>
  );
}

export function Audit({ given: asked }) {
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
