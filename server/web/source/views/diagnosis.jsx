// The result of a diagnosis.
import { useMemo, useState } from 'preact/hooks';
import { Bars } from '../bars.jsx';
import { Chart, axis, bars, line } from '../chart.jsx';
import { strokeThrough } from '../floor.jsx';
import * as format from '../format.js';
import { Table, TablePanel, column, figure } from '../table.jsx';
import { palette } from '../theme.js';
import { Choice, Empty, Key, Panel, Readouts, TextPanel, Texts } from '../widgets.jsx';
import { unitOf } from './changes.jsx';
import { FloorCanvas } from './floor_canvas.jsx';
import { chance, effectName, likelyNames, rangeOf, share, verdictTitle } from './jobs.jsx';

// Charts and tables of a diagnosis: the error of the modelled power by operating condition, on the floor and
// over time; and the parts of a comparison of groups and of a diagnosis of run energies.
const states = { before_w: 'Robot file', after_w: 'With the effects' };

const rowsOf = (columns) =>
  Object.values(columns)[0].map((_, k) =>
    Object.fromEntries(Object.entries(columns).map(([name, values]) => [name, values[k]])),
  );

const coloursOf = (after) => ({ gap: 'robot file', modelled: after && 'with the effects' });

// The 95 % intervals of the first series.
function drawWhiskers(u, half, shift) {
  const width = 1.5 * devicePixelRatio;
  const y = (value) => u.valToPos(value, 'y', true);
  half.forEach((w, k) => {
    if (!format.known(w)) return;
    const x = u.valToPos(u.data[0][k] + shift, 'x', true);
    strokeThrough(u.ctx, palette().ink, width, x, y(u.data[1][k] - w), x, y(u.data[1][k] + w));
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
      label={`Error of the modelled power over ${name}: ${map.before_w
        .map((w, k) => `${named ? map.label[k] : format.digits(middles[k], 2)} ${format.digits(w, 2)} W`)
        .join(', ')}`}
    />
  );
}

// A place that an effect names, as a zone of the map.
const zonesOf = (effects) =>
  effects
    .map((e) => e.parameters)
    .filter((p) => p.x_m && p.y_m && p.radius_m)
    .map(({ x_m: x, y_m: y, radius_m: r }) => ({
      x_min_m: x.value - r.value,
      x_max_m: x.value + r.value,
      y_min_m: y.value - r.value,
      y_max_m: y.value + r.value,
    }));

function FloorFigure({ floor, effects }) {
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
  const aside = effects.length > 0 && <Choice label="Model" options={states} value={shown} onChange={show} />;
  return (
    <Panel title="Where on the floor" aside={aside}>
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

function PowerFigure({ power, after }) {
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
        label={`Measured and modelled power of mission ${power.mission_id}`}
      />
      <p class="note foot">
        <Key of={{ measured: 'measured', ...coloursOf(after) }} />
      </p>
      <p class="note foot">The part of mission {power.mission_id} with the largest gap.</p>
    </Panel>
  );
}

const missionColumns = [
  column('id', 'Mission', (m) => m.mission_id, { head: true }),
  column('start', 'Started', (m) => format.time(m.start_utime_us), { class: 'when' }),
  figure('length', 'Duration', (m) => format.span(m.length_s)),
  figure('payload', 'Payload, kg', (m) => format.digits(m.payload_kg)),
  figure('energy_before', 'Gap in energy', (m) => share(m.energy_before)),
  figure('energy_after', 'With the effects', (m) => share(m.energy_after)),
  figure('power_before', 'Gap in power', (m) => share(m.power_before)),
  figure('power_after', 'With the effects', (m) => share(m.power_after)),
];

const perMetre = (value) => format.signed(format.digits(value));

const groupColumns = [
  column('name', 'Group', (g) => g.name, { head: true }),
  figure('missions', 'Missions', (g) => g.missions),
  figure('way', 'Distance, m', (g) => format.digits(g.way_m)),
  figure('energy', 'Measured, J/m', (g) => format.digits(g.energy_per_m_j)),
  figure('model', 'Modelled, J/m', (g) => format.digits(g.model_per_m_j)),
];
const suffix = (unit) => (unit === '1' ? '' : ` ${unit}`);
const strengthColumns = [
  column('group', 'Group', ([name]) => name, { head: true }),
  figure('value', 'Above the weakest', ([, g, unit]) => format.withDeviation(g.value, g.sd) + suffix(unit)),
  figure('energy', 'Energy, J/m', ([, g]) => perMetre(g.energy_per_m_j)),
];
const partColumns = [
  column('part', 'Part', ([name]) => name, { head: true }),
  figure('energy', 'J/m', ([, value]) => perMetre(value)),
];

function Comparison({ of: c }) {
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

const channels = {
  battery_power: 'battery power',
  wheel_torque: 'wheel torque',
  motor_voltage: 'motor voltage',
  battery_voltage: 'battery voltage',
};

// Ratios are relative changes of the model's value; angles are shown in degrees, slopes also in percent.
function strength(effect, name, { value, sd, unit }) {
  const scaled = (factor) => format.withDeviation(factor * value, format.known(sd) ? factor * sd : sd);
  if (name === 'side') return value < 0.5 ? 'right' : 'left';
  if (name === 'ratio') return `${value < 0 ? '' : '+'}${scaled(100)} %`;
  if (unit === 'rad' || unit === 'rad/s') {
    const slope = /tilt|grade|slope|climb/.test(`${effect} ${name}`) && Math.abs(value) < 0.5;
    const percent = slope ? ` (${format.digits(100 * Math.tan(value), 2)} % slope)` : '';
    return `${scaled(format.degrees(1))}${unit === 'rad' ? '°' : '°/s'}${percent}`;
  }
  return scaled(1) + suffix(unit);
}

// The lines of an effect's parameters; a place is one line.
function strengths({ id, parameters: all }) {
  const { x_m: x, y_m: y, ...others } = all;
  const lines = Object.entries(x && y ? others : all)
    .filter(([name, p]) => p.value !== 0 || p.sd > 0 || name === 'side')
    .map(([name, p]) => [name === 'ratio' ? 'by' : unitOf(name)[0], strength(id, name, p)]);
  if (x && y) lines.push(['centre', `(${format.digits(x.value)}, ${format.digits(y.value)}) m`]);
  return lines.map(([name, text]) => (
    <div key={name}>
      <span class="note">{name}</span> {text}
    </div>
  ));
}

// "speed_m_s" from 0.2 to 0.4 -> ["speed", "0.2 to 0.4 m/s"]
function region(w) {
  const [name, unit] = unitOf(w.variable);
  if (typeof w.from === 'string') return [name, unit ? `${w.from.replaceAll('-', '−')} ${unit}` : w.from];
  if (!unit.startsWith('rad')) return [name, `${format.range(w.from, w.to)} ${unit}`];
  return [name, `${format.range(format.degrees(w.from), format.degrees(w.to))} °${unit.slice(3)}`];
}

function WhereBar({ of: w, most }) {
  const at = (value) => `${(100 * Math.min(most, Math.max(0, value))) / most}%`;
  const time = w.time_share;
  const ends = w.ci.map(Math.abs).sort((a, b) => a - b);
  return (
    <svg width="100%" height="16" aria-hidden="true">
      <rect
        x="0"
        y="3"
        height="10"
        width={at(Math.max(Math.abs(w.share), most / 200))}
        class={`account ${w.share < 0 ? 'good' : 'gap'}`}
        opacity={w.share < 0 ? 1 : 0.75}
      />
      <line x1={at(ends[0])} x2={at(ends[1])} y1="8" y2="8" stroke="var(--ink)" stroke-width="1.5" />
      {format.known(time) && (
        <line x1={at(time)} x2={at(time)} y1="0" y2="16" stroke="var(--ink)" stroke-width="2" />
      )}
    </svg>
  );
}

// A line below the name of an effect or a term.
const Check = ({ children }) => <span class="note check">{children}</span>;

function Where({ regions }) {
  if (regions.length === 0) return <Empty title="No region with a significant gap" />;
  const shown = regions.slice(0, 12);
  const most = Math.max(...shown.flatMap((w) => [w.share, w.ci[1] ?? 0, w.time_share ?? 0].map(Math.abs)));
  return (
    <>
      <Bars
        class="where"
        head={['Region', 'Bar', 'Share of the gap']}
        rows={shown.map((w) => ({
          name: [
            `${channels[w.channel] ?? format.words(w.channel)} `,
            <span class="note">{region(w)[0]}</span>,
            ` ${region(w)[1]}`,
          ],
          bar: <WhereBar of={w} most={most} />,
          of: format.signed(share(w.share, 0)),
        }))}
      />
      <p class="note foot">
        Bar: share of the gap in power. Upright mark: share of the time; a uniform gap would reach it. Line:
        95 % interval. Regions overlap.
      </p>
    </>
  );
}

const Effect = ({ id, workshop, power_w: power, calibrates, varies }) => [
  effectName(id),
  workshop && <Check>check: {workshop}</Check>,
  power > 0 && <Check>{format.text(format.power(power))} on average</Check>,
  calibrates && <Check>corrects {calibrates} of the robot file</Check>,
  varies >= 0.01 && <Check>varies by {share(varies, 0)} between missions</Check>,
];
const effectColumns = [
  column('effect', 'Effect', Effect, { head: true }),
  figure('probability', 'Probability', (e) => chance(e.probability)),
  column('strength', 'Strength', strengths),
  figure('share', 'Returns without it', (e) => (e.share > 1 ? '> 100 %' : share(e.share, 0)), {
    hint: 'part of the closed gap that returns if this effect is omitted',
  }),
  figure('group', 'Group', (e) => chance(e.group), {
    hint: 'probability that it or one of the effects confounded with it is present',
  }),
  column('alternatives', 'Confounded with', (e) => e.alternatives.map(effectName).join(', ') || '–', {
    class: 'words',
  }),
];

const correctionColumns = [
  column('parameter', 'Parameter', (c) => c.parameter, { head: true }),
  figure('file', 'In the file', (c) => format.digits(c.file)),
  figure('fits', 'Fits', (c) => format.withDeviation(c.fits, c.sd)),
];

const barOf = (name, value, note) => ({ name, value, of: format.percent(value, 1), channel: 'plain', note });
// "v^2" as "v²".
const powers = (text) => text.replaceAll('^2', '²').replaceAll('^3', '³');
const termColumns = [
  column('term', 'Term', ([name, { unit }]) => [powers(name), <Check> {powers(unit)}</Check>], {
    head: true,
  }),
  figure('data', 'In the data', ([, t]) => format.withDeviation(t.value, t.sd)),
  figure('model', 'Robot file', ([, t]) => format.likeDeviation(t.model, t.sd)),
  figure('explained', 'This diagnosis', ([, t]) => format.likeDeviation(t.explained, t.sd)),
];

// The diagnosis compared with a linear regression, on the same held-out parts.
function Regression({ of }) {
  const rows = [
    ['Linear regression', of.held_out],
    ['This diagnosis', of.explanation_held_out],
    ['Robot file unchanged', of.unchanged_model_held_out],
  ];
  const terms = Object.entries(of.terms);
  return (
    <Panel title="Compared with a linear regression" aside={of.wins && <b>The regression predicts better</b>}>
      <Bars class="referee" rows={rows.map(([name, value]) => barOf(name, value))} />
      {terms.length > 0 && <Table class="effects" columns={termColumns} rows={terms} />}
      <Texts of={of.says} />
      <p class="note foot">
        Power error on held-out data: parts of the missions that were not used for the fit.
      </p>
    </Panel>
  );
}

const verdictNotes = {
  none: 'Measured and modelled energy agree, as far as these missions can show.',
  effects: 'The model lacks the effects that are listed here.',
  outside: 'No effect of the catalogue describes the cause.',
  not_this_robot: 'The robot file does not match this robot.',
  inconclusive: 'The cause of the gap cannot be determined from these missions.',
};

function Verdict({ result: r }) {
  const name = verdictTitle(r);
  const effects = likelyNames(r);
  return (
    <div class={`verdict-box ${r.verdict === 'none' || r.verdict === 'effects' ? '' : 'bad'}`}>
      <p class="verdict">
        <b>{name[0].toUpperCase() + name.slice(1)}</b>
        {effects && `${r.verdict === 'effects' ? ':' : '; most likely'} ${effects}`}
      </p>
      <p class="note">
        {verdictNotes[r.verdict]}
        {!['inconclusive', 'not_this_robot'].includes(r.verdict) &&
          ` Probability of this verdict: ${chance(r.verdict_probability)}.`}
      </p>
      <Texts of={r.reasons} />
    </div>
  );
}

function Figures({ result: r }) {
  const { gap, shrinkage: s } = r;
  const found = r.effects.length > 0;
  const rows = [
    ['Gap in power', format.percent(gap.power_absolute_relative, 1), `noise ${share(gap.noise_floor)}`],
    ['Gap in energy', format.percent(gap.energy_relative, 1)],
    found && ['Held-out error', format.percent(s.held_out_after, 1), `from ${share(s.held_out_before)}`],
    found && ['Gap reduced by', format.percent(s.fraction, 0), rangeOf(s.ci, 0)],
    ['Missions', `${r.missions}`, `${format.fixed(r.samples)} samples`],
  ];
  return <Readouts large rows={rows} />;
}

function NextDrives({ result: r }) {
  const decided =
    r.verdict === 'none' || (r.verdict === 'effects' && r.effects.every((e) => e.alternatives.length === 0));
  if (r.next_drive.length === 0)
    return (
      <p class="note">
        {decided
          ? 'No further drive is needed.'
          : `No drive would determine the cause${r.effects.length > 0 ? '; the effects list what to check' : ''}.`}
      </p>
    );
  return (
    <ol class="next" style={{ paddingLeft: '22px' }}>
      {r.next_drive.map((n) => (
        <li>
          <b>{n.manoeuvre}</b> <span class="note">to distinguish {format.words(n.separates)}</span>
        </li>
      ))}
    </ol>
  );
}

const floorOf = (r) =>
  r.figures?.floor.x_m.length > 3 && <FloorFigure floor={r.figures.floor} effects={r.effects} />;

function Charts({ result: r }) {
  const f = r.figures;
  const missions = rowsOf(f.missions);
  const after = r.effects.length > 0;
  return (
    <>
      {f.maps.length > 0 && (
        <Panel title="Error of the modelled power by operating condition">
          <div class="charts">
            {f.maps.map((map) => (
              <ConditionChart key={map.axis} map={map} after={after} />
            ))}
          </div>
          <p class="note foot">
            <Key of={coloursOf(after)} />
          </p>
          <p class="note foot">
            Above zero the robot consumes more than its model. Lines: 95 % intervals of the robot file.
          </p>
        </Panel>
      )}
      {f.power.t_s.length > 4 && <PowerFigure power={f.power} after={after} />}
      <TablePanel
        title="Missions"
        columns={missionColumns.filter((c) => after || !c.key.endsWith('_after'))}
        rows={missions}
        note={r.missions > missions.length && `The first ${missions.length} of ${r.missions} missions.`}
      />
    </>
  );
}

const readingsOf = (r) =>
  Object.entries(r.channels ?? {})
    .filter(([, { absolute_relative: error }]) => format.known(error))
    .map(([name, { absolute_relative: error, noise_floor: noise }]) =>
      barOf(channels[name] ?? format.words(name), error, `noise ${share(noise)}`),
    );

const limitsOf = (r) =>
  [
    !r.motor_channels &&
      'Motor currents were not recorded: effects in motors, drivers and friction are harder to distinguish.',
    r.power === 'motors' &&
      'The battery was not recorded: power is that of the motors, without the base load.',
    r.power === 'none' && 'No power was recorded: effects are estimated from other readings.',
    r.gap.detectable_share > 0 &&
      `An effect of less than ${share(r.gap.detectable_share)} of the power is not detectable.`,
    ...(r.limits ?? []),
    ...(r.notes ?? []),
  ].filter(Boolean);

// `children`: the adoption of its effects.
export function Result({ result: r, children }) {
  const limits = limitsOf(r);
  const readings = readingsOf(r);
  const placed = r.effects.some((e) => e.parameters.x_m); // its map comes first
  return (
    <>
      <TextPanel
        title="Checks of the recordings"
        of={r.checks?.map((c) => (c.contradicted ? `${c.says} It is not used below.` : c.says))}
      />
      <Verdict result={r} />
      <Figures result={r} />
      <TablePanel title="Effects" class="effects" columns={effectColumns} rows={r.effects} />
      {placed && floorOf(r)}
      {children && <Panel title="Adopt">{children}</Panel>}
      <TablePanel
        title="Values of the robot file that fit"
        class="effects"
        columns={correctionColumns}
        rows={r.corrections}
      />
      {r.verdict !== 'none' && (
        <div class="columns">
          <Panel title="Where the gap arises">
            <Where regions={r.where} />
          </Panel>
          <div>
            {r.baseline && <Regression of={r.baseline} />}
            <Panel title="Next drives">
              <NextDrives result={r} />
            </Panel>
          </div>
        </div>
      )}
      {r.groups && <Comparison of={r} />}
      {r.runs && (
        <TablePanel
          title="Runs"
          columns={runColumns}
          rows={r.runs}
          note={`Error: measured minus modelled energy, in percent of the measured. Without any cause runs scatter by ${share(r.scatter.run)}.`}
        />
      )}
      {r.figures && <Charts result={r} />}
      {!placed && floorOf(r)}
      {readings.length > 0 && (
        <Panel title="Error of each kind of reading">
          <Bars rows={readings} />
        </Panel>
      )}
      <TextPanel title="Limits" of={limits} />
    </>
  );
}
