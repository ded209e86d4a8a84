import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import { html } from '../html.js';
import * as format from '../format.js';
import { query, useGet } from '../api.js';
import { export_missions } from '../export.js';
import { useLive } from '../live.js';
import { keep_in_address, mission_link, robot_link } from '../route.js';
import { Answer, Empty, Failure, MissionState, Quantity, Readout, state_notes, useOptions, useTitleOf } from '../widgets.js';

const page_rows = 50;

// "2026-11-21T06:10" in local time, as the inputs of the browser give it, to microseconds.
const utime_us = (local) => (local ? new Date(local).getTime() * 1000 : undefined);

// The filter as the service takes it, from the filter as the address keeps it.
function filter_of(given) {
  return {
    robot_id: given.robot, mission_id: given.name, state: given.state, incomplete: given.incomplete,
    from_utime_us: utime_us(given.from), to_utime_us: utime_us(given.to),
    payload_min_kg: given.payload_min, payload_max_kg: given.payload_max,
  };
}

export const ratio_of = ({ measured_j, modelled_j }) => (measured_j !== null && modelled_j !== 0 ? measured_j / modelled_j : null);

export function MissionRows({ missions, with_robot = true }) {
  return html`<table class="grid missions">
    <thead><tr>
      <th scope="col">Started</th>${with_robot && html`<th scope="col">Robot</th>`}<th scope="col">Mission</th><th scope="col">State</th>
      <th scope="col" class="figure">Duration</th><th scope="col" class="figure">Distance</th><th scope="col" class="figure wide">Payload</th>
      <th scope="col" class="figure">Energy</th><th scope="col" class="figure wide">Modelled</th>
      <th scope="col" class="figure"><abbr title="measured over modelled energy">Ratio</abbr></th><th scope="col" class="figure wide">Per metre</th>
    </tr></thead>
    <tbody>${missions.map((m) => html`<tr key=${m.id}>
      <td class="when">${format.time(m.start_utime_us)}</td>
      ${with_robot && html`<td><a href=${robot_link(m.robot_id)}>${m.robot_id}</a></td>`}
      <th scope="row"><a href=${mission_link(m.id)}>${m.mission_id}</a></th>
      <td><${MissionState} mission=${m} />${m.incomplete && html` <span class="flag" title=${m.incomplete_reason ?? ''}>incomplete</span>`}</td>
      <td class="figure">${format.span(m.energy.duration_s)}</td>
      <td class="figure"><${Quantity} of=${format.length(m.energy.distance_m)} /></td>
      <td class="figure wide"><${Quantity} of=${format.unit(m.payload_kg, 'kg')} /></td>
      <td class="figure"><${Quantity} of=${format.energy(m.energy.battery_j)} /></td>
      <td class="figure wide"><${Quantity} of=${format.energy(m.energy.modelled_j)} /></td>
      <td class="figure"><${Ratio} value=${ratio_of(m.energy)} /></td>
      <td class="figure wide"><${Quantity} of=${m.energy.distance_m > 0.1 ? format.unit(m.energy.battery_j / m.energy.distance_m, 'J/m') : format.unit(null)} /></td>
    </tr>`)}</tbody>
  </table>`;
}

// Beyond a tenth the model misses by more than missions usually scatter.
export function Ratio({ value }) {
  return html`<span class=${format.known(value) && Math.abs(value - 1) > 0.1 ? 'ratio off' : 'ratio'}>${format.fixed(value, 3)}</span>`;
}

function Filters({ given, change }) {
  const live = useLive();
  const names = [...live.robots.keys()].sort();
  const options = useOptions(names);
  const set = (key) => (event) => change({ ...given, [key]: event.currentTarget.value });
  const field = (label, control) => html`<label class="field"><span>${label}</span>${control}</label>`;
  const any = Object.values(given).some((v) => v !== '' && v !== undefined);
  return html`<form class="filters" aria-label="Filter missions" onSubmit=${(e) => e.preventDefault()}>
    ${field('Robot', html`<select value=${given.robot ?? ''} onChange=${set('robot')}><option value="">all</option>
      ${given.robot && !names.includes(given.robot) && html`<option value=${given.robot}>${given.robot}</option>`}
      ${options}</select>`)}
    ${field('From', html`<input type="datetime-local" value=${given.from ?? ''} onChange=${set('from')} />`)}
    ${field('To', html`<input type="datetime-local" value=${given.to ?? ''} onChange=${set('to')} />`)}
    <fieldset class="field"><legend>Payload, kg</legend><span class="with-unit">
      <input class="short" type="number" min="0" step="any" aria-label="Payload, from kg" placeholder="from" value=${given.payload_min ?? ''} onChange=${set('payload_min')} />
      <input class="short" type="number" min="0" step="any" aria-label="Payload, to kg" placeholder="to" value=${given.payload_max ?? ''} onChange=${set('payload_max')} /></span></fieldset>
    ${field('State', html`<select value=${given.state ?? ''} onChange=${set('state')}><option value="">all</option>${Object.entries(state_notes).map(([state, name]) => html`<option key=${state} value=${state}>${name}</option>`)}</select>`)}
    ${field('Record', html`<select value=${given.incomplete ?? ''} onChange=${set('incomplete')}><option value="">all</option><option value="false">complete</option><option value="true">incomplete</option></select>`)}
    ${field('Named', html`<input type="text" value=${given.name ?? ''} onChange=${set('name')} />`)}
    <button type="button" class="plain" disabled=${!any} onClick=${() => change({})}>Clear</button>
  </form>`;
}

