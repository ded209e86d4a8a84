// Entries of the audit log in words.
import { useEffect, useState } from 'preact/hooks';
import { newestEvents } from '../audit_log.js';
import { energy } from '../energy.js';
import * as format from '../format.js';
import { missionLink, robotLink } from '../route.js';
import { Table } from '../table.jsx';

const percent = (share, places = 1) => format.text(format.percent(share, places));
const origins = { diagnosis: 'a diagnosis', proposal: 'a proposal', file: 'a robot file', http: 'HTTP' };

const kinds = {
  model_adopted: [
    'Model adopted',
    (d) => {
      const test = format.known(d.error_before)
        ? `; energy error ${percent(d.error_before, 2)} before, ${percent(d.error_after, 2)} after`
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
      `by ${format.signed(percent(d.ratio_after / d.ratio_before - 1))} since ${format.time(d.utime_us).slice(0, 10)}; measured over modelled energy ${format.fixed(d.ratio_before, 3)} before, ${format.fixed(d.ratio_after, 3)} after`,
  ],
  gap_sibling: [
    'Compared with its kind',
    (d) => `${d.stands_out ? 'stands out' : 'no longer stands out'}, ratio ${format.fixed(d.ratio, 3)}`,
  ],
  gap_diagnosed: [
    'Diagnosed',
    (d) =>
      `${format.words(d.verdict)}${d.effects?.length > 0 ? `: ${d.effects.map(format.words).join(', ')}` : ''}`,
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
  robot_back: ['Telemetry again', (d) => `it was silent since ${format.time(d.since_utime_us)}`],
  charge_low: ['Charge low', (d) => d.message],
  charge_restored: ['Charge restored', (d) => `it was low since ${format.time(d.since_utime_us)}`],
  mission_annulled: ['Mission annulled', (d) => d.reason],
  mission_id_reused: ['Mission name used again', (d) => d.mission_id],
  robot_removed: [
    'Robot removed',
    (d) =>
      d.history === 'purge'
        ? `with its history, ${d.missions_deleted} ${d.missions_deleted === 1 ? 'mission' : 'missions'}`
        : 'its history is kept',
  ],
  charged: [
    'Charged',
    (d) =>
      `${format.text(energy(d.charged_j))}, ${percent(d.start_charge, 0)} to ${percent(d.end_charge, 0)}`,
  ],
};

// The text of other kinds of events.
const inWords = (detail) =>
  Object.entries(detail)
    .filter(([, value]) => value !== null)
    .map(
      ([key, value]) => `${format.words(key)}: ${typeof value === 'object' ? JSON.stringify(value) : value}`,
    )
    .join('; ');

const titleOf = (event) => kinds[event.kind]?.[0] ?? format.words(event.kind);

function Detail({ of: { kind, detail } }) {
  const diagnosis = detail.diagnosis_id;
  return (
    <>
      {kinds[kind] ? kinds[kind][1](detail) : inWords(detail)}
      {detail.mission && (
        <>
          {' '}
          · <a href={missionLink(detail.mission)}>{detail.mission_id ?? `mission ${detail.mission}`}</a>
        </>
      )}
      {diagnosis && (
        <>
          {' '}
          · <a href={`#/gap/${diagnosis}`}>diagnosis {diagnosis}</a>
        </>
      )}
    </>
  );
}

const time = { key: 'time', title: 'Time', class: 'when', cell: (e) => format.time(e.utime_us) };
const robot = {
  key: 'robot',
  title: 'Robot',
  cell: (e) => (e.robot_id ? <a href={robotLink(e.robot_id)}>{e.robot_id}</a> : '–'),
};
const what = { key: 'what', title: 'What', head: true, cell: titleOf };
const detail = { key: 'detail', title: 'Detail', class: 'words', cell: (e) => <Detail of={e} /> };

export function Events({ events, withRobot = true }) {
  const columns = withRobot ? [time, robot, what, detail] : [time, what, detail];
  return <Table class="events" columns={columns} rows={events} keyOf={(e) => e.id} />;
}

// {value, error, loading, reload} as of useGet.
export function useEvents({ robotId, count }) {
  const [read, setRead] = useState({ value: null, error: null });
  const [turn, setTurn] = useState(0);
  useEffect(() => {
    const abort = new AbortController();
    newestEvents({ robotId, count, signal: abort.signal }).then(
      (value) => setRead({ value, error: null }),
      (error) => error.name !== 'AbortError' && setRead((before) => ({ ...before, error })),
    );
    return () => abort.abort();
  }, [robotId, count, turn]);
  return { ...read, reload: () => setTurn((n) => n + 1) };
}
