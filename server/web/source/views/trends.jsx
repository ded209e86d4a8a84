// Energy a day or week, consumption and ratio: of the fleet, or of some robots side by side.
import { useEffect, useMemo, useState } from 'preact/hooks';
import { get, query, useGet } from '../api.js';
import { Chart, axis, bars, dateAxis } from '../chart.jsx';
import { useCharged } from '../charged.js';
import { useChoices } from '../choices.js';
import { consumption, energy, energyIn, energyScale } from '../energy.js';
import { saveText } from '../export.js';
import * as format from '../format.js';
import { Table } from '../table.jsx';
import { useTariff, worthNames, worthOf, worthTexts } from '../tariff.js';
import { palette } from '../theme.js';
import { Answer, Choice, Panel, Quantity, Ratio, Readout, useTitleOf } from '../widgets.jsx';
import { Misordered, RobotsField, dayField, misordered, offsetMin, robotsOf, timesOf } from './choosing.jsx';

const defaultDays = { day: 30, week: 182 };
const lasts = [
  ['1', '24 h'],
  ['7', '7 d'],
  ['30', '30 d'],
  ['182', '26 weeks'],
];
const dayMs = 86_400_000;
const dashes = [[], [6, 4], [2, 3], [9, 3, 2, 3], [12, 4], [1, 2]];

const dayOf = (utime) => format.time(utime).slice(0, 10);
export const totalsPath = (filter) => `/v1/mission-totals${query(filter)}`;

function filterOf(given, kind, robot) {
  const times = timesOf(given.from, given.to);
  return {
    robot_id: robot,
    ...times,
    from_utime_us:
      times.from_utime_us ??
      (times.to_utime_us ?? Date.now() * 1000) - (Number(given.last) || defaultDays[kind]) * dayMs * 1000,
    group_by: kind,
    utc_offset_min: offsetMin(),
  };
}

// One series a robot, or one of the fleet: [{name, groups}].
function useSeries(given, kind) {
  const [state, setState] = useState({ value: null, error: null });
  const [turn, setTurn] = useState(0);
  const robots = robotsOf(given);
  const none = misordered(given.from, given.to);
  useEffect(() => {
    if (none) return undefined;
    const abort = new AbortController();
    const ask = async (robot) => ({
      name: robot ?? 'Fleet',
      groups: (await get(totalsPath(filterOf(given, kind, robot)), abort.signal)).groups,
    });
    Promise.all(robots.length > 0 ? robots.map(ask) : [ask()]).then(
      (value) => setState({ value, error: null }),
      (error) => error.name !== 'AbortError' && setState({ value: null, error }),
    );
    return () => abort.abort();
  }, [JSON.stringify(given), kind, turn]);
  return { ...state, reload: () => setTurn((n) => n + 1) };
}

// {x: seconds of each period that any series has, column(series, value)}. Where periods are missing stands
// one that no series has, so that no line spans the gap.
function aligned(series, kind) {
  const all = new Set(series.flatMap((s) => s.groups.map((g) => g.from_utime_us)));
  const longest = (kind === 'week' ? 7.5 : 1.5) * dayMs * 1000;
  const x = [...all]
    .sort((a, b) => a - b)
    .flatMap((at, k, sorted) => (k > 0 && at - sorted[k - 1] > longest ? [at - 1, at] : [at]));
  const rows = series.map((s) => new Map(s.groups.map((g) => [g.from_utime_us, g])));
  return {
    x: x.map((v) => v / 1e6),
    column: (k, value) => x.map((at) => (rows[k].has(at) ? value(rows[k].get(at)) : null)),
  };
}

// With `amount`, a sum over the period: the period that has not ended is drawn apart, as bars for one series.
function TrendChart({ series, kind, label, value, unit, zero, amount }) {
  const asBars = amount && series.length === 1;
  const half = ((kind === 'week' ? 7 : 1) * dayMs) / 2000;
  const data = useMemo(() => {
    const { x, column } = aligned(series, kind);
    const ended = (second) => second * 1000 + (kind === 'week' ? 7 : 1) * dayMs <= Date.now();
    const columns = series.map((_, k) => column(k, value));
    if (!amount) return [x, ...columns];
    const only = (wanted) => columns.map((c) => c.map((v, k) => (ended(x[k]) === wanted ? v : null)));
    return [x, ...only(true), ...only(false)];
  }, [series, unit]);
  const make = () => {
    const p = palette();
    const colours = [p.measured, p.modelled, p.gap, p.ink, p.muted];
    return {
      padding: [8, 44, 0, 0],
      scales: {
        ...(asBars && { x: { range: (_, low, high) => [low - half, high + half] } }),
        y: zero ? { range: (_, low, high) => [Math.min(0, low), high > 0 ? 1.08 * high : 1] } : {},
      },
      axes: [axis('', dateAxis(kind === 'week' ? 7 : 1)), axis(unit)],
      series: [
        {},
        ...[...series, ...(amount ? series : [])].map((s, n) => {
          const [k, soFar] = [n % series.length, n >= series.length];
          const stroke = colours[k % colours.length];
          if (asBars)
            return {
              stroke,
              width: 1.5,
              paths: bars(),
              fill: soFar ? undefined : stroke,
              points: { show: false },
            };
          return {
            label: s.name,
            stroke,
            dash: dashes[k % dashes.length],
            width: 1.5,
            points: { show: true, size: soFar ? 9 : 6 },
          };
        }),
      ],
    };
  };
  return <Chart make={make} data={data} label={label} height={200} changes={[series, unit]} />;
}

