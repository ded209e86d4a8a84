import { Component } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { html } from '../html.js';
import * as format from '../format.js';
import { post } from '../api.js';
import { useLive } from '../live.js';
import { mission_link, robot_link } from '../route.js';
import { Sparkline } from '../sparkline.js';
import { useTheme } from '../theme.js';
import { Choice, Empty, Failure, Loading, Quantity, Readout, useTitleOf } from '../widgets.js';

const row_px = 46, spare_rows = 8, reorder_ms = 3000, low_charge = 0.25;

const forecast_ms = 30_000;

// Each robot's range with its band, as the service forecasts it; the live value stands in until it is there.
function useRanges() {
  const [ranges, set_ranges] = useState(new Map());
  useEffect(() => {
    const look = () => post('/v1/autonomy', {}).then((told) => set_ranges(new Map(told.robots.map((r) => [r.robot_id, r.range_quantiles_m]))), () => {});
    look();
    const timer = setInterval(look, forecast_ms);
    return () => clearInterval(timer);
  }, []);
  return ranges;
}

function Range({ live, band }) {
  if (!band || band.p50 === null) return html`<${Quantity} of=${format.length(live)} />`;
  const low = format.length(band.p05), high = format.length(band.p95);
  return html`<${Quantity} of=${format.length(band.p50)} /><span class="band"><span class="hidden">90 % between </span>${low.u === high.u ? low.n : format.text(low)}–${format.text(high)}</span>`;
}

const by = (value) => (a, b) => {
  const va = value(a.state), vb = value(b.state);
  const missing = (va === null || va === undefined) - (vb === null || vb === undefined);
  return missing || (va < vb ? -1 : va > vb ? 1 : 0);
};
const names = new Intl.Collator('en', { numeric: true });
const columns = [
  { key: 'robot', title: 'Robot', sort: (a, b) => names.compare(a.id, b.id), class: 'robot' },
  { key: 'health', title: 'Telemetry', sort: by((s) => (s.live ? 0 : s.silent_s === null ? Infinity : 1 + s.silent_s)), class: 'health' },
  { key: 'power', title: 'Power', sort: by((s) => s.measured_power_w ?? s.modelled_power_w), class: 'figure power' },
  { key: 'trace', title: 'Last 90 s', class: 'spark' },
  { key: 'charge', title: 'Charge', sort: by((s) => s.state_of_charge), class: 'charge' },
  { key: 'range', title: 'Range', sort: by((s) => s.range_m), class: 'figure' },
  { key: 'time', title: 'Run time', sort: by((s) => s.run_time_s), class: 'figure wide' },
  { key: 'speed', title: 'Speed', sort: by((s) => s.speed_m_s), class: 'figure wide' },
  { key: 'mission', title: 'Mission', sort: by((s) => s.mission?.start_utime_us), class: 'mission' },
  { key: 'spent', title: 'Spent', sort: by((s) => s.mission?.energy.battery_j), class: 'figure' },
];

export function health_of(state) {
  const faults = Object.values(state.faults).reduce((sum, n) => sum + n, 0);
  if (!state.has_model) return { level: 'bad', text: 'no model', faults };
  if (state.live) return { level: 'good', text: 'live', faults };
  if (state.silent_s === null) return { level: 'none', text: 'never heard', faults };
  return { level: 'bad', text: `silent ${format.span(state.silent_s)}`, faults };
}

export function Health({ state }) {
  const { level, text, faults } = health_of(state);
  const listed = Object.entries(state.faults).map(([reason, n]) => `${n} ${format.words(reason)}`).join(', ');
  return html`<span class=${`lamp ${level}`} aria-hidden="true"></span>${text}
    ${faults > 0 && html`<span class="note" title=${listed}> · ${format.fixed(faults)} faulty</span>`}`;
}

export function Charge({ share }) {
  if (share === null) return html`<span class="note">unknown</span>`;
  return html`<span class=${`charge-bar ${share < low_charge ? 'low' : ''}`} aria-hidden="true"><span style=${{ width: `${Math.max(2, share * 100)}%` }}></span></span>
    <${Quantity} of=${format.percent(share)} />`;
}

