// Lists of diagnoses, and texts of their states, verdicts and effects.
import * as format from '../format.js';
import { robotLink } from '../route.js';
import { Table, column, figure } from '../table.jsx';

export const stateNotes = {
  queued: 'waiting',
  running: 'running',
  done: 'done',
  failed: 'failed',
  cancelled: 'cancelled',
  interrupted: 'interrupted by a restart',
};
export const share = (value, places = 1) => format.share(value, places);
// A probability, as precise as it is calibrated.
export const chance = (value) => (value > 0.97 ? `> 97\u00a0%` : share(value, 0));
export const rangeOf = (ci, places = 1) =>
  ci && format.known(ci[0]) ? `${share(ci[0], places)} to ${share(ci[1], places)}` : '–';
export const effectName = (id) =>
  id.startsWith('covariate:') ? `covariate ${format.words(id.slice(10))}` : format.words(id);

// The verdict in words; diagnoses of earlier versions have only its id.
export const verdictTitle = (of) => of.verdict_title ?? format.words(of.verdict);

export const State = ({ of }) => <span class={`state ${of.state}`}>{stateNotes[of.state]}</span>;

// The names of the effects of a verdict, each with those that it is not distinguished from; of another
// verdict, those that are more likely than not.
export const likelyNames = ({ verdict, effects }) =>
  effects
    .filter((e) => verdict === 'effects' || e.probability >= 0.5)
    .map((e) => [e.id, ...(e.alternatives ?? [])].map(effectName).join(' or '))
    .join(', ');

function foundWords(summary) {
  if (!summary) return '–';
  const verdict = verdictTitle(summary);
  const effects = likelyNames(summary);
  if (effects === '') return verdict;
  return summary.verdict === 'effects' ? effects : `${verdict}; most likely ${effects}`;
}

const Name = ({ id, cause }) => [
  <a href={`#/gap/${id}`}>{id}</a>,
  cause === 'watch' && <span class="note"> after a drift</span>,
];
const columns = [
  column('id', 'Diagnosis', Name, { head: true }),
  column('robot', 'Robot', (d) => <a href={robotLink(d.robot_id)}>{d.robot_id}</a>),
  column('started', 'Started', (d) => format.time(d.created_utime_us), { class: 'when' }),
  column('state', 'State', (d) => <State of={d} />),
  column('found', 'Result', (d) => (d.error ? <span class="note">{d.error}</span> : foundWords(d.summary)), {
    class: 'words',
  }),
  figure('gap', 'Gap in power', (d) => share(d.summary?.gap.power_absolute_relative)),
  figure('held-out', 'Held-out error', (d) =>
    share(d.summary?.effects.length > 0 ? d.summary.shrinkage.held_out_after : null),
  ),
  figure('missions', 'Missions', (d) => d.fitted_on.length || '–'),
];
const ownColumns = columns.filter((c) => !['robot', 'held-out', 'missions'].includes(c.key));

export const JobRows = ({ jobs, withRobot = true }) => (
  <Table class="jobs" columns={withRobot ? columns : ownColumns} rows={jobs} />
);