function Key({ series }) {
  const p = palette();
  const colours = [p.measured, p.modelled, p.gap, p.ink, p.muted];
  if (series.length < 2) return null;
  return (
    <p class="key trend-key">
      {series.map((s, k) => (
        <span key={s.name}>
          <svg width="34" height="8" aria-hidden="true">
            <line
              x1="0"
              x2="34"
              y1="4"
              y2="4"
              stroke={colours[k % colours.length]}
              stroke-width="2"
              stroke-dasharray={dashes[k % dashes.length].join(' ')}
            />
          </svg>{' '}
          {s.name}
        </span>
      ))}
    </p>
  );
}

function Periods({ series, kind }) {
  const tariff = useTariff();
  const rows = series.flatMap((s) => s.groups.map((g) => ({ ...g, name: s.name })));
  rows.sort((a, b) => b.from_utime_us - a.from_utime_us);
  const scale = energyScale(rows.map((g) => g.energy.battery_j));
  const figure = (key, title, cell, more = '') => ({ key, title, class: `figure ${more}`, cell });
  const columns = [
    {
      key: 'period',
      title: kind === 'day' ? 'Day' : 'Week from',
      head: true,
      cell: (g) => dayOf(g.from_utime_us),
    },
    ...(series.length > 1 ? [{ key: 'robot', title: 'Robot', cell: (g) => g.name }] : []),
    figure('missions', 'Missions', (g) => format.fixed(g.missions)),
    figure('energy', 'Energy', (g) => <Quantity of={energyIn(scale, g.energy.battery_j)} />),
    ...worthNames
      .filter(([key]) => worthOf(tariff, 0)[key])
      .map(([key, name]) =>
        figure(key, name, (g) => <Quantity of={worthOf(tariff, g.energy.battery_j)[key]} />),
      ),
    figure('distance', 'Distance', (g) => <Quantity of={format.kilometres(g.energy.distance_m)} />),
    figure(
      'consumption',
      'Consumption',
      (g) => <Quantity of={consumption(g.wh_per_km === null ? null : 3.6 * g.wh_per_km)} />,
      'long',
    ),
    figure('ratio', 'Ratio', (g) => <Ratio value={g.ratio} />),
  ];
  return <Table class="trends" columns={columns} rows={rows} keyOf={(g) => `${g.from_utime_us} ${g.name}`} />;
}

function Shown({ series, kind }) {
  if (series.every((s) => s.groups.length === 0)) return <p class="note">No mission in this time.</p>;
  const scale = energyScale(series.flatMap((s) => s.groups.map((g) => g.energy.battery_j)));
  const inUnit = consumption(1);
  const period = kind === 'day' ? 'day' : 'week';
  return (
    <>
      <Key series={series} />
      <div class="trend-charts">
        <Panel
          title={`Energy a ${period}`}
          aside={`outlined: ${kind === 'day' ? 'today' : 'this week'} so far`}
        >
          <TrendChart
            series={series}
            kind={kind}
            label={`Energy a ${period}`}
            unit={scale.u}
            value={(g) => g.energy.battery_j / scale.joule}
            zero
            amount
          />
        </Panel>
        <Panel title="Consumption">
          <TrendChart
            series={series}
            kind={kind}
            label="Energy over distance"
            unit={inUnit.u}
            value={(g) =>
              g.wh_per_km === null ? null : inUnit.u === 'J/m' ? 3.6 * g.wh_per_km : g.wh_per_km
            }
            zero
          />
        </Panel>
        <Panel title="Measured over modelled">
          <TrendChart
            series={series}
            kind={kind}
            label="Measured over modelled energy"
            unit="ratio"
            value={(g) => g.ratio}
          />
        </Panel>
      </div>
      <Periods series={series} kind={kind} />
    </>
  );
}

