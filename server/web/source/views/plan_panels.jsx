// The panels of a plan: whether the charge suffices, its certificate, and the energy of usual profiles.
import { useMemo, useState } from 'preact/hooks';
import { EnergyBars } from '../bars.jsx';
import { Chart, axis, dots, line, withAlpha } from '../chart.jsx';
import { energy, energyIn, energyScale } from '../energy.js';
import * as format from '../format.js';
import { Table, column, figure } from '../table.jsx';
import { Button, Empty, Facts, Failure, Key } from '../widgets.jsx';

// `column` of a profile at other times, by linear interpolation; nulls without such a profile.
function atTimes(times, profile, column) {
  if (!profile) return times.map(() => null);
  const own = profile.time_s;
  const values = profile[column];
  let k = 1;
  return times.map((t) => {
    while (k < own.length - 1 && own[k] < t) k += 1;
    const part = own[k] > own[k - 1] ? Math.max(0, Math.min(1, (t - own[k - 1]) / (own[k] - own[k - 1]))) : 1;
    return values[k - 1] + part * (values[k] - values[k - 1]);
  });
}

export function SpeedChart({ answer }) {
  const p = answer.profile;
  const turns = p.yaw_rate_rad_s.some((v) => Math.abs(v) > 1e-6);
  const shown = (baseline) => (baseline?.within_limits ? baseline.profile : undefined);
  const trapezoid = shown(answer.baselines.trapezoid);
  const triangle = shown(answer.baselines.triangle);
  const data = useMemo(
    () => [
      p.time_s,
      p.speed_m_s,
      atTimes(p.time_s, trapezoid, 'speed_m_s'),
      atTimes(p.time_s, triangle, 'speed_m_s'),
      turns ? p.yaw_rate_rad_s.map(format.degrees) : p.time_s.map(() => null),
    ],
    [answer],
  );
  const power = useMemo(() => [p.time_s, p.power_w], [answer]);
  const cursor = { sync: { key: 'plan' }, drag: { x: false, y: false } };
  // Axes with another one on the right for the yaw rate, empty below the power.
  const axesOf = (time, value, name, more) => {
    const right = axis(name, { side: 1, grid: { show: false }, ...more });
    return [axis(time, { size: 28 }), axis(value), ...(turns ? [right] : [])];
  };
  const makeSpeed = (c) => ({
    cursor,
    scales: { x: { time: false }, yaw: {} },
    axes: axesOf('', 'speed, m/s', 'yaw rate, °/s', { scale: 'yaw' }),
    series: [
      {},
      line(c.accent, 2.25),
      line(c.muted, 1.25, { dash: [6, 4] }),
      line(c.muted, 1.25, { dash: [2, 3] }),
      line(c.modelled, 1.25, { scale: turns ? 'yaw' : 'y' }),
    ],
  });
  const makePower = (c) => ({
    cursor,
    axes: axesOf('time, s', 'power, W', ' ', { scale: 'y', ticks: { show: false }, values: () => [] }),
    series: [{}, line(c.accent, 1.75, { fill: withAlpha(c.accent, 0.12) })],
  });
  const peak = format.fixed(answer.peak_speed_m_s, 2);
  return (
    <>
      <Chart
        make={makeSpeed}
        data={data}
        height={210}
        changes={[turns]}
        label={`Speed over ${format.span(answer.duration_s)}, maximum ${peak} metres per second`}
      />
      <Chart
        make={makePower}
        data={power}
        height={150}
        changes={[turns]}
        label="Battery power of the planned drive over time"
      />
      <p class="note foot">
        <Key
          of={{
            accent: 'least energy',
            modelled: turns && 'yaw rate',
            dashed: trapezoid && 'trapezoid',
            dotted: triangle && 'triangle',
          }}
        />
      </p>
    </>
  );
}

// The energy cost of a shorter duration, if the robot can be faster.
function priceOfHaste({ duration_s: durationS, time_multiplier_w: priceW }, shortestS) {
  if (durationS <= shortestS * 1.001) return 'no shorter time is possible: the robot is at its limits';
  if (!(priceW >= 0.005)) return 'this is the duration of least energy';
  const price = `at least ${format.text(energy(priceW))}`;
  return durationS - shortestS < 1 ? `less time costs ${price} per second` : `one second less costs ${price}`;
}

// From zero, so that a front that barely saves anything is shown flat.
const energyRange = (_, low, high) => [Math.min(0, low), 1.08 * Math.max(0, high)];

// One row for each duration, in order; a column of energies for the front and one for the plan.
function frontData(answer, joule) {
  const kinds = [answer.pareto, [answer]].map(
    (points) => new Map(points.map((p) => [p.duration_s, p.energy_j / joule])),
  );
  const times = [...new Set(kinds.flatMap((kind) => [...kind.keys()]))].sort((a, b) => a - b);
  return [times, ...kinds.map((kind) => times.map((t) => kind.get(t) ?? null))];
}