class Row extends Component {
  shouldComponentUpdate(next) {
    return next.revision !== this.props.revision || next.entry !== this.props.entry || next.index !== this.props.index || next.dark !== this.props.dark || next.band !== this.props.band;
  }
  render({ entry, index, revision, dark, band }) {
    const s = entry.state;
    const modelled_only = s.measured_power_w === null;
    return html`<tr aria-rowindex=${index + 2} class=${s.live ? '' : 'quiet'}>
      <th scope="row" class="robot"><a href=${robot_link(entry.id)}>${entry.id}</a></th>
      <td class="health"><${Health} state=${s} /></td>
      <td class="figure power"><${Quantity} of=${format.power(s.measured_power_w ?? s.modelled_power_w)} />${modelled_only && s.modelled_power_w !== null && html`<span class="note"> mod.</span>`}</td>
      <td class="spark"><${Sparkline} track=${entry.power} revision=${revision} dark=${dark} /></td>
      <td class="charge"><${Charge} share=${s.state_of_charge} /></td>
      <td class="figure"><${Range} live=${s.range_m} band=${band} /></td>
      <td class="figure wide">${format.span(s.run_time_s)}</td>
      <td class="figure wide"><${Quantity} of=${format.unit(s.speed_m_s, 'm/s', 2)} /></td>
      <td class="mission">${s.mission ? html`<a href=${mission_link(s.mission.id)}>${s.mission.mission_id}</a>` : html`<span class="note">idle</span>`}</td>
      <td class="figure"><${Quantity} of=${format.energy(s.mission?.energy.battery_j)} /></td>
    </tr>`;
  }
}

function chosen(robots, text, only) {
  const wanted = text.trim().toLowerCase();
  const keep = {
    all: () => true, live: (s) => s.live, silent: (s) => !s.live, mission: (s) => s.mission !== null,
    low: (s) => s.state_of_charge !== null && s.state_of_charge < low_charge,
  }[only];
  return [...robots.values()].filter((entry) => keep(entry.state) &&
    (wanted === '' || entry.id.toLowerCase().includes(wanted) || (entry.state.mission?.mission_id ?? '').toLowerCase().includes(wanted)));
}

// The rows in their order. Live values move all the time; their order is renewed only every few seconds, so
// that rows can be read.
function useOrder(live, text, only, sort) {
  const kept = useRef({ key: '', at: -Infinity, rows: [] });
  const key = `${text}|${only}|${sort.key}|${sort.down}|${live.robots.size}`;
  const now = performance.now();
  if (kept.current.key !== key || now - kept.current.at > reorder_ms) {
    const column = columns.find((c) => c.key === sort.key);
    const rows = chosen(live.robots, text, only).sort((a, b) => (sort.down ? -1 : 1) * column.sort(a, b) || names.compare(a.id, b.id));
    kept.current = { key, at: now, rows };
  }
  return kept.current.rows;
}

// Which rows the window shows, of a table that scrolls with the page.
function useWindow(count) {
  const body = useRef(null);
  const [range, set_range] = useState([0, 40]);
  useEffect(() => {
    const look = () => {
      if (body.current === null) return;
      const top = body.current.getBoundingClientRect().top;
      const first = Math.max(0, Math.floor(-top / row_px) - spare_rows);
      const last = Math.min(count, Math.ceil((innerHeight - top) / row_px) + spare_rows);
      set_range((before) => (before[0] === first && before[1] === last ? before : [first, last]));
    };
    look();
    addEventListener('scroll', look, { passive: true });
    addEventListener('resize', look);
    return () => {
      removeEventListener('scroll', look);
      removeEventListener('resize', look);
    };
  }, [count]);
  return [body, Math.min(range[0], count), Math.min(Math.max(range[1], 0), count)];
}

