// Charts and tables of a diagnosis: the error of the modelled power by operating condition, on the floor and
// over time; and the parts of a comparison of groups and of a diagnosis of run energies.
import { useMemo, useState } from 'preact/hooks';
import { Chart, axis, bars, line } from '../chart.jsx';
import { strokeThrough } from '../floor.jsx';
import * as format from '../format.js';
import { TablePanel, column, figure } from '../table.jsx';
import { palette } from '../theme.js';
import { Choice, Key, Panel } from '../widgets.jsx';
import { FloorCanvas } from './floor_canvas.jsx';
import { effectName, share } from './jobs.jsx';

const states = { before_w: 'Robot file', after_w: 'With the effects' };

const rowsOf = (columns) =>
  Object.values(columns)[0].map((_, k) =>
    Object.fromEntries(Object.entries(columns).map(([name, values]) => [name, values[k]])),
  );

const Colours = ({ measured, after }) => (
  <p class="note foot">
    <Key
      of={{ measured: measured && 'measured', gap: 'robot file', modelled: after && 'with the effects' }}
    />
  </p>
);

// The 95 % intervals of the first series.
function drawWhiskers(u, half, shift) {
  const c = u.ctx;
  c.strokeStyle = palette().ink;
  c.lineWidth = 1.5 * devicePixelRatio;
  half.forEach((w, k) => {
    if (!format.known(w)) return;
    const x = u.valToPos(u.data[0][k] + shift, 'x', true);
    strokeThrough(c, x, u.valToPos(u.data[1][k] - w, 'y', true), x, u.valToPos(u.data[1][k] + w, 'y', true));
  });
}

function ConditionChart({ map, after }) {
  const named = map.label[0] !== '';
  const angular = map.axis.includes('rad/s');
  const name = map.axis.replace('rad/s', '°/s');
  const middles = useMemo(() => {
    const at = map.from.map((from, k) => 0.5 * (from + map.to[k]));
    return angular ? at.map(format.degrees) : at;
  }, [map]);
  const data = useMemo(() => [middles, map.before_w, ...(after ? [map.after_w] : [])], [middles, map, after]);
  const step = middles.length > 1 ? middles[1] - middles[0] : 1;
  const make = (c) => {
    const low = Math.min(0, ...map.before_w.map((v, k) => v - (map.half_width_w[k] ?? 0)));
    const high = Math.max(0, ...map.before_w.map((v, k) => v + (map.half_width_w[k] ?? 0)));
    const of = (colour, width, start) =>
      line(colour, 1, { fill: colour, paths: bars(width * step, start * step) });
    const words = { splits: () => middles, values: () => map.label, rotate: -25, size: 54 };
    return {
      cursor: { show: false },
      scales: {
        x: { time: false, range: () => [middles[0] - step / 2, middles[middles.length - 1] + step / 2] },
        y: { range: (_, least, most) => [1.05 * Math.min(low, least), 1.05 * Math.max(high, most)] },
      },
      axes: [axis(named ? '' : name, named ? words : { size: 28 }), axis('measured − modelled, W')],
      series: [{}, of(c.gap, after ? 0.4 : 0.8, -0.4), ...(after ? [of(c.modelled, 0.4, 0)] : [])],
      hooks: { draw: [(u) => drawWhiskers(u, map.half_width_w, after ? -0.2 * step : 0)] },
    };
  };
  return (
    <Chart
      make={make}
      data={data}
      changes={[after]}
      label={`Error of the modelled power over ${name}: ${map.before_w
        .map((w, k) => `${named ? map.label[k] : format.digits(middles[k], 2)} ${format.digits(w, 2)} W`)
        .join(', ')}`}
    />
  );
}

export function Conditions({ maps, after }) {
  if (maps.length === 0) return null;
  return (
    <Panel title="Error of the modelled power by operating condition">
      <div class="charts">
        {maps.map((map) => (
          <ConditionChart key={map.axis} map={map} after={after} />
        ))}
      </div>
      <Colours after={after} />
      <p class="note foot">
        Above zero the robot consumes more than its model. Lines: 95 % intervals of the robot file.
      </p>
    </Panel>
  );
}

// A place that an effect names, as a zone of the map.
function zonesOf(effects) {
  return effects
    .map((e) => e.parameters)
    .filter((p) => p.x_m && p.y_m && p.radius_m)
    .map(({ x_m: x, y_m: y, radius_m: r }) => ({
      x_min_m: x.value - r.value,
      x_max_m: x.value + r.value,
      y_min_m: y.value - r.value,
      y_max_m: y.value + r.value,
    }));
}

