// Charts of a plan: speed and power over time, and energy against duration.
import { useMemo, useState } from 'preact/hooks';
import { Chart, axis, line, withAlpha } from '../chart.jsx';
import { energy, energyScale } from '../energy.js';
import * as format from '../format.js';
import { Button, Empty, Key } from '../widgets.jsx';

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

function speedOptions(c, turns, cursor) {
  const yaw = axis('yaw rate, °/s', { scale: 'yaw', side: 1, grid: { show: false } });
  return {
    cursor,
    scales: { x: { time: false }, yaw: {} },
    axes: [axis('', { size: 28 }), axis('speed, m/s'), ...(turns ? [yaw] : [])],
    series: [
      {},
      line(c.accent, 2.25),
      line(c.muted, 1.25, { dash: [6, 4] }),
      line(c.muted, 1.25, { dash: [2, 3] }),
      line(c.modelled, 1.25, { scale: turns ? 'yaw' : 'y' }),
    ],
  };
}

function powerOptions(c, turns, cursor) {
  const nothing = { scale: 'y', side: 1, grid: { show: false }, ticks: { show: false }, values: () => [] };
  return {
    cursor,
    axes: [axis('time, s', { size: 28 }), axis('power, W'), ...(turns ? [axis(' ', nothing)] : [])],
    series: [{}, line(c.accent, 1.75, { fill: withAlpha(c.accent, 0.12) })],
  };
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
  const peak = format.fixed(answer.peak_speed_m_s, 2);
  return (
    <>
      <Chart
        make={(c) => speedOptions(c, turns, cursor)}
        data={data}
        height={210}
        changes={[turns]}
        label={`Speed over ${format.span(answer.duration_s)}, maximum ${peak} metres per second`}
      />
      <Chart
        make={(c) => powerOptions(c, turns, cursor)}
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
export function priceOfHaste({ duration_s: durationS, time_multiplier_w: priceW }, shortestS) {
  if (durationS <= shortestS * 1.001) return 'no shorter time is possible: the robot is at its limits';
  if (!(priceW >= 0.005)) return 'this is the duration of least energy';
  const price = `at least ${format.text(energy(priceW))}`;
  return durationS - shortestS < 1 ? `less time costs ${price} per second` : `one second less costs ${price}`;
}

// From zero, so that a front that barely saves anything is shown flat.
const energyRange = (_, low, high) => [Math.min(0, low), 1.08 * Math.max(0, high)];

function frontOptions(c, unit) {
  const points = { show: true, size: 12, width: 2, stroke: c.accent, fill: c.accent };
  return {
    scales: { x: { time: false }, y: { range: energyRange } },
    cursor: { y: false, drag: { x: false, y: false }, points: { show: false } },
    axes: [axis('duration, s', { size: 28, space: 70 }), axis(`energy, ${unit}`, { size: 72 })],
    series: [
      {},
      { stroke: c.modelled, width: 1.5, spanGaps: true, points: { show: true, size: 5, fill: c.modelled } },
      { stroke: 'transparent', paths: () => null, points },
    ],
  };
}

// One row for each duration, in order; a column of energies for the front and one for the plan.
function frontData(answer, joule) {
  const kinds = [answer.pareto, [answer]].map(
    (points) => new Map(points.map((p) => [p.duration_s, p.energy_j / joule])),
  );
  const times = [...new Set(kinds.flatMap((kind) => [...kind.keys()]))].sort((a, b) => a - b);
  return [times, ...kinds.map((kind) => times.map((t) => kind.get(t) ?? null))];
}

export function Front({ answer, take }) {
  const front = answer.pareto;
  const scale = energyScale(front.map((p) => p.energy_j));
  const data = useMemo(() => frontData(answer, scale.joule), [answer, scale.joule]);
  const [at, setAt] = useState(0);
  const point = front[Math.min(at, front.length - 1)];
  if (front.length < 2)
    return <Empty title="No trade-off">On this path the fastest drive needs the least energy.</Empty>;
  const [first, last] = [front[0], front[front.length - 1]];
  return (
    <>
      <Chart
        make={(c) => frontOptions(c, scale.u)}
        data={data}
        height={230}
        changes={[]}
        label={`Energy against duration, from ${format.span(first.duration_s)} to ${format.span(last.duration_s)}`}
      />
      <p class="note foot">
        <Key of={{ 'accent dot': 'this plan', modelled: 'cheapest for each duration' }} />
      </p>
      <div class="front-pick">
        <label>
          <span>Duration</span>
          <input
            type="range"
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
        <Button onClick={() => take(point)}>Use as deadline</Button>
      </div>
    </>
  );
}