function Summary({ robots }) {
  let [power, live, running, spent, lowest, known_power] = [0, 0, 0, 0, null, false];
  for (const { state: s } of robots.values()) {
    const drawn = s.measured_power_w ?? s.modelled_power_w;
    if (s.live) {
      live += 1;
      if (drawn !== null) {
        power += drawn;
        known_power = true;
      }
    }
    if (s.mission !== null) {
      running += 1;
      spent += s.mission.energy.battery_j;
    }
    if (s.state_of_charge !== null && (lowest === null || s.state_of_charge < lowest.state_of_charge)) lowest = s;
  }
  return html`<dl class="readouts">
    <${Readout} large label="Fleet power" of=${known_power ? format.power(power) : { n: '–', u: '' }} channel="measured" />
    <${Readout} large label="Live" of=${`${live}`} note=${`of ${robots.size}`} />
    <${Readout} large label="On a mission" of=${`${running}`} />
    <${Readout} large label="Spent in running missions" of=${format.energy(spent)} />
    <${Readout} large label="Lowest charge" of=${format.percent(lowest?.state_of_charge)} note=${lowest && html`<a href=${robot_link(lowest.robot_id)}>${lowest.robot_id}</a>`} />
  </dl>`;
}

export function Fleet() {
  useTitleOf('Fleet');
  const live = useLive(), dark = useTheme(), ranges = useRanges();
  const [text, set_text] = useState('');
  const [only, set_only] = useState('all');
  const [sort, set_sort] = useState({ key: 'robot', down: false });
  const rows = useOrder(live, text, only, sort);
  const [body, first, last] = useWindow(rows.length);
  if (!live.loaded && live.robots.size === 0)
    return live.error !== null ? html`<${Failure} error=${live.error} />` : html`<${Loading} what="the fleet" />`;
  if (live.robots.size === 0)
    return html`<h1>Fleet</h1><${Empty} title="No robot yet">A robot appears here when its telemetry arrives over LCM or its file is put to <code>/v1/robots/…</code>.<//>`;
  const turn = (key) => set_sort((before) => ({ key, down: before.key === key && !before.down }));
  const direction = (c) => (c.key !== sort.key ? undefined : sort.down ? 'descending' : 'ascending');
  return html`
    <h1 class="hidden">Fleet</h1>
    <${Summary} robots=${live.robots} />
    <div class="tools">
      <label class="find"><span class="hidden">Find a robot or mission</span><input type="search" placeholder="Find a robot or mission" value=${text} onInput=${(e) => set_text(e.currentTarget.value)} /></label>
      <${Choice} label="Show" value=${only} onChange=${set_only} options=${[['all', 'All'], ['live', 'Live'], ['silent', 'Silent'], ['mission', 'On a mission'], ['low', 'Low charge']]} />
      <span class="key"><span class="swatch measured"></span>measured <span class="swatch modelled"></span>modelled</span>
    </div>
    <table class="grid fleet" aria-rowcount=${rows.length + 1}>
      <thead><tr>${columns.map((c) => html`<th key=${c.key} scope="col" class=${c.class} aria-sort=${direction(c)}>
        ${c.sort ? html`<button type="button" onClick=${() => turn(c.key)}>${c.title}<span class="arrow" aria-hidden="true">${c.key === sort.key ? (sort.down ? '▾' : '▴') : ''}</span></button>` : c.title}</th>`)}</tr></thead>
      <tbody ref=${body}>
        ${first > 0 && html`<tr key="above" aria-hidden="true" class="spacer"><td colspan=${columns.length} style=${{ height: `${first * row_px}px` }}></td></tr>`}
        ${rows.slice(first, last).map((entry, k) => html`<${Row} key=${entry.id} entry=${entry} revision=${entry.revision} index=${first + k} dark=${dark} band=${ranges.get(entry.id)} />`)}
        ${last < rows.length && html`<tr key="below" aria-hidden="true" class="spacer"><td colspan=${columns.length} style=${{ height: `${(rows.length - last) * row_px}px` }}></td></tr>`}
      </tbody>
    </table>
    ${rows.length === 0 && html`<${Empty} title="No robot matches" />`}`;
}
