import { Component } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { html } from '../html.js';
import * as format from '../format.js';
import { useLive } from '../live.js';
import { mission_link, robot_link } from '../route.js';
import { Sparkline } from '../sparkline.js';
import { useTheme } from '../theme.js';
import { Choice, Empty, Failure, Loading, Quantity, Readout, useTitleOf } from '../widgets.js';

const row_px = 46, spare_rows = 8, reorder_ms = 3000, low_charge = 0.25;

// Where nine tenths of a forecast lie, written by `as(low, high)`; nothing where there is none.
export function between(band, as) {
  if (!format.known(band?.p05) || !format.known(band.p95)) return '';
  return html`<span title="nine times of ten"><span class="hidden">90 % between </span>${as(band.p05, band.p95)}</span>`;
}

const by = (value) => (a, b) => {
  const va = value(a.state), vb = value(b.state);
  const missing = (va === null || va === undefined) - (vb === null || vb === undefined);
  return missing || (va < vb ? -1 : va > vb ? 1 : 0);
};
// A robot that fell silent may do anything by now: what it last did is no answer to what it does.
export const now = (state, value) => (state.live ? value : null);
const power_now = (state) => now(state, state.measured_power_w ?? state.modelled_power_w);

const names = new Intl.Collator('en', { numeric: true });
const columns = [
  { key: 'robot', title: 'Robot', sort: (a, b) => names.compare(a.id, b.id), class: 'robot' },
  { key: 'health', title: 'Telemetry', sort: by((s) => (s.live ? 0 : s.silent_s === null ? Infinity : 1 + s.silent_s)), class: 'health' },
  { key: 'power', title: 'Power', sort: by((s) => power_now(s)), class: 'figure power' },
  { key: 'trace', title: 'Last 90 s', class: 'spark' },
  { key: 'charge', title: 'Charge', sort: by((s) => s.state_of_charge), class: 'charge' },
  { key: 'range', title: 'Range', sort: by((s) => s.range_m), class: 'figure range' },
  { key: 'time', title: 'Run time', sort: by((s) => s.run_time_s), class: 'figure wide' },
  { key: 'speed', title: 'Speed', sort: by((s) => now(s, s.speed_m_s)), class: 'figure wide' },
  { key: 'mission', title: 'Mission', sort: by((s) => s.mission?.start_utime_us), class: 'mission' },
  { key: 'spent', title: 'Spent', sort: by((s) => s.mission?.energy.battery_j), class: 'figure spent' },
];

// Nothing came from it since the service started.
const unheard = (state) => state.silent_s === null;

// What happens in good order: robots and the service are restarted, and stand between missions.
const ordinary = ['restart', 'gap', 'outside_mission', 'reused_mission_id'];

function health_of(state) {
  const faults = Object.entries(state.faults).reduce((sum, [reason, n]) => sum + (ordinary.includes(reason) ? 0 : n), 0);
  if (!state.has_model) return { level: 'bad', text: 'no model', faults };
  if (state.live) return { level: 'good', text: 'live', faults };
  if (unheard(state)) return { level: 'none', text: 'not heard', faults };
  return { level: 'bad', text: `silent since ${since(state.heard_us)}`, faults };
}

// When it was, as short as today allows.
export function since(utime_us) {
  const at = new Date(utime_us / 1000);
  return Date.now() - at < 86_400e3 ? format.clock(utime_us).slice(0, 5) : at.toLocaleDateString('en', { day: 'numeric', month: 'short' });
}

export function Health({ state }) {
  const { level, text, faults } = health_of(state);
  const listed = Object.entries(state.faults).filter(([reason]) => !ordinary.includes(reason)).map(([reason, n]) => `${n} ${format.words(reason)}`).join(', ');
  return html`<span class=${`lamp ${level}`} aria-hidden="true"></span>${text}
    ${faults > 0 && html`<span class="note" title=${listed}> · ${format.fixed(faults)} faulty</span>`}`;
}

