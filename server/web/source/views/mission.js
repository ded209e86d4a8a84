import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import { html } from '../html.js';
import * as format from '../format.js';
import { id_path, post, query, useGet } from '../api.js';
import { Bars } from '../bars.js';
import { Chart, axis, clock_steps, cursor_of, with_alpha } from '../chart.js';
import { FloorPath } from '../floor.js';
import { driven_runs, least_drive_request, payloads_of } from '../least_drive.js';
import { robot_link } from '../route.js';
import { palette } from '../theme.js';
import { Answer, Choice, Empty, Failure, Loading, MissionState, Panel, Readout, useTitleOf } from '../widgets.js';
import { Waterfall } from '../waterfall.js';
import { ratio_of } from './missions.js';

const trace_points = 700, fine_points = 6000, group = 'mission';
const run_clock = (_, splits) => splits.map((s) => {
  if (s === null) return '';
  const sign = s < 0 ? '−' : '', t = Math.abs(s), two = (v) => String(Math.floor(v)).padStart(2, '0');
  return t < 3600 ? `${sign}${Math.floor(t / 60)}:${two(t % 60)}` : `${sign}${Math.floor(t / 3600)}:${two((t % 3600) / 60)}:${two(t % 60)}`;
});

function seconds(trace, start_utime_us) {
  return trace.start_utime_us.map((t) => (t - start_utime_us + trace.width_us / 2) / 1e6);
}

// Columns for the chart, with an empty row where the trace pauses, so that no line bridges it.
function with_pauses(trace, start_utime_us, columns) {
  const t = seconds(trace, start_utime_us), pauses = [];
  for (let k = 1; k < t.length; ++k) if (trace.start_utime_us[k] - trace.start_utime_us[k - 1] > 1.9 * trace.width_us) pauses.push(k);
  if (pauses.length === 0) return [t, ...columns];
  const open = (column, at) => {
    const rows = [];
    column.forEach((v, k) => {
      if (pauses.includes(k)) rows.push(at === undefined ? (column[k - 1] + v) / 2 : at);
      rows.push(v);
    });
    return rows;
  };
  return [open(t), ...columns.map((column) => open(column, null))];
}

function Charts({ trace, mission, zoom, set_zoom, set_cursor }) {
  const [power, speed] = useMemo(() => {
    const bands = (...of) => with_pauses(trace, mission.start_utime_us, of.flatMap((band) => [band.max, band.min, band.mean]));
    return [bands(trace.measured_power_w, trace.modelled_power_w), bands(trace.speed_m_s)];
  }, [trace]);
  const trace_now = useRef(trace);
  trace_now.current = trace;
  const hooks = {
    setCursor: [(u) => set_cursor(u.cursor.idx === null || u.cursor.idx === undefined ? null : index_at(trace_now.current, mission.start_utime_us + u.data[0][u.cursor.idx] * 1e6))],
    setSelect: [(u) => {
      if (u.select.width < 6) return;
      set_zoom([u.posToVal(u.select.left, 'x'), u.posToVal(u.select.left + u.select.width, 'x')]);
      u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    }],
  };
  const cursor = { ...cursor_of(group), drag: { x: true, y: false, setScale: false, dist: 6 }, bind: { dblclick: () => () => set_zoom(null) } };
  const time_axis = (label) => axis(label, { size: 28, incrs: clock_steps, values: run_clock });
  const make_power = () => {
    const p = palette(), none = { show: true, stroke: 'transparent', points: { show: false } };
    return {
      cursor, hooks, scales: { x: { time: false } },
      axes: [time_axis(''), axis('power, W')],
      bands: [{ series: [1, 2], fill: with_alpha(p.measured, 0.2) }, { series: [4, 5], fill: with_alpha(p.modelled, 0.16) }],
      series: [{}, none, none, { stroke: p.measured, width: 2.75, points: { show: false } }, none, none,
        { stroke: p.modelled, width: 1, points: { show: false } }],
    };
  };
  const make_speed = () => {
    const p = palette(), none = { stroke: 'transparent', points: { show: false } };
    return {
      cursor, hooks, scales: { x: { time: false } },
      axes: [time_axis('time since the start'), axis('speed, m/s')],
      bands: [{ series: [1, 2], fill: with_alpha(p.ink, 0.12) }],
      series: [{}, none, none, { stroke: p.ink, width: 1.5, points: { show: false } }],
    };
  };
  // Keys move the cursor over both charts and look closer around it.
  const plots = useRef([]), at = useRef(0);
  const key = (event) => {
    const t = plots.current[0].data[0], far = Math.max(1, Math.round(t.length / 20)), step = event.shiftKey ? far : 1;
    const to = { ArrowLeft: at.current - step, ArrowRight: at.current + step, Home: 0, End: t.length - 1 }[event.key];
    const span = t[t.length - 1] - t[0], here = t[Math.min(at.current, t.length - 1)];
    if (to !== undefined) {
      at.current = Math.max(0, Math.min(t.length - 1, to));
      for (const u of plots.current) u.setCursor({ left: u.valToPos(t[at.current], 'x'), top: 8 });
    } else if (event.key === '+' && span > 4) set_zoom([Math.max(t[0], here - span / 4), Math.min(t[t.length - 1], here + span / 4)]);
    else if (event.key === '-' || event.key === 'Escape') set_zoom(null);
    else return;
    event.preventDefault();
  };
  return html`<div class="charts" tabindex="0" role="group" aria-label="Power and speed over time. Left and right move the cursor, plus looks closer, minus shows the whole mission." onKeyDown=${key}>
    <${Chart} make=${make_power} data=${power} height=${270} changes=${[mission.id]} onReady=${(u) => { plots.current[0] = u; }} label="Battery power over the mission, measured and modelled, with the least and greatest of each span" />
    <${Chart} make=${make_speed} data=${speed} height=${150} changes=${[mission.id]} onReady=${(u) => { plots.current[1] = u; }} label="Speed over the mission" /></div>`;
}