export function FloorFigure({ floor, effects }) {
  const [shown, show] = useState('before_w');
  const [marked, mark] = useState(null);
  const map = useMemo(() => {
    const { cell_m: side, ...columns } = floor;
    const [x, y] = [floor.x_m, floor.y_m];
    const bounds = {
      x_min_m: Math.min(...x),
      x_max_m: Math.max(...x) + side,
      y_min_m: Math.min(...y),
      y_max_m: Math.max(...y) + side,
    };
    return { cells: rowsOf(columns), bounds, cell_m: side, zones: zonesOf(effects) };
  }, [floor]);
  const choice = effects.length > 0 && (
    <Choice label="Model" options={states} value={shown} onChange={show} />
  );
  return (
    <Panel title="Where on the floor" aside={choice}>
      <FloorCanvas
        key={shown}
        map={map}
        value={(cell) => cell[shown]}
        kind="gap"
        title="measured − modelled"
        unit="W"
        marked={marked}
        onMark={mark}
      />
      <p class="note foot">
        {marked
          ? `(${format.digits(marked.x_m)}, ${format.digits(marked.y_m)}) m: ${format.digits(marked.before_w)} W, with the effects ${format.digits(marked.after_w)} W, ${marked.windows} readings`
          : 'Point at a square for its values.'}
      </p>
    </Panel>
  );
}

export function PowerFigure({ power, after }) {
  const data = useMemo(
    () => [power.t_s, power.measured_w, power.before_w, ...(after ? [power.after_w] : [])],
    [power, after],
  );
  const make = (c) => ({
    axes: [axis('time since the start, s', { size: 28 }), axis('power, W')],
    series: [{}, line(c.measured), line(c.gap), ...(after ? [line(c.modelled)] : [])],
  });
  return (
    <Panel title="Power over time">
      <Chart
        make={make}
        data={data}
        height={260}
        changes={[after]}
        label={`Measured and modelled power of mission ${power.mission_id}`}
      />
      <Colours measured after={after} />
      <p class="note foot">The part of mission {power.mission_id} with the largest gap.</p>
    </Panel>
  );
}

const missionColumns = [
  column('id', 'Mission', (m) => m.mission_id, { head: true }),
  column('start', 'Started', (m) => format.time(m.start_utime_us), { class: 'when' }),
  figure('length', 'Duration', (m) => format.span(m.length_s)),
  figure('payload', 'Payload, kg', (m) => format.digits(m.payload_kg)),
  ...[
    ['energy_before', 'Gap in energy'],
    ['energy_after', 'With the effects'],
    ['power_before', 'Gap in power'],
    ['power_after', 'With the effects'],
  ].map(([key, title]) => figure(key, title, (m) => share(m[key]))),
];

export function MissionFigures({ missions: all, total, after }) {
  const missions = rowsOf(all);
  const columns = missionColumns.filter((c) => after || !c.key.endsWith('_after'));
  return (
    <TablePanel
      title="Missions"
      columns={columns}
      rows={missions}
      note={total > missions.length && `The first ${missions.length} of ${total} missions.`}
    />
  );
}

const perMetre = (value) => format.signed(format.digits(value));

const groupColumns = [
  column('name', 'Group', (g) => g.name, { head: true }),
  figure('missions', 'Missions', (g) => g.missions),
  figure('way', 'Distance, m', (g) => format.digits(g.way_m)),
  figure('energy', 'Measured, J/m', (g) => format.digits(g.energy_per_m_j)),
  figure('model', 'Modelled, J/m', (g) => format.digits(g.model_per_m_j)),
];
const strengthColumns = [
  column('group', 'Group', ([name]) => name, { head: true }),
  figure(
    'value',
    'Above the weakest',
    ([, g, unit]) => `${format.withDeviation(g.value, g.sd)}${unit === '1' ? '' : ` ${unit}`}`,
  ),
  figure('energy', 'Energy, J/m', ([, g]) => perMetre(g.energy_per_m_j)),
];
const partColumns = [
  column('part', 'Part', ([name]) => name, { head: true }),
  figure('energy', 'J/m', ([, value]) => perMetre(value)),
];

export function Comparison({ of: c }) {
  const d = c.difference;
  const parts = d && [
    ['motion and load', d.by_motion_j],
    ...Object.entries(d.by_effect_j).map(([id, value]) => [effectName(id), value]),
    ['not explained', d.unexplained_j],
    ['measured', d.energy_per_m_j],
  ];
  return (
    <>
      <TablePanel title="Groups" columns={groupColumns} rows={c.groups} />
      {d && (
        <TablePanel
          title={`Energy per metre of ${d.to} above ${d.from}`}
          columns={partColumns}
          rows={parts}
        />
      )}
      {c.strengths.map((s) => (
        <TablePanel
          key={s.id}
          title={`${effectName(s.id)} by group`}
          columns={strengthColumns}
          rows={Object.entries(s.groups).map(([name, g]) => [name, g, s.unit])}
        />
      ))}
    </>
  );
}

const off = (key) => (r) => format.signed(share(1 - r[key] / r.measured_j));
const runColumns = [
  column('run', 'Run', (r) => (r.table ? `${r.table}: ${r.run}` : r.run), { head: true }),
  figure('measured', 'Measured, J', (r) => format.digits(r.measured_j)),
  figure('model', 'Error of the model', off('model_j')),
  figure('held', 'With the effects, run held out', off('held_out_j')),
];

export function Runs({ of: r }) {
  return (
    <TablePanel
      title="Runs"
      columns={runColumns}
      rows={r.runs}
      note={`Error: measured minus modelled energy, in percent of the measured. Without any cause runs scatter by ${share(r.scatter.run)}.`}
    />
  );
}