function Totals({ told }) {
  return html`<${Answer} of=${told} what="totals">${(t) => {
    const e = t.energy, some = t.missions > 0;
    return html`<dl class="readouts">
      <${Readout} label="Missions" of=${format.fixed(t.missions)} note=${t.incomplete_missions > 0 ? `${format.fixed(t.incomplete_missions)} incomplete` : ''} />
      <${Readout} label="Energy from the batteries" of=${format.energy(some ? e.battery_j : null)} channel="measured" />
      <${Readout} label="Modelled" of=${format.energy(some ? e.modelled_j : null)} channel="modelled" />
      <${Readout} label="Unexplained" of=${format.energy(e.unexplained_j)} channel="gap" note=${e.unexplained_j !== null && e.battery_j !== 0 ? `${format.fixed((100 * e.unexplained_j) / e.battery_j, 1)} %` : ''} />
      <${Readout} label="Distance" of=${format.length(e.distance_m)} />
      <${Readout} label="Per metre" of=${format.unit(e.distance_m > 0 ? e.battery_j / e.distance_m : null, 'J/m')} />
      <${Readout} label="Duration" of=${format.span(e.duration_s)} />
    </dl>`;
  }}<//>`;
}

function Export({ given, total }) {
  const [progress, set_progress] = useState(null);
  const [error, set_error] = useState(null);
  const abort = useRef(null);
  useEffect(() => () => abort.current?.abort(), []);
  const run = async (kind) => {
    abort.current = new AbortController();
    set_error(null);
    set_progress(0);
    try {
      await export_missions(kind, filter_of(given), set_progress, abort.current.signal);
    } catch (fault) {
      if (fault.name !== 'AbortError') set_error(fault);
    }
    set_progress(null);
  };
  if (progress !== null)
    return html`<div class="export" role="status">
      <progress max=${total || 1} value=${progress}></progress> ${format.fixed(progress)} of ${format.fixed(total)}
      <button type="button" onClick=${() => abort.current.abort()}>Stop</button></div>`;
  return html`<div class="export">${error && html`<span class="fault" role="alert">${error.message}</span>`}
    <button type="button" disabled=${!total} onClick=${() => run('csv')}>Export CSV</button>
    <button type="button" disabled=${!total} onClick=${() => run('json')}>Export JSON</button></div>`;
}

export function Missions({ given: asked }) {
  useTitleOf('Missions');
  const [given, set_given] = useState(asked);
  const [cursors, set_cursors] = useState(['']);
  const address = useRef(JSON.stringify(asked));
  useEffect(() => {  // a link to this view with another filter, or the browser's back
    if (JSON.stringify(asked) === address.current) return;
    address.current = JSON.stringify(asked);
    set_given(asked);
    set_cursors(['']);
  }, [asked]);
  const change = (next) => {
    const kept = Object.fromEntries(Object.entries(next).filter(([, v]) => v !== ''));
    address.current = JSON.stringify(kept);
    set_given(kept);
    set_cursors(['']);
    keep_in_address('missions', kept);
  };
  const filter = useMemo(() => filter_of(given), [given]);
  const cursor = cursors[cursors.length - 1];
  const page = useGet(`/v1/missions${query({ ...filter, limit: page_rows, cursor })}`);
  const totals = useGet(`/v1/mission-totals${query(filter)}`);
  const refresh = () => {
    page.reload();
    totals.reload();
  };
  return html`
    <h1 class="hidden">Missions</h1>
    <${Filters} given=${given} change=${change} />
    <${Totals} told=${totals} />
    <div class="tools"><button type="button" onClick=${refresh}>Refresh</button>
      <span class="note">Times are local (${Intl.DateTimeFormat().resolvedOptions().timeZone})</span>
      <${Export} given=${given} total=${totals.value?.missions ?? 0} /></div>
    <${Answer} of=${page} what="missions">${({ missions, next_cursor }) => html`
      ${page.error && html`<${Failure} error=${page.error} retry=${page.reload} />`}
      <div class=${page.loading ? 'stale' : ''} aria-busy=${String(page.loading)}>
      ${missions.length === 0
        ? html`<${Empty} title=${Object.keys(given).length > 0 ? 'No mission matches' : 'No mission yet'}>Missions appear when a robot announces one or sends telemetry.<//>`
        : html`<div class="scroll"><${MissionRows} missions=${missions} /></div>`}
      </div>
      ${missions.length > 0 && html`<nav class="pages" aria-label="Pages of missions">
        <button type="button" disabled=${cursors.length === 1} onClick=${() => set_cursors(cursors.slice(0, -1))}>Newer</button>
        <span>${format.fixed((cursors.length - 1) * page_rows + 1)} – ${format.fixed((cursors.length - 1) * page_rows + missions.length)}${totals.value ? ` of ${format.fixed(totals.value.missions)}` : ''}</span>
        <button type="button" disabled=${next_cursor === null} onClick=${() => set_cursors([...cursors, next_cursor])}>Older</button>
      </nav>`}`}<//>`;
}
