import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import { get, query, useRenewed } from '../api.js';
import { consumption, energy, energyIn, energyScale, perMetre } from '../energy.js';
import { useTariff, worthTexts } from '../tariff.js';
import * as format from '../format.js';
import * as health from '../health.jsx';
import { showRecent, useLive, useModelled } from '../live.js';
import { useRatios } from '../models.js';
import { missionLink, robotLink, useChoices } from '../route.js';
import { Cells, Head, SortChoice, column, names, orderOf, sorted } from '../table.jsx';
import {
  Button,
  Choice,
  Empty,
  Failure,
  Key,
  Loading,
  Quantity,
  Ratio,
  Readouts,
  useNarrow,
  useTitleOf,
} from '../widgets.jsx';

const rowPx = 50;
const cardPx = 158; // with the space below it, as in the style sheet
const spareRows = 8;
const reorderMs = 3000;
const todayMs = 60_000;
const weekMs = 7 * 86_400_000;

const speedNow = ({ state }) => health.now(state, state.speed_m_s);
const timeOf = ({ state }) => state.run_time_s;
const spentOf = ({ state }) => state.mission?.energy.battery_j;
const severities = ['fault', 'warning', 'notice'];
const urgency = ({ needs, state }) =>
  needs ? severities.indexOf(needs.severity) + (needs.acknowledged ? 3 : 0) : state.live ? 6 : 7;

// The mission's id without the robot's id at its beginning.
export const ownPart = (missionId, robotId) =>
  missionId.startsWith(`${robotId}-`) ? missionId.slice(robotId.length + 1) : missionId;

function Power({ state: s }) {
  const modelled = s.live && s.measured_power_w === null && s.modelled_power_w !== null;
  return [
    <Quantity of={format.power(health.powerNow(s))} />,
    modelled && <span class="below">modelled</span>,
  ];
}

const Range = ({ state: s }) => [
  <Quantity of={format.kilometres(s.range_m)} />,
  <span class="below">{health.between(s.range_quantiles_m, format.lengthBand)}</span>,
];

const Mission = ({ id, state: { mission, live } }) =>
  mission ? (
    <a href={missionLink(mission.id)} title={mission.mission_id}>
      {ownPart(mission.mission_id, id)}
    </a>
  ) : (
    <span class="note">{live ? 'idle' : '–'}</span>
  );

const Attention = ({ state, needs }) => <health.Health state={state} reasons={needs?.reasons} />;

const hint = 'measured energy over modelled energy, median of the newest missions';

// Of rows {id, state, needs, ratio, entry, scale}.
const columns = [
  ['robot', '11%', 'Robot', '', ({ id }) => <a href={robotLink(id)}>{id}</a>, (r) => r.id, { head: true }],
  ['health', '', 'Attention', '', Attention, urgency],
  ['power', '96px', 'Power', 'figure', Power, (r) => health.powerNow(r.state)],
  ['spark', '148px', 'Last 90 s', '', ({ entry }) => <health.Sparkline track={entry.power} />],
  ['charge', '116px', 'Charge', '', health.Charge, (r) => r.state.state_of_charge],
  ['range', '104px', 'Range', 'figure', Range, (r) => r.state.range_m],
  ['time', '96px', 'Run time', 'figure wide', (r) => format.about(timeOf(r)), timeOf],
  ['speed', '84px', 'Speed', 'figure wide', (r) => format.unit(speedNow(r), 'm/s', 2), speedNow],
  ['ratio', '88px', 'Ratio', 'figure', (r) => <Ratio value={r.ratio ?? null} />, (r) => r.ratio, { hint }],
  ['mission', '16%', 'Mission', '', Mission, (r) => r.state.mission?.start_utime_us],
  ['spent', '88px', 'Energy', 'figure', (r) => energyIn(r.scale, spentOf(r)), spentOf],
].map(([key, width, title, kind, cell, sort, more]) => {
  const own = key === 'ratio' ? 'ratio-cell' : key;
  return column(key, title, cell, { class: `${kind} ${own}`, width, sort, ...more });
});

const filters = {
  all: ['All', () => true],
  attention: ['Need attention', (_, needs) => health.needsSomeone(needs)],
  live: ['Live', (s) => s.live],
  silent: ['Silent', (s) => !s.live],
  mission: ['On a mission', (s) => s.mission !== null],
  charging: ['Charging', (s) => s.charging !== null],
  low: [`Charge below ${100 * health.lowCharge}\u00a0%`, (s) => (s.state_of_charge ?? 1) < health.lowCharge],
};
const filterNames = Object.fromEntries(Object.entries(filters).map(([key, [name]]) => [key, name]));

const Row = ({ entry, index, ...more }) =>
  useMemo(
    () => (
      <tr aria-rowindex={index + 2} class={entry.state.live ? '' : 'quiet'}>
        <Cells columns={columns} row={{ ...entry, entry, ...more }} />
      </tr>
    ),
    [entry.revision, entry, index, more.needs, more.ratio, more.unit],
  );