function AtCursor({ trace, mission, index }) {
  const at = index !== null && index < trace.start_utime_us.length ? index : null;
  const of = (column, f) => (at === null ? { n: '–', u: '' } : f(column[at]));
  const measured = trace.measured_power_w, modelled = trace.modelled_power_w;
  const gap = at === null || measured.mean[at] === null ? null : measured.mean[at] - modelled.mean[at];
  return html`<dl class="readouts strip" aria-live="off">
    <${Readout} label="Time" of=${at === null ? '–' : format.span((trace.start_utime_us[at] - mission.start_utime_us) / 1e6)} />
    <${Readout} label="Measured" channel="measured" of=${of(measured.mean, format.power)} note=${at !== null && measured.mean[at] !== null ? `${format.fixed(measured.min[at], 0)} to ${format.fixed(measured.max[at], 0)}` : ''} />
    <${Readout} label="Modelled" channel="modelled" of=${of(modelled.mean, format.power)} />
    <${Readout} label="Gap" channel="gap" of=${(() => { const q = format.power(gap); return { n: format.signed(q.n), u: q.u }; })()} />
    <${Readout} label="Speed" of=${of(trace.speed_m_s.mean, (v) => format.unit(v, 'm/s', 2))} />
    <${Readout} label="Charge" of=${of(trace.state_of_charge, (v) => format.percent(v, 2))} />
  </dl>`;
}

function index_at(trace, utime_us) {
  const k = Math.floor((utime_us - trace.start_utime_us[0]) / trace.width_us);
  let at = Math.max(0, Math.min(k, trace.start_utime_us.length - 1));
  while (at > 0 && trace.start_utime_us[at] > utime_us) at -= 1;
  return at;
}

