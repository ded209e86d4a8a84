// Energy per day or week, consumption and ratio of the fleet or of robots side by side, compared with the
// period before; or of single missions.
import { useMemo } from 'preact/hooks';
import { get, query, useGet, useRead } from '../api.js';
import { Strips } from '../bars.jsx';
import { Chart, axis, bars, dateAxis, line, timesWith, withGaps } from '../chart.jsx';
import { consumption, energy, energyIn, energyScale, perMetre } from '../energy.js';
import { useTariff, worthNames, worthOf, worthTexts } from '../tariff.js';
import * as format from '../format.js';
import { newest } from '../logs.js';
import { missionLink, robotLink, useChoices } from '../route.js';
import { Table, TablePanel, column, figure } from '../table.jsx';
import { palette } from '../theme.js';
import { effectOn, termName } from '../waterfall.jsx';
import { Answer, Choice, Panel, Ratio, Readouts } from '../widgets.jsx';
import { Filters, Misordered, Several, SomeRobots, fieldsOf, misordered, timesOf } from './choosing.jsx';
import { Export, csvOf } from './export.jsx';

const defaultDays = { day: 30, week: 182 };
const lasts = { 1: '24 h', 7: '7 d', 30: '30 d', 182: '26 weeks' };
const dayMs = 86_400_000;
const mostStays = 20_000; // at chargers
const fewest = 8; // periods that the time axis spans, so that the bar of a single one stays narrow
const dashes = [[], [6, 4], [2, 3], [9, 3, 2, 3], [12, 4], [1, 2]];

const totalsPath = (filter) => `/v1/mission-totals${query(filter)}`;

// The chosen period and the one compared with it, by default as long before it, as the service's parameters.
function periodsOf(given, kind) {
  const { to_utime_us: to = Date.now() * 1000, from_utime_us: start } = timesOf(given.from, given.to);
  const from = start ?? to - (Number(given.last) || defaultDays[kind]) * dayMs * 1000;
  const own = timesOf(given.from2, given.to2);
  const end = own.to_utime_us ?? (own.from_utime_us ? own.from_utime_us + to - from : from);
  return [
    [from, to],
    [own.from_utime_us ?? end - (to - from), end],
  ].map(([first, last]) => ({ from_utime_us: Math.round(first), to_utime_us: Math.round(last) }));
}

// {now, before, sides}: totals of the chosen robots in both periods, and {name, link, totals} of the sides:
// robots if there are several, otherwise the periods.
async function readSides(periods, robots, signal) {
  const totals = (filter) => get(totalsPath(filter), signal);
  const [now, before] = await Promise.all(
    periods.map((times) => totals({ robot_id: robots.join(), ...times })),
  );
  const ofRobot = async (robot) => ({
    name: robot,
    link: robotLink(robot),
    totals: await totals({ robot_id: robot, ...periods[0] }),
  });
  const sides =
    robots.length > 1
      ? await Promise.all(robots.map(ofRobot))
      : [
          { name: 'This period', totals: now },
          { name: 'Compared period', totals: before },
        ];
  return { now, before, sides };
}

// Most ids of missions begin with the robot's.
const nameOf = ({ robot_id: robot, mission_id: id }) => (id.startsWith(robot) ? id : `${robot} ${id}`);

// The same of single missions.
const readMissions = (ids, signal) =>
  Promise.all(
    ids.map(async (id) => {
      const path = `/v1/missions/${encodeURIComponent(id)}`;
      const [mission, { ledger }] = await Promise.all([get(path, signal), get(`${path}/ledger`, signal)]);
      return { name: nameOf(mission), link: missionLink(id), totals: { ...mission, ledger } };
    }),
  );

// One series a robot, or one of the fleet: [{name, groups}].
async function readSeries(filter, robots, signal) {
  const { groups } = await get(totalsPath(filter), signal);
  const of = (name) => groups.filter(({ robots: [id] }) => !id || id === name);
  return (robots.length > 0 ? robots : ['Fleet']).map((name) => ({ name, groups: of(name) }));
}

const joule = (t) => t.energy.battery_j;
const modelled = (t) => t.energy.modelled_j;
const meanPower = (t) => (t.energy.duration_s > 0 ? joule(t) / t.energy.duration_s : null);
const ratioCell = (v) => <Ratio value={v} />;