function chosen(robots, text, keep, attention) {
  const wanted = text.trim().toLowerCase();
  const named = ({ id, state }) =>
    wanted === '' ||
    id.toLowerCase().includes(wanted) ||
    (state.mission?.mission_id ?? '').toLowerCase().includes(wanted);
  return [...robots.values()].filter((entry) => keep(entry.state, attention.get(entry.id)) && named(entry));
}

// The rows in their order, which is renewed only every few seconds, since live values change all the time.
function useOrder(live, text, only, order, attention, ratios) {
  const kept = useRef({ key: '', at: -Infinity, rows: [] });
  const urgencies = [...attention.values()].map((e) => `${e.robot_id}${e.severity}${e.acknowledged}`);
  const [{ key: by, down }] = order;
  const key = [text, only, by, down, live.robots.size, live.loads, urgencies, ratios.size].join('|');
  const at = performance.now();
  const held = document.activeElement?.closest('.fleet tbody'); // a row that moves loses the focus
  if (kept.current.key !== key || (at - kept.current.at > reorderMs && !held)) {
    const keep = only === 'heard' ? (s) => !health.unheard(s) : filters[only][1];
    const rows = chosen(live.robots, text, keep, attention)
      .sort((a, b) => names.compare(a.id, b.id))
      .map((entry) => ({ ...entry, entry, needs: attention.get(entry.id), ratio: ratios.get(entry.id) }));
    const ordered = sorted(rows, columns, order);
    // Robots without telemetry come last in every order.
    const heard = (wanted) => ordered.filter((r) => health.unheard(r.state) !== wanted);
    kept.current = { key, at, rows: [...heard(true), ...heard(false)].map((r) => r.entry) };
  }
  return kept.current.rows;
}

// The rows that the window shows, of a table that scrolls with the page.
function useWindow(count, heightPx) {
  const body = useRef(null);
  const [range, setRange] = useState([0, 40]);
  useEffect(() => {
    const look = () => {
      if (body.current === null) return;
      const top = body.current.getBoundingClientRect().top;
      const first = Math.max(0, Math.floor(-top / heightPx) - spareRows);
      const last = Math.min(count, Math.ceil((innerHeight - top) / heightPx) + spareRows);
      setRange((before) => (before[0] === first && before[1] === last ? before : [first, last]));
    };
    look();
    const listening = new AbortController();
    addEventListener('scroll', look, { passive: true, signal: listening.signal });
    addEventListener('resize', look, { signal: listening.signal });
    return () => listening.abort();
  }, [count, heightPx]);
  return [body, Math.min(range[0], count), Math.min(Math.max(range[1], 0), count)];
}

function totalsOf(robots) {
  const t = { power: null, live: 0, running: 0, lowest: null, charging: 0, charged: 0 };
  for (const { state: s } of robots.values()) {
    const drawn = s.measured_power_w ?? s.modelled_power_w;
    if (s.live) {
      t.live += 1;
      if (s.charging !== null) {
        t.charging += 1;
        t.charged -= Math.min(0, s.measured_power_w ?? 0);
      } else if (drawn !== null) t.power = (t.power ?? 0) + drawn;
    }
    if (s.mission !== null) t.running += 1;
    if (s.state_of_charge !== null && !(t.lowest?.state_of_charge <= s.state_of_charge)) t.lowest = s;
  }
  return t;
}

// Totals of missions that began today and, until the same time of day, on the same weekday a week ago.
async function readToday(signal) {
  const midnight = new Date().setHours(0, 0, 0, 0);
  const sums = (agoMs) => {
    const times = { from_utime_us: (midnight - agoMs) * 1000, to_utime_us: (Date.now() - agoMs) * 1000 };
    return get(`/v1/mission-totals${query(times)}`, signal);
  };
  return Promise.all([sums(0), sums(weekMs)]);
}

// Today's energy, its consumption, and its change against the same weekday a week ago, as a row of Readouts.
function useTodayRow() {
  const [today, before] = useRenewed(readToday, todayMs, 'today', []);
  const tariff = useTariff();
  if (!today) return ['Today', energy(null)];
  const [now, then] = [today.energy.battery_j ?? 0, before.energy.battery_j];
  const weekday = new Date().toLocaleDateString('en', { weekday: 'short' });
  const parts = [
    today.wh_per_km !== null && format.text(consumption(perMetre(today))),
    then > 0 && `${format.signed(format.share(now / then - 1))} against last ${weekday}`,
    ...worthTexts(tariff, now),
  ];
  return ['Today', energy(now), parts.filter(Boolean).join(', ')];
}