// The period of the choices and the one of the same length before: [from, to] in microseconds each.
function periodsOf(given, kind) {
  const { from_utime_us: from } = filterOf(given, kind);
  const to = timesOf(given.from, given.to).to_utime_us ?? Date.now() * 1000;
  return [
    [from, to],
    [2 * from - to, from],
  ];
}

// The sums of the period, with their change against the period before.
// What was charged, and how much more that is than missions used.
function Charged({ period, robots, used }) {
  const tariff = useTariff();
  const charged = useCharged(period, robots);
  if (!charged?.stays) return null;
  const { stays, joule, whole } = charged;
  const lost = whole && joule > 0 ? (joule - used) / joule : null;
  const notes = [`in ${stays} ${stays === 1 ? 'stay' : 'stays'}`, ...worthTexts(tariff, joule)];
  return (
    <>
      <Readout
        large
        label={whole ? 'Charged' : 'Charged, at least'}
        of={energy(joule)}
        note={notes.join(', ')}
      />
      {lost !== null && (
        <Readout
          large
          label="Not used in missions"
          of={format.percent(lost)}
          note="of it: losses, use in between, higher charge"
        />
      )}
    </>
  );
}

function Sums({ given, kind }) {
  const tariff = useTariff();
  const key = JSON.stringify(given);
  const periods = useMemo(() => periodsOf(given, kind).map((ends) => ends.map(Math.round)), [key, kind]);
  const paths = periods.map(([from, to]) =>
    totalsPath({ robot_id: given.robot, from_utime_us: from, to_utime_us: to }),
  );
  const [now, before] = [useGet(paths[0]), useGet(paths[1])];
  if (!now.value || now.path !== paths[0]) return null;
  const readout = (label, value, of) => {
    const [a, b] = [before.path === paths[1] && before.value ? value(before.value) : null, value(now.value)];
    const change =
      a > 0 && b !== null
        ? `${format.signed(format.text(format.percent(b / a - 1)))} to the period before`
        : '';
    return <Readout large label={label} of={of(b)} note={change} />;
  };
  return (
    <dl class="readouts">
      {readout('Energy', (t) => t.energy.battery_j, energy)}
      {worthNames.map(([key, name]) => {
        const worth = worthOf(tariff, now.value.energy.battery_j)[key];
        return worth && <Readout key={key} large label={name} of={worth} />;
      })}
      <Charged period={periods[0]} robots={robotsOf(given)} used={now.value.energy.battery_j} />
      {readout(
        'Consumption',
        (t) => t.wh_per_km,
        (v) => consumption(v === null ? null : 3.6 * v),
      )}
      {readout('Distance', (t) => t.energy.distance_m, format.kilometres)}
      {readout(
        'Missions',
        (t) => t.missions,
        (v) => format.fixed(v),
      )}
    </dl>
  );
}

export function Trends({ given: asked }) {
  useTitleOf('Trends');
  const [given, change] = useChoices(asked);
  const kind = given.by === 'week' ? 'week' : 'day';
  const series = useSeries(given, kind);
  const robots = robotsOf(given);
  const none = misordered(given.from, given.to);
  return (
    <>
      <h1 class="hidden">Trends</h1>
      <form class="filters" aria-label="Choose trends" onSubmit={(e) => e.preventDefault()}>
        <RobotsField value={given.robot} onChange={(robot) => change({ robot })} none="the fleet" />
        <Choice
          label="Period"
          value={given.from || given.to ? '' : (given.last ?? String(defaultDays[kind]))}
          onChange={(last) => change({ last, from: '', to: '' })}
          options={lasts}
        />
        {dayField('From', given.from, (from) => change({ from }))}
        {dayField('To', given.to, (to) => change({ to }))}
        <Choice
          label="Sums by"
          value={kind}
          onChange={(by) => change({ by })}
          options={[
            ['day', 'By day'],
            ['week', 'By week'],
          ]}
        />
        <a class="button" href="#/compare">
          Compare
        </a>
        <span class="export">
          <button
            type="button"
            disabled={none}
            onClick={() =>
              saveText(totalsPath(filterOf(given, kind, robots.join(',') || undefined)), 'trends')
            }
          >
            Export CSV
          </button>
        </span>
      </form>
      {none ? (
        <Misordered />
      ) : (
        <>
          <Sums given={given} kind={kind} />
          <Answer of={series} what="trends">
            {(value) => <Shown series={value} kind={kind} />}
          </Answer>
        </>
      )}
    </>
  );
}