// The figures of totals: {key, title, of(totals), cell(value)}; energies in the unit of `joules`. The last
// three are for comparisons only.
function measuresOf(tariff, joules) {
  const scale = energyScale(joules);
  const energyCell = (v) => energyIn(scale, v);
  const priced = worthNames.filter(([key]) => worthOf(tariff, 0)[key]);
  const worthCell = (key) => (v) => worthOf(tariff, v)[key] ?? format.unit(null);
  const row = (key, title, of, cell, more) => ({ key, title, of, cell, ...more });
  return [
    row('missions', 'Missions', (t) => t.missions, format.fixed, { count: true }),
    row('energy', 'Energy', joule, energyCell),
    ...priced.map(([key, name]) => row(key, name, joule, worthCell(key))),
    row('distance', 'Distance', (t) => t.energy.distance_m, format.kilometres),
    row('consumption', 'Consumption', perMetre, consumption, { class: 'figure long' }),
    row('ratio', 'Ratio', (t) => t.ratio, ratioCell),
    row('modelled', 'Modelled', modelled, energyCell),
    row('duration', 'Duration', (t) => t.energy.duration_s, format.span),
    row('power', 'Mean power', meanPower, format.power),
  ];
}

// Seconds of each period that any series has, and a column of the values of each. Where periods are missing
// stands one that no series has, so that no line spans the gap.
function aligned(series, kind, value) {
  const all = [...new Set(series.flatMap((s) => s.groups.map((g) => g.from_utime_us)))];
  all.sort((a, b) => a - b);
  const x = withGaps(all, (kind === 'week' ? 7.5 : 1.5) * dayMs * 1000);
  const columns = series.map(({ groups }) => {
    const values = new Map(groups.map((g) => [g.from_utime_us, value(g)]));
    return x.map((at) => values.get(at) ?? null);
  });
  return [x.map((v) => v / 1e6), ...columns];
}

const coloursOf = (p) => [p.measured, p.modelled, p.gap, p.ink, p.muted];

// With `amount`, a sum over the period: bars, and the period that has not ended is only outlined.
function TrendChart({ series, kind, label, value, unit, zero, amount }) {
  const periodMs = (kind === 'week' ? 7 : 1) * dayMs;
  const data = useMemo(() => {
    const [x, ...columns] = aligned(series, kind, value);
    const ended = (second) => second * 1000 + periodMs <= Date.now();
    if (!amount) return [x, ...columns];
    const only = (wanted) => columns.map((c) => c.map((v, k) => (ended(x[k]) === wanted ? v : null)));
    return [x, ...only(true), ...only(false)];
  }, [series, unit]);
  const make = (p) => {
    const colours = coloursOf(p);
    const points = { show: true, size: 6 };
    const wide = 0.7 * (periodMs / 1000);
    return {
      cursor: {},
      padding: [8, 44, 0, 0],
      scales: {
        x: timesWith((spanS) => Math.max(0.08 * spanS, ((fewest * periodMs) / 1000 - spanS) / 2)),
        y: zero ? { range: (_, low, high) => [Math.min(0, low), high > 0 ? 1.08 * high : 1] } : {},
      },
      axes: [axis('', dateAxis(kind === 'week' ? 7 : 1)), axis(unit)],
      series: [
        {},
        ...[...series, ...(amount ? series : [])].map(({ name }, n) => {
          const k = n % series.length;
          const stroke = colours[k % colours.length];
          if (!amount) return { label: name, stroke, dash: dashes[k % dashes.length], width: 1.5, points };
          const paths = bars(wide / series.length, (k / series.length - 0.5) * wide);
          return line(stroke, 1.5, { paths, fill: n < series.length ? stroke : undefined });
        }),
      ],
    };
  };
  return <Chart make={make} data={data} label={label} height={200} changes={[series, unit]} />;
}

function Names({ series }) {
  const colours = coloursOf(palette());
  if (series.length < 2) return null;
  const lineOf = (k) => ({
    stroke: colours[k % colours.length],
    'stroke-dasharray': dashes[k % dashes.length].join(' '),
  });
  return (
    <p class="row wrap note key trend-key" style={{ margin: '0 0 10px', gap: '4px 16px' }}>
      {series.map((s, k) => (
        <span key={s.name}>
          <svg width="34" height="8" aria-hidden="true">
            <line x1="0" x2="34" y1="4" y2="4" stroke-width="2" {...lineOf(k)} />
          </svg>{' '}
          {s.name}
        </span>
      ))}
    </p>
  );
}

function Periods({ series, kind }) {
  const rows = series.flatMap((s) => s.groups.map((g) => ({ ...g, name: s.name })));
  rows.sort((a, b) => b.from_utime_us - a.from_utime_us);
  const joules = rows.map(joule);
  const title = kind === 'day' ? 'Day' : 'Week from';
  const columns = [
    column('period', title, (g) => format.date(g.from_utime_us), { head: true }),
    series.length > 1 && column('robot', 'Robot', (g) => g.name),
    ...measuresOf(useTariff(), joules)
      .slice(0, -3)
      .map(({ key, title: name, of, cell, class: more }) =>
        figure(key, name, (g) => cell(of(g)), more && { class: more }),
      ),
  ].filter(Boolean);
  return <Table class="trends" columns={columns} rows={rows} />;
}

