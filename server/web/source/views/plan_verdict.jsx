// Whether the charge suffices for the plan, and the expected energy.
import { energy, energyIn, energyScale } from '../energy.js';
import * as format from '../format.js';
import { Table, column, figure } from '../table.jsx';
import { Failure } from '../widgets.jsx';

// A probability, with meaningful digits only.
function chance(p) {
  if (p > 0.999) return 'more than 99.9\u00a0%';
  if (p < 0.001) return 'less than 0.1\u00a0%';
  return format.share(p, p > 0.99 || p < 0.01 ? 1 : 0);
}

const verdicts = [
  [0.95, 'The charge suffices', 'makes'],
  [0.5, 'The charge probably suffices', 'maybe'],
  [0.05, 'The charge probably does not suffice', 'fails'],
  [-1, 'The charge does not suffice', 'fails'],
];

const bases = {
  recent_missions: ({ missions }) => `its ${missions === 1 ? 'last mission' : `last ${missions} missions`}`,
  siblings: ({ siblings }) => `missions of ${format.count(siblings, 'robot')} of its kind`,
  model: () => 'its model alone: it has no missions yet',
};

const percent = (value) => format.share(value, 1);

// The median and, unless it is certain, the central 90 %.
function arrivalOf({ p05, p50, p95 }) {
  if (percent(p05) === percent(p95)) return percent(p50);
  return `${format.share(p50)} (${format.fixed(100 * p05)}–${format.share(p95)})`;
}

function Drives({ drives }) {
  const long = { class: 'figure long' };
  const scale = energyScale(drives.map((d) => d.expected_energy_j));
  const columns = [
    column('name', 'Drive', (d) => d.name, { head: true }),
    figure('chance', 'Chance', (d) => chance(d.success_probability), long),
    figure('energy', 'Expected energy', (d) => energyIn(scale, d.expected_energy_j), long),
    figure('time', 'Time', (d) => format.about(d.duration_s), long),
    figure('arrival', 'Charge on arrival', (d) => arrivalOf(d.arrival), long),
  ];
  return <Table class="chances" columns={columns} rows={drives} keyOf={(d) => d.name} />;
}

function Explanation({ answer, autonomy: a, planned }) {
  const reasons = [
    `it is a forecast from ${bases[a.consumption.basis](a.consumption)}`,
    a.pace.pause_s > 0.05 &&
      `it includes the usual pause of ${format.fixed(a.pace.pause_s, 1)} s at each stop`,
  ].filter(Boolean);
  return (
    <p class="note">
      Least energy ({format.text(energy(answer.energy_j))}) is the model’s optimum for this path. The expected
      energy
      {planned && ` (${format.text(energy(planned.expected_energy_j))})`} is what the robot will probably use:{' '}
      {reasons.join(', and ')}.
    </p>
  );
}

function drivesOf({ plan: usual, minimum_energy: planned, consumption }) {
  const who = consumption.missions > 0 ? 'it usually drives' : 'robots usually drive';
  return [
    planned && { ...planned, name: 'As planned here', arrival: planned.arrival_charge },
    { ...usual, name: `As ${who}`, arrival: usual.legs[0].arrival_charge },
  ].filter(Boolean);
}

export function PlanVerdict({ answer, autonomy }) {
  if (autonomy.error !== null) return <Failure error={autonomy.error} />;
  if (autonomy.value === null)
    return (
      <p class="verdict open">
        {autonomy.busy
          ? 'Computing whether the charge suffices …'
          : 'The robot has not reported its charge: enter it to see whether it suffices.'}
      </p>
    );
  const a = autonomy.value;
  const drives = drivesOf(a);
  const [first] = drives;
  const [, words, name] = verdicts.find(([least]) => first.success_probability >= least);
  const times = first.expected_energy_j > 0 ? Math.floor(a.usable_energy_j / first.expected_energy_j) : 0;
  const sd = a.state_of_charge_sd > 0.0005 ? ` ± ${percent(a.state_of_charge_sd)}` : '';
  return (
    <div class={`verdict-box ${name}`}>
      <p class="verdict">
        <b>{words}</b>: {chance(first.success_probability)} chance to finish with its reserve of{' '}
        {format.share(a.reserve_fraction)} left.
      </p>
      <Drives drives={drives} />
      <p class="note">
        Starts with {percent(a.state_of_charge)}
        {sd} charge, {format.text(energy(a.usable_energy_j))} usable
        {times >= 2 ? `: about ${format.fixed(Number(times.toPrecision(2)))} such drives` : ''}.{' '}
        {a.state_of_charge_limitation}
      </p>
      <Explanation answer={answer} autonomy={a} planned={a.minimum_energy} />
    </div>
  );
}
