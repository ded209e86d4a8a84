// Entries of the event log in words.
import { energy } from '../energy.js';
import * as format from '../format.js';
import { useNewest } from '../logs.js';
import { missionLink, robotLink } from '../route.js';
import { Table, column } from '../table.jsx';
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
      `${format.words(d.quantity ?? 'energy')} by ${format.signed(format.share(d.ratio_after / d.ratio_before - 1, 1))} since ${format.time(d.utime_us).slice(0, 10)}; measured over modelled ${format.fixed(d.ratio_before, 3)} before, ${format.fixed(d.ratio_after, 3)} after`,
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

function Detail({ of: { kind, detail } }) {
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

const columns = [
  column('time', 'Time', (e) => format.time(e.utime_us), { class: 'when' }),
  column('robot', 'Robot', (e) => (e.robot_id ? <a href={robotLink(e.robot_id)}>{e.robot_id}</a> : '–')),
  column('what', 'What', titleOf, { head: true }),
  column('detail', 'Detail', (e) => <Detail of={e} />, { class: 'words' }),
];

export function Events({ events, withRobot = true }) {
  const shown = columns.filter(({ key }) => withRobot || key !== 'robot');
  return <Table class="events" columns={shown} rows={events} keyOf={(e) => e.id} />;
}

// As useNewest(): of a robot, or of all.
export const useEvents = (robotId, ...counts) => useNewest('/v1/event-log', { robot_id: robotId }, ...counts);