function Charts({ series, kind }) {
  if (series.every((s) => s.groups.length === 0)) return <p class="note">No mission in this period.</p>;
  const scale = energyScale(series.flatMap((s) => s.groups.map(joule)));
  const { u: perUnit } = consumption(1);
  const aside = `outlined: ${kind === 'day' ? 'today' : 'this week'} so far`;
  const consumed = (g) => (perUnit === 'J/m' ? perMetre(g) : g.wh_per_km);
  const chart = (title, unit, value, { label = title, ...more }) => (
    <Panel key={title} title={title} aside={more.amount && aside}>
      <TrendChart series={series} kind={kind} label={label} unit={unit} value={value} {...more} />
    </Panel>
  );
  return (
    <>
      <Names series={series} />
      <div class="charts">
        {chart(`Energy per ${kind}`, scale.u, (g) => joule(g) / scale.joule, { zero: true, amount: true })}
        {chart('Consumption', perUnit, consumed, { zero: true })}
        {chart('Measured over modelled', 'ratio', (g) => g.ratio, { label: 'Measured over modelled energy' })}
      </div>
      <Periods series={series} kind={kind} />
    </>
  );
}

// Energy charged in a period, summed over the stays at chargers in the log: {stays, joule, whole}; not whole:
// there are more stays, which were not read.
async function readCharged(period, robots, signal) {
  const filter = { kind: 'charged', robot_id: robots.join(','), ...period };
  const { entries, next } = await newest('/v1/event-log', filter, mostStays, signal);
  const joule = entries.reduce((sum, { detail }) => sum + (detail.charged_j ?? 0), 0);
  return { stays: entries.length, joule, whole: !next };
}

// The sums of the period with their changes, the energy charged, and its excess over that used by missions.
function Sums({ now, before, period, robots }) {
  const tariff = useTariff();
  const key = JSON.stringify([period, robots]);
  const charged = useRead((signal) => readCharged(period, robots, signal), key);
  const used = joule(now);
  const worth = worthOf(tariff, used);
  const changed = (label, value, of) => {
    const [a, b] = [value(before), value(now)];
    const known = a > 0 && b !== null;
    return [label, of(b), known && `${format.signed(format.share(b / a - 1))} against the compared period`];
  };
  const { stays, joule: put, whole } = (charged.path === key && charged.value) || {};
  const notes = [`in ${format.count(stays, 'stay')}`, ...worthTexts(tariff, put)].join(', ');
  const unused = stays && whole && put > 0 && format.percent((put - used) / put);
  const rows = [
    changed('Energy', joule, energy),
    ...worthNames.map(([key, name]) => worth[key] && [name, worth[key]]),
    stays && [whole ? 'Charged' : 'Charged, at least', energy(put), notes],
    unused && ['Not used in missions', unused, 'of which: losses, use between missions, higher charge'],
    changed('Consumption', perMetre, consumption),
    changed('Distance', (t) => t.energy.distance_m, format.kilometres),
    changed('Missions', (t) => t.missions, format.fixed),
  ];
  return <Readouts large rows={rows} />;
}

// The relative change; null if the first value is negligible.
const change = ([a, b]) => (format.known(a) && format.known(b) && a !== 0 ? (b - a) / Math.abs(a) : null);