// What a charger does to it, or how sure the charge is: {text, what}.
export function charge_note({ charging, charge, state_of_charge_sd: sd }) {
  const left_s = charge?.time_to_charged_s;
  if (charging?.phase === 'full') return { text: 'charged', what: 'At its charger, which has ended' };
  if (charging) return { text: `charging${format.known(left_s) ? `, ${format.about(left_s)}` : ''}`, what: `At its charger${format.known(left_s) ? `, ready in ${format.about(left_s)}` : ''}` };
  return { text: format.known(sd) ? `± ${format.text(format.percent(sd))}` : '', what: 'standard deviation' };
}

export function Charge({ state }) {
  const share = state.state_of_charge;
  if (share === null) return html`<span class="note">unknown</span>`;
  const { text, what } = charge_note(state);
  return html`<span class=${`charge-bar ${state.charging ? 'charging' : share < low_charge ? 'low' : ''}`} aria-hidden="true"><span style=${{ width: `${Math.max(2, share * 100)}%` }}></span></span>
    <${Quantity} of=${format.percent(share)} /><span class="below" title=${what}>${text}</span>`;
}

// Missions that are named after their robot need not say so in its row.
const own_part = (mission_id, robot_id) => (mission_id.startsWith(`${robot_id}-`) ? mission_id.slice(robot_id.length + 1) : mission_id);

class Row extends Component {
  shouldComponentUpdate(next) {
    return next.revision !== this.props.revision || next.entry !== this.props.entry || next.index !== this.props.index || next.dark !== this.props.dark;
  }
  render({ entry, index, revision, dark }) {
    const s = entry.state;
    const modelled_only = s.live && s.measured_power_w === null;
    return html`<tr aria-rowindex=${index + 2} class=${s.live ? '' : 'quiet'}>
      <th scope="row" class="robot"><a href=${robot_link(entry.id)}>${entry.id}</a></th>
      <td class="health"><${Health} state=${s} /></td>
      <td class="figure power"><${Quantity} of=${format.power(power_now(s))} />${modelled_only && s.modelled_power_w !== null && html`<span class="note"> mod.</span>`}</td>
      <td class="spark"><${Sparkline} track=${entry.power} revision=${revision} dark=${dark} /></td>
      <td class="charge"><${Charge} state=${s} /></td>
      <td class="figure range"><${Quantity} of=${format.length(s.range_m)} /><span class="below">${between(s.range_quantiles_m, format.length_band)}</span></td>
      <td class="figure wide">${format.about(s.run_time_s)}</td>
      <td class="figure wide"><${Quantity} of=${format.unit(now(s, s.speed_m_s), 'm/s', 2)} /></td>
      <td class="mission">${s.mission ? html`<a href=${mission_link(s.mission.id)} title=${s.mission.mission_id}>${own_part(s.mission.mission_id, entry.id)}</a>` : html`<span class="note">${s.live ? 'idle' : '–'}</span>`}</td>
      <td class="figure spent"><${Quantity} of=${format.energy(s.mission?.energy.battery_j)} /></td>
    </tr>`;
  }
}

function chosen(robots, text, only) {
  const wanted = text.trim().toLowerCase();
  const keep = {
    all: () => true, heard: (s) => !unheard(s), live: (s) => s.live, charging: (s) => s.charging !== null, silent: (s) => !s.live, mission: (s) => s.mission !== null,
    low: (s) => s.state_of_charge !== null && s.state_of_charge < low_charge,
  }[only];
  return [...robots.values()].filter((entry) => keep(entry.state) &&
    (wanted === '' || entry.id.toLowerCase().includes(wanted) || (entry.state.mission?.mission_id ?? '').toLowerCase().includes(wanted)));
}