export function Front({ answer, take }) {
  const front = answer.pareto.toReversed();
  const scale = energyScale(front.map((p) => p.energy_j));
  const data = useMemo(() => frontData(answer, scale.joule), [answer, scale.joule]);
  const [picked, setAt] = useState(Infinity);
  const at = Math.min(picked, front.length - 1);
  const point = front[at];
  if (front.length < 2)
    return <Empty title="No trade-off">On this path the fastest drive needs the least energy.</Empty>;
  const [first, last] = [front[0], front[front.length - 1]];
  const make = (c) => ({
    scales: { x: { time: false }, y: { range: energyRange } },
    cursor: { y: false, drag: { x: false, y: false }, points: { show: false } },
    axes: [axis('duration, s', { size: 28, space: 70 }), axis(`energy, ${scale.u}`, { size: 72 })],
    series: [
      {},
      line(c.modelled, 1.5, { spanGaps: true, points: { show: true, size: 5, fill: c.modelled } }),
      dots(c.accent, 12, 2),
    ],
  });
  return (
    <>
      <Chart
        make={make}
        data={data}
        height={230}
        label={`Energy against duration, from ${format.span(first.duration_s)} to ${format.span(last.duration_s)}`}
      />
      <p class="note foot">
        <Key of={{ 'accent dot': 'this plan', modelled: 'cheapest for each duration' }} />
      </p>
      <div class="row wrap front-pick" style={{ gap: '8px 14px', marginTop: '8px', fontSize: '13px' }}>
        <label class="row wrap" style={{ gap: '8px' }}>
          <span>Duration</span>
          <input
            type="range"
            style={{ minHeight: '24px', width: '240px' }}
            min="0"
            max={front.length - 1}
            value={at}
            onInput={(e) => setAt(e.currentTarget.valueAsNumber)}
            aria-valuetext={`${format.span(point.duration_s)}, ${format.text(energy(point.energy_j))}`}
          />
        </label>
        <span>
          <span class="number">
            {format.fixed(point.duration_s, 2)} s · {format.text(energy(point.energy_j, 4))}
          </span>
          ; {priceOfHaste(point, answer.certificate.shortest_time_s)}
        </span>
        <Button style={{ marginLeft: 'auto' }} onClick={() => take(point)}>
          Use as deadline
        </Button>
      </div>
    </>
  );
}

// A probability, with meaningful digits only.
function chance(p) {
  if (p > 0.999) return 'more than 99.9\u00a0%';
  if (p < 0.001) return 'less than 0.1\u00a0%';
  return format.share(p, p > 0.99 || p < 0.01 ? 1 : 0);
}

const verdicts = [
  [0.95, 'The charge suffices', 'good'],
  [0.5, 'The charge probably suffices', ''],
  [0.05, 'The charge probably does not suffice', 'bad'],
  [-1, 'The charge does not suffice', 'bad'],
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
  return <Table class="chances" columns={columns} rows={drives} />;
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
  const planned = a.minimum_energy;
  const reasons = [
    `it is a forecast from ${bases[a.consumption.basis](a.consumption)}`,
    a.pace.pause_s > 0.05 &&
      `it includes the usual pause of ${format.fixed(a.pace.pause_s, 1)} s at each stop`,
  ].filter(Boolean);
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
      <p class="note">
        Least energy ({format.text(energy(answer.energy_j))}) is the model’s optimum for this path. The
        expected energy
        {planned && ` (${format.text(energy(planned.expected_energy_j))})`} is what the robot will probably
        use: {reasons.join(', and ')}.
      </p>
    </div>
  );
}

const methods = {
  closed_form: 'closed-form formulas',
  interior_point: 'an interior-point method',
  mixed: 'several methods',
  quadrature: 'quadrature over the speed',
};

export function Certificate({ answer }) {
  const c = answer.certificate;
  const { shortest_time_s: s } = c;
  const above = (c.gap_j + c.discretisation_j) / Math.abs(answer.energy_j);
  const energies = [answer.braking_j, answer.recovered_j].map((joule) => format.text(energy(joule)));
  const rows = [
    ['Computed by', methods[c.method] ?? format.words(c.method)],
    ['Excess over the optimum', above < 0.01 ? 'less than 1\u00a0%' : `at most ${format.share(above)}`],
    ['Global optimum', c.convex ? 'yes: the problem is convex' : 'not proven: the problem is not convex'],
    ['Cost of a shorter time', priceOfHaste({ ...answer, ...c }, s)],
    ['Shortest time', format.known(s) ? `${format.fixed(s, 2)} s, set by the robot’s limits` : 'not bounded'],
    ['Limits reached', c.binding.length === 0 ? 'none' : c.binding.map(format.words).join(', ')],
    ['Braking', `${energies[0]}, of which ${energies[1]} is recovered`],
    ['Peak power', format.text(format.power(answer.peak_power_w))],
    ['Model', `version ${answer.model_version}`],
  ];
  return <Facts rows={rows} />;
}

function noteOf(of, slowed, plan) {
  if (!of) return 'not possible within the limits';
  const saved = 1 - plan.energy_j / of.energy_j;
  const by = format.share(Math.abs(saved), 1);
  const time = `${format.span(of.duration_s)}${slowed ? ', slowed to keep the limits' : ''}`;
  return `${time}; ${saved >= 0 ? `the plan saves ${by}` : `costs ${by} less`}`;
}

// The usual speed profiles, slowed down where they exceed the robot's limits in the plan's duration.
export function Baselines({ answer }) {
  const { trapezoid, triangle } = answer.baselines;
  const rowOf = ([name, baseline]) => {
    const slowed = !baseline?.within_limits;
    const of = slowed ? baseline?.slowed : baseline;
    return [name, of?.energy_j ?? null, 'plain', noteOf(of, slowed, answer)];
  };
  return (
    <>
      <EnergyBars
        label="Energy of the plan, a trapezoid and a triangle within the limits"
        rows={[
          ['Least energy', answer.energy_j, 'least', format.span(answer.duration_s)],
          ...Object.entries({ Trapezoid: trapezoid, Triangle: triangle }).map(rowOf),
        ]}
      />
      <p class="note foot">
        Each profile on every leg between stops, in the plan’s time if the robot’s limits allow it.
      </p>
    </>
  );
}