function Summary({ robots, attention }) {
  const t = totalsOf(robots);
  const entries = [...attention.values()].filter(health.needsSomeone);
  const counted = severities
    .map((severity) => [severity, entries.filter((e) => e.severity === severity).length])
    .filter(([, count]) => count > 0)
    .map(([severity, count]) => format.count(count, severity));
  const lowest = t.lowest && <a href={robotLink(t.lowest.robot_id)}>{t.lowest.robot_id}</a>;
  const rows = [
    ['Need attention', `${entries.length}`, counted.join(', ')],
    ['Fleet power', format.power(t.power), '', 'measured'],
    ['Live', `${t.live}`, `of ${robots.size}`],
    ['On a mission', `${t.running}`],
    useTodayRow(),
    t.charging > 0 && ['Charging', `${t.charging}`, `at ${format.text(format.power(t.charged))}`],
    ['Lowest charge', format.percent(t.lowest?.state_of_charge), lowest],
  ];
  return <Readouts large rows={rows} />;
}

const Spacer = ({ rows, heightPx }) =>
  rows > 0 && (
    <tr aria-hidden="true" class="spacer">
      <td colspan={columns.length} style={{ padding: 0, border: 0, height: `${rows * heightPx}px` }} />
    </tr>
  );

function RobotTable({ live, shown, order, attention, ratios }) {
  const heightPx = useNarrow() ? cardPx : rowPx;
  const [body, first, last] = useWindow(shown.length, heightPx);
  const scale = energyScale([...live.robots.values()].map(({ state }) => state.mission?.energy.battery_j));
  useEffect(() => showRecent(shown.slice(first, last)), [shown, first, last]);
  return (
    <table class="grid fleet" aria-rowcount={shown.length + 1}>
      <Head columns={columns} order={order} />
      <tbody ref={body}>
        <Spacer key="above" rows={first} heightPx={heightPx} />
        {shown.slice(first, last).map((entry, k) => (
          <Row
            key={entry.id}
            entry={entry}
            index={first + k}
            needs={attention.get(entry.id)}
            ratio={ratios.get(entry.id)}
            scale={scale}
            unit={`${scale.u}${scale.places}`}
          />
        ))}
        <Spacer key="below" rows={shown.length - last} heightPx={heightPx} />
      </tbody>
    </table>
  );
}

export function Fleet({ given: asked }) {
  const live = useLive();
  const attention = health.useAttention();
  const needing = [...attention.values()].filter(health.needsSomeone).length;
  useTitleOf(needing > 0 ? `(${needing}) Fleet` : 'Fleet');
  const [given, change] = useChoices(asked);
  const { find: text = '' } = given;
  const only = given.show in filters ? given.show : 'all';
  const known = columns.some((c) => c.key === given.sort); // an address may name another column
  const order = orderOf(known ? given : {}, change, { key: 'health', down: false });
  const [whole, setWhole] = useState(false);
  const ratios = useRatios(useModelled());
  const quiet = [...live.robots.values()].filter((entry) => health.unheard(entry.state)).length;
  const foldable = only === 'all' && text === '' && quiet > 0 && quiet < live.robots.size;
  const rows = useOrder(live, text, foldable && !whole ? 'heard' : only, order, attention, ratios);
  if (!live.loaded && live.robots.size === 0)
    return live.error !== null ? <Failure error={live.error} /> : <Loading what="the fleet" />;
  if (live.robots.size === 0)
    return (
      <>
        <h1>Fleet</h1>
        <Empty title="No robot yet">
          A robot appears here when its telemetry arrives over LCM or{' '}
          <a href="#/robot-file">its robot file is added</a>.
        </Empty>
      </>
    );
  return (
    <>
      <h1 class="hidden">Fleet</h1>
      <Summary robots={live.robots} attention={attention} />
      <health.Reasons of={attention.get('')} />
      <div class="row wrap tools">
        <label class="find">
          <span class="hidden">Find a robot or mission</span>
          <input
            type="search"
            placeholder="Find a robot or mission"
            value={text}
            onInput={(e) => change({ find: e.currentTarget.value })}
          />
        </label>
        <Choice
          label="Show"
          value={only}
          onChange={(show) => change({ show: show === 'all' ? '' : show })}
          options={filterNames}
        />
        <SortChoice columns={columns} order={order} />
        <Button href="#/robot-file">Add a robot</Button>
        <span class="row note key">
          <Key of={{ measured: 'measured', modelled: 'modelled' }} />
        </span>
      </div>
      <RobotTable live={live} shown={rows} order={order} attention={attention} ratios={ratios} />
      {rows.length === 0 && <Empty title="No robot matches" />}
      {foldable && (
        <p class="fold">
          <Button class="plain" aria-expanded={String(whole)} onClick={() => setWhole(!whole)}>
            {whole ? 'Hide' : 'Show'} {format.count(quiet, 'robot')} without telemetry
          </Button>
        </p>
      )}
    </>
  );
}