function TracePanels({ mission, whole, fine }) {
  const [zoom, set_zoom] = useState(null);
  const [cursor, set_cursor] = useState(null);
  const [colouring, set_colouring] = useState('power');
  const utime = (second) => Math.round(mission.start_utime_us + second * 1e6);
  const closer = useGet(zoom === null ? null : `/v1/missions/${mission.id}/trace${query({ points: trace_points, from_utime_us: utime(zoom[0]), to_utime_us: utime(zoom[1]) })}`);
  const trace = zoom !== null && closer.value !== null && closer.value.start_utime_us.length > 1 ? closer.value : whole;
  const measured = whole.measured_power_w.mean.some((v) => v !== null);
  const way = trace === whole ? fine : trace;
  const path = useMemo(() => way.x_m.map((x, k) => {
    const m = way.measured_power_w.mean[k], f = way.modelled_power_w.mean[k];
    return [x ?? NaN, way.y_m[k] ?? NaN, colouring === 'gap' ? (m === null ? NaN : m - f) : m ?? f ?? NaN];
  }), [way, colouring]);
  const here = cursor === null || cursor >= trace.start_utime_us.length ? null : index_at(way, trace.start_utime_us[cursor] + trace.width_us / 2);
  const placed = path.some(([x]) => Number.isFinite(x));
  if (whole.start_utime_us.length === 0) return html`<${Panel} title="Power"><${Empty} title="No trace kept">The mission ended before its first sample was stored.<//><//>`;
  return html`<div class="columns trace-columns">
    <${Panel} class="screen" title="Power and speed" aside=${html`
        <span class="key"><span class="swatch measured"></span>measured <span class="swatch modelled"></span>modelled <span class="swatch band"></span>least to greatest</span>
        ${zoom === null ? html`<span class="note">drag or press + to look closer</span>` : html`<button type="button" onClick=${() => set_zoom(null)}>Whole mission</button>`}`}>
      <${Charts} trace=${trace} mission=${mission} zoom=${zoom} set_zoom=${set_zoom} set_cursor=${set_cursor} />
      <${AtCursor} trace=${trace} mission=${mission} index=${cursor} />
      <p class="note foot">Each point is ${format.span(trace.width_us / 1e6)}${zoom !== null ? ', closer view' : ''}.</p>
    <//>
    <${Panel} class="screen" title="On the floor" aside=${html`<${Choice} label="Colour by" value=${colouring} onChange=${set_colouring} options=${measured ? [['power', 'Power'], ['gap', 'Gap']] : [['power', 'Power']]} />`}>
      ${placed ? html`<${FloorPath} points=${path} kind=${colouring} cursor=${here} height=${440} label=${`Path of the mission, coloured by ${colouring === 'gap' ? 'measured minus modelled power' : 'power'}; circle: start, square: end`} />
        <p class="note foot">○ start  ■ end. Poses as the robot told them.</p>`
      : html`<${Empty} title="No poses">This robot did not tell where it was.<//>`}
    <//>
  </div>`;
}

// With what load the minimum-energy drive was reckoned.
function carried_note(mission, payloads) {
  const kg = (value) => format.text(format.unit(value, 'kg'));
  if (payloads === null) return `the declared payload of ${kg(mission.payload_kg ?? 0)} all the way: what it was on the way is not looked at`;
  const [low, high] = [Math.min(...payloads), Math.max(...payloads)];
  return low === high ? `payload ${kg(low)}` : `payload as the robot told it on the way, ${kg(low)} to ${kg(high)}`;
}

function LeastDrive({ mission, trace }) {
  const robot = useGet(`/v1/robots/${id_path(mission.robot_id)}`);
  const idle_power_w = robot.value?.model.idle_power_w;
  const driven = useMemo(() => (idle_power_w === undefined ? null : driven_runs(mission, trace, idle_power_w)), [mission.id, mission.state, idle_power_w]);
  const [told, set_told] = useState({ value: null, error: null });
  useEffect(() => {
    if (driven === null) return undefined;
    const abort = new AbortController();
    payloads_of(mission, driven.runs, abort.signal).then(async (payloads) => {
      const request = least_drive_request(mission, driven, payloads);
      const value = await post(`/v1/robots/${id_path(mission.robot_id)}/profile`, request, abort.signal);
      set_told({ value, error: null, request, payloads });
    }).catch((error) => error.name === 'AbortError' || set_told({ value: null, error }));
    return () => abort.abort();
  }, [driven]);
  const error = robot.value === null ? robot.error : told.error;
  if (error !== null) return html`<${Failure} error=${error} />`;
  if (robot.value !== null && driven === null) return html`<${Empty} title="Nothing to compare">The robot did not drive, or in too many short runs.<//>`;
  if (told.value === null) return html`<${Loading} what="the minimum-energy drive" />`;
  const { request, payloads } = told;
  const e = mission.energy, least = told.value, share = 1 - least.energy_j / e.modelled_j;
  const turned = request.path.reduce((sum, leg) => sum + Math.abs(leg.angle_rad ?? 0), 0);
  const stood_s = request.path.reduce((sum, leg) => sum + (leg.duration_s ?? 0), 0);
  const legs = request.path.filter((leg) => leg.kind === 'straight').length;
  return html`
    <p class="verdict">${share > 0.005 ? html`The same legs could have been driven for <b>${format.fixed(share * 100, 1)}${'\u00a0'}%</b> less.` : share > -0.005 ? 'Driven about as cheaply as the model allows.' : 'Driven for less than these legs cost from stop to stop: the robot turned while it drove.'}</p>
    <${Bars} label="Energy of the mission and of the minimum-energy drive" rows=${[
      { name: 'Measured', value: e.measured_j, of: format.energy(e.measured_j, 4), channel: 'measured', note: format.span(e.duration_s) },
      { name: 'Modelled', value: e.modelled_j, of: format.energy(e.modelled_j, 4), channel: 'modelled', note: format.span(e.duration_s) },
      { name: 'Least energy', value: least.energy_j, of: format.energy(least.energy_j, 4), channel: 'least', note: format.span(least.duration_s) },
    ]} />
    <p class="note foot">${legs} ${legs === 1 ? 'leg' : 'legs'} between stops, ${format.text(format.length(e.distance_m))} in all, ${format.fixed((turned * 180) / Math.PI)}° turned at the stops,${stood_s > 0 ? ` ${format.span(stood_s)} standing as the mission did,` : ''}${' '}${carried_note(mission, payloads)}, arriving no later. Model version ${least.model_version}; the saving is against the modelled energy, so that a gap of the model does not count as one.</p>`;
}