// The rows in their order. Live values move all the time; their order is renewed only every few seconds, so
// that rows can be read.
function useOrder(live, text, only, sort) {
  const kept = useRef({ key: '', at: -Infinity, rows: [] });
  const key = `${text}|${only}|${sort.key}|${sort.down}|${live.robots.size}|${live.loads}`;
  const now = performance.now();
  if (kept.current.key !== key || now - kept.current.at > reorder_ms) {
    const column = columns.find((c) => c.key === sort.key);
    // Robots that were not heard stand last, whatever the order.
    const rows = chosen(live.robots, text, only).sort((a, b) => unheard(a.state) - unheard(b.state) || (sort.down ? -1 : 1) * column.sort(a, b) || names.compare(a.id, b.id));
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
  let [power, live, running, spent, lowest, known_power, charging, charged] = [0, 0, 0, 0, null, false, 0, 0];
  for (const { state: s } of robots.values()) {
    const drawn = s.measured_power_w ?? s.modelled_power_w;
    if (s.live) {
      live += 1;
      if (s.charging !== null) {
        charging += 1;
        charged -= Math.min(0, s.measured_power_w ?? 0);
      } else if (drawn !== null) {
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
    <${Readout} large label="Spent in running missions" of=${format.energy(running > 0 ? spent : null)} />
    ${charging > 0 && html`<${Readout} large label="Charging" of=${`${charging}`} note=${`at ${format.text(format.power(charged))}`} />`}
    <${Readout} large label="Lowest charge" of=${format.percent(lowest?.state_of_charge)} note=${lowest && html`<a href=${robot_link(lowest.robot_id)}>${lowest.robot_id}</a>`} />
  </dl>`;
}

export function Fleet() {
  useTitleOf('Fleet');
  const live = useLive(), dark = useTheme();
  const [text, set_text] = useState('');
  const [only, set_only] = useState('all');
  const [sort, set_sort] = useState({ key: 'robot', down: false });
  const [whole, set_whole] = useState(false);
  const quiet = [...live.robots.values()].filter((entry) => unheard(entry.state)).length;
  const foldable = only === 'all' && text === '' && quiet > 0 && quiet < live.robots.size;
  const rows = useOrder(live, text, foldable && !whole ? 'heard' : only, sort);
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
      <${Choice} label="Show" value=${only} onChange=${set_only} options=${[['all', 'All'], ['live', 'Live'], ['silent', 'Silent'], ['mission', 'On a mission'], ['charging', 'Charging'], ['low', 'Low charge']]} />
      <span class="key"><span class="swatch measured"></span>measured <span class="swatch modelled"></span>modelled</span>
    </div>
    <table class="grid fleet" aria-rowcount=${rows.length + 1}>
      <thead><tr>${columns.map((c) => html`<th key=${c.key} scope="col" class=${c.class} aria-sort=${direction(c)}>
        ${c.sort ? html`<button type="button" onClick=${() => turn(c.key)}>${c.title}<span class="arrow" aria-hidden="true">${c.key === sort.key ? (sort.down ? '▾' : '▴') : ''}</span></button>` : c.title}</th>`)}</tr></thead>
      <tbody ref=${body}>
        ${first > 0 && html`<tr key="above" aria-hidden="true" class="spacer"><td colspan=${columns.length} style=${{ height: `${first * row_px}px` }}></td></tr>`}
        ${rows.slice(first, last).map((entry, k) => html`<${Row} key=${entry.id} entry=${entry} revision=${entry.revision} index=${first + k} dark=${dark} />`)}
        ${last < rows.length && html`<tr key="below" aria-hidden="true" class="spacer"><td colspan=${columns.length} style=${{ height: `${(rows.length - last) * row_px}px` }}></td></tr>`}
      </tbody>
    </table>
    ${rows.length === 0 && html`<${Empty} title="No robot matches" />`}
    ${foldable && html`<p class="fold"><button type="button" class="plain" aria-expanded=${String(whole)} onClick=${() => set_whole(!whole)}>${whole ? 'Hide' : 'Show'} ${quiet} ${quiet === 1 ? 'robot' : 'robots'} not heard since the service started</button></p>`}`;
}