// Rows of figures and of the ledger's terms over the distance, a column for each side.
function Sides({ sides }) {
  const tariff = useTariff();
  const totals = sides.map((side) => side.totals);
  const joules = totals.flatMap((t) => [joule(t), modelled(t)]);
  const figures = measuresOf(tariff, joules)
    .filter(({ of }) => totals.some((t) => of(t) !== undefined))
    .map((measure) => ({ ...measure, name: measure.title, values: totals.map(measure.of) }));
  const consumed = figures.findIndex(({ key }) => key === 'consumption') + 1;
  const over = (t, term) =>
    t.energy.distance_m > 0.1 ? effectOn(term, t.ledger?.terms_j[term] ?? 0) / t.energy.distance_m : null;
  const terms = Object.keys(totals[0].ledger?.terms_j ?? {})
    .map((term) => ({
      name: `of which ${termName(term).toLowerCase()}`,
      values: totals.map((t) => over(t, term)),
      cell: consumption,
      term: true,
    }))
    .filter(({ values }) => values.some((v) => Number(consumption(v ?? 0).n) !== 0)); // as shown
  const most = Math.max(...terms.flatMap(({ values }) => values.map(Math.abs)), 1e-9);
  const stripOf = (value, k) => [(value ?? 0) / most, k === 0 ? 'out' : 'plain'];
  const changeOf = ({ values: [a, b], term }) =>
    term ? consumption(a === null || b === null ? null : b - a) : format.percent(change([a, b]), 1);
  const columns = [
    column('name', '', (r) => r.name, { head: true }),
    ...sides.map(({ name }, k) => figure(k, name, (r) => r.cell(r.values[k]))),
    sides.length === 2 &&
      figure('change', 'Change', (r) => !r.count && format.withSign(changeOf(r)), { class: 'figure long' }),
    column('bars', '', (r) => r.term && <Strips of={r.values.map(stripOf)} tallPx={8} />, {
      class: 'bar-cell wide',
    }),
  ].filter(Boolean);
  const links = sides.filter(({ link }) => link).map(({ name, link }) => <a href={link}>{name}</a>);
  return (
    <TablePanel
      title="Side by side"
      aside={links.length > 0 && links}
      class="compare"
      columns={columns}
      rows={[...figures.slice(0, consumed), ...terms, ...figures.slice(consumed)]}
    />
  );
}

function MissionsField(more) {
  const recent = useGet('/v1/missions?limit=200').value?.missions ?? [];
  const options = recent.map((m) => [String(m.id), `${nameOf(m)} ${format.minute(m.start_utime_us)}`]);
  return <Several label="Missions" one="Mission" options={options} none="choose …" {...more} />;
}

// Robots with missions, in descending order of their number.
function DrivenField(more) {
  const totals = useGet(totalsPath({ group_by: 'robot' }));
  const groups = [...(totals.value?.groups ?? [])].sort((a, b) => b.missions - a.missions);
  return <SomeRobots ids={groups.map(({ robots: [id] }) => id)} none="the fleet" {...more} />;
}

export function Trends({ given: asked }) {
  const [given, set] = useChoices(asked);
  const field = fieldsOf(given, set);
  const kind = given.by === 'week' ? 'week' : 'day';
  const missions = given.of === 'missions';
  const robots = given.robot ? given.robot.split(',') : [];
  const ids = given.missions?.split(',') ?? [];
  const none = misordered(given.from, given.to) || misordered(given.from2, given.to2);
  const key = none ? '' : JSON.stringify([given, kind]);
  const periods = useMemo(() => periodsOf(given, kind), [key]);
  const summed = {
    robot_id: given.robot,
    ...periods[0],
    group_by: robots.length > 0 ? `robot,${kind}` : kind,
    utc_offset_min: -new Date().getTimezoneOffset(),
  };
  const series = useRead((signal) => readSeries(summed, robots, signal), !missions && key);
  const sums = useRead((signal) => readSides(periods, robots, signal), !missions && key);
  const single = useRead((signal) => readMissions(ids, signal), missions && ids.join());
  return (
    <>
      <h1 class="hidden">Trends</h1>
      <Filters label="Filter trends">
        <Choice
          label="Of"
          {...field.of('of', missions ? 'missions' : '')}
          options={{ '': 'Periods and robots', missions: 'Missions' }}
        />
        {missions ? (
          <MissionsField {...field.of('missions')} />
        ) : (
          <>
            <DrivenField {...field.of('robot')} />
            <Choice
              label="Period"
              value={given.from || given.to ? '' : (given.last ?? String(defaultDays[kind]))}
              onChange={(last) => set({ last, from: '', to: '' })}
              options={lasts}
            />
            {field.day('From', 'from')}
            {field.day('To', 'to')}
            {field.day('Compared from', 'from2')}
            {field.day('Compared to', 'to2')}
            <Choice label="Sums by" {...field.of('by', kind)} options={{ day: 'By day', week: 'By week' }} />
            <Export of={[csvOf(totalsPath(summed), 'trends')]} disabled={none} />
          </>
        )}
      </Filters>
      {none && <Misordered />}
      {missions && ids.length === 0 && <p class="note">Choose two or more missions.</p>}
      {missions && ids.length > 0 && (
        <Answer of={single} what="the missions">
          {(sides) => <Sides sides={sides} />}
        </Answer>
      )}
      {!missions && !none && (
        <>
          <Answer of={sums} what="the sums">
            {({ now, before }) => <Sums now={now} before={before} period={periods[0]} robots={robots} />}
          </Answer>
          <Answer of={series} what="trends">
            {(value) => <Charts series={value} kind={kind} />}
          </Answer>
          {sums.value && <Sides sides={sums.value.sides} />}
        </>
      )}
    </>
  );
}