function Facts({ mission }) {
  const faults = Object.entries(mission.sample_faults);
  const row = (name, value) => html`<tr><th scope="row">${name}</th><td>${value}</td></tr>`;
  const e = mission.energy;
  return html`<table class="facts"><tbody>
    ${row('Robot', html`<a href=${robot_link(mission.robot_id)}>${mission.robot_id}</a>`)}
    ${row('Started', format.time(mission.start_utime_us))}
    ${row(mission.state === 'open' ? 'Last heard' : 'Ended', format.time(mission.end_utime_us))}
    ${row('Announced', mission.implicit ? 'no: opened by its telemetry' : 'by the robot')}
    ${row('Model', mission.model_version === null ? 'none' : `version ${mission.model_version}`)}
    ${row('Samples', format.fixed(mission.samples))}
    ${row('Gaps', mission.gap_count === 0 ? 'none' : `${mission.gap_count}, ${format.span(mission.gap_s)} in all`)}
    ${row('Faulty samples', faults.length === 0 ? 'none' : faults.map(([reason, n]) => `${n} ${format.words(reason)}`).join(', '))}
    ${row('Battery measured', `${format.span(e.measured_s)} of ${format.span(e.duration_s)}`)}
    ${row('Drawn · returned', `${format.text(format.energy(e.drawn_j))} · ${format.text(format.energy(e.returned_j))}`)}
    ${row('Charge', format.text(format.unit(e.charge_ah * 1000, 'mAh')))}
    ${row('Motors measured', e.measured_motor_j[0] === null ? '–' : `right ${format.text(format.energy(e.measured_motor_j[0]))}, left ${format.text(format.energy(e.measured_motor_j[1]))}`)}
    ${row('Motors modelled', `right ${format.text(format.energy(e.modelled_motor_j[0]))}, left ${format.text(format.energy(e.modelled_motor_j[1]))}`)}
    ${mission.note && row('Note', mission.note)}
  </tbody></table>`;
}

// What held of each covariate: of labels the words, of numbers their range.
function Conditions({ told }) {
  const labels = new Map(), numbers = [];
  for (const { name, value } of told.covariates) {
    const known = value.filter((v) => v !== null), at = name.indexOf('=');
    if (known.length === 0) continue;
    if (at > 0) {
      if (known.some((v) => v !== 0)) labels.set(name.slice(0, at), [...(labels.get(name.slice(0, at)) ?? []), name.slice(at + 1)]);
    } else {
      const least = Math.min(...known), most = Math.max(...known), digits = (v) => Number(v.toPrecision(4));
      numbers.push([name, least === most ? `${digits(least)}` : `${digits(least)} to ${digits(most)}, ${known.length} changes`]);
    }
  }
  return html`<table class="facts"><tbody>${[...[...labels].map(([name, words]) => [name, words.join(', ')]), ...numbers].map(([name, held]) =>
    html`<tr><th scope="row">${format.words(name)}</th><td>${held}</td></tr>`)}</tbody></table>
    ${told.next_cursor !== null && html`<p class="note foot">Of the first ${told.covariates.reduce((n, c) => n + c.value.length, 0)} changes.</p>`}`;
}

export function Mission({ id }) {
  const mission = useGet(`/v1/missions/${id_path(id)}`);
  const there = mission.value !== null;
  const ledger = useGet(there ? `/v1/missions/${id_path(id)}/ledger` : null);
  const conditions = useGet(there ? `/v1/missions/${id_path(id)}/covariates` : null);
  const trace = useGet(there ? `/v1/missions/${id_path(id)}/trace${query({ points: trace_points })}` : null);
  // A long mission's path and stops need more than a chart does.
  const merged = trace.value !== null && trace.value.start_utime_us.length >= trace_points / 2;
  const finer = useGet(merged ? `/v1/missions/${id_path(id)}/trace${query({ points: fine_points })}` : null);
  const fine = merged ? finer.value : trace.value;
  useTitleOf(mission.value?.mission_id ?? 'Mission');
  const open = mission.value?.state === 'open';
  useEffect(() => {
    if (!open) return undefined;
    const timer = setInterval(() => [mission, ledger, trace, conditions].forEach((told) => told.reload()), 3000);
    return () => clearInterval(timer);
  }, [open]);
  if (!there && [400, 404].includes(mission.error?.status)) return html`<${Empty} title=${`There is no mission ${id}`}>No mission of this history has that number. See <a href="#/missions">all missions</a>.<//>`;
  return html`<${Answer} of=${mission} what="the mission">${(m) => {
    const e = m.energy, ratio = ratio_of(e);
    return html`
    <div class="heading"><p class="crumbs"><a href="#/missions">Missions</a> / <a href=${robot_link(m.robot_id)}>${m.robot_id}</a></p>
      <h1>${m.mission_id}</h1><${MissionState} mission=${m} />
      ${m.incomplete && html`<span class="flag">incomplete${m.incomplete_reason ? `: ${format.words(m.incomplete_reason)}` : ''}</span>`}
      <span class="note">${format.time(m.start_utime_us)}</span></div>
    <dl class="readouts">
      <${Readout} large label=${e.measured_j === null ? 'From the battery (modelled)' : 'From the battery'} of=${format.energy(e.battery_j)} channel=${e.measured_j === null ? 'modelled' : 'measured'} />
      <${Readout} large label="Modelled" of=${format.energy(e.modelled_j)} channel="modelled" />
      <${Readout} large label="Unexplained" of=${(() => { const q = format.energy(e.unexplained_j); return { n: format.signed(q.n), u: q.u }; })()} channel="gap" note=${ratio === null ? '' : `ratio ${format.fixed(ratio, 3)}`} />
      <${Readout} large label="Distance" of=${format.length(e.distance_m)} />
      <${Readout} large label="Duration" of=${format.span(e.duration_s)} />
      <${Readout} large label="Per metre" of=${format.unit(e.distance_m > 0.1 ? e.battery_j / e.distance_m : null, 'J/m')} />
      <${Readout} large label="Declared payload" of=${format.unit(m.payload_kg, 'kg')} />
    </dl>
    <${Answer} of=${trace} what="the trace">${(value) => html`<${TracePanels} mission=${m} whole=${value} fine=${fine ?? value} />`}<//>
    <div class="columns">
      <${Panel} title="Where the energy went"><${Answer} of=${ledger} what="the ledger">${({ ledger: l }) =>
        html`<${Waterfall} terms_j=${l.terms_j} battery_j=${l.battery_j} closure=${l.closure_relative} />`}<//><//>
      <div>
        <${Panel} title="Against the minimum-energy drive">${m.model_version === null ? html`<${Empty} title="No model">The robot had no model on this mission.<//>` :
          open ? html`<${Empty} title="Still driving">Compared when the mission ends.<//>` : m.gap_s > 0 ? html`<${Empty} title="Not compared">For ${format.span(m.gap_s)} of the mission nothing is known.<//>` : fine && html`<${LeastDrive} mission=${m} trace=${fine} />`}<//>
        <${Panel} title="Record"><${Facts} mission=${m} /><//>
        ${conditions.value?.covariates.length > 0 && html`<${Panel} title="Conditions"><${Conditions} told=${conditions.value} /><//>`}
      </div>
    </div>`;
  }}<//>`;
}
