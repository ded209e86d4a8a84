import { useEffect, useMemo, useState } from 'preact/hooks';
import { html } from '../html.js';
import * as format from '../format.js';
import { id_path, query, useGet } from '../api.js';
import { Chart, axis, clock_values } from '../chart.js';
import { FloorPath } from '../floor.js';
import { useLive } from '../live.js';
import { Sparkline } from '../sparkline.js';
import { palette, useTheme } from '../theme.js';
import { mission_link } from '../route.js';
import { Answer, Empty, Panel, Readout, useTitleOf } from '../widgets.js';
import { Charge, Health } from './fleet.js';
import { MissionRows, ratio_of } from './missions.js';

const history_missions = 500, recent_rows = 12, median_missions = 9;

function median(values) {
  const sorted = [...values].sort((a, b) => a - b), half = sorted.length >> 1;
  return sorted.length % 2 === 1 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

// Measured over modelled energy of each mission, oldest first, with a running median.
function RatioChart({ missions, versions }) {
  const data = useMemo(() => {
    const rows = missions.filter((m) => m.state !== 'open' && ratio_of(m.energy) !== null && m.energy.duration_s > 1).reverse();
    const ratio = rows.map((m) => ratio_of(m.energy));
    return [rows.map((m) => m.start_utime_us / 1e6), rows.map((m, k) => (m.incomplete ? null : ratio[k])), rows.map((m, k) => (m.incomplete ? ratio[k] : null)),
      ratio.map((_, k) => (k + 1 < 3 ? null : median(ratio.slice(Math.max(0, k + 1 - median_missions), k + 1))))];
  }, [missions]);
  if (data[0].length === 0) return html`<${Empty} title="No finished mission with a measured battery yet" />`;
  const marks = versions.map((v) => [v.created_utime_us / 1e6, v.model_version]);
  const draw_marks = (u) => {
    const c = u.ctx, p = palette(), y1 = u.valToPos(1, 'y', true);
    c.save();
    c.strokeStyle = p.muted;
    c.fillStyle = p.muted;
    c.lineWidth = devicePixelRatio;
    c.font = `${11 * devicePixelRatio}px "Liberation Sans", Arial, sans-serif`;
    c.beginPath();
    c.moveTo(u.bbox.left, y1);
    c.lineTo(u.bbox.left + u.bbox.width, y1);
    for (const [at, version] of marks) {
      const x = u.valToPos(at, 'x', true);
      if (x < u.bbox.left || x > u.bbox.left + u.bbox.width) continue;
      c.moveTo(x, u.bbox.top);
      c.lineTo(x, u.bbox.top + u.bbox.height);
      c.fillText(`v${version}`, x + 4 * devicePixelRatio, u.bbox.top + 12 * devicePixelRatio);
    }
    c.stroke();
    c.restore();
  };
  const all = data[1].map((v, k) => v ?? data[2][k]);
  const spread = Math.max(0.05, ...all.map((v) => Math.min(0.6, Math.abs(v - 1)))) * 1.15;
  const make = () => {
    const p = palette(), dot = (colour, fill) => ({ stroke: 'transparent', width: 0, points: { show: true, size: 7, width: 1.5, stroke: colour, fill } });
    return {
      scales: { x: { time: true, range: (_, low, high) => { const pad = Math.max(60, 0.02 * (high - low)); return [low - pad, high + pad]; } }, y: { range: () => [1 - spread, 1 + spread] } },
      axes: [axis('', { size: 36, space: 84, values: clock_values }), axis('measured / modelled', { size: 56 })],
      series: [{}, { ...dot(p.measured, p.measured), paths: () => null }, { ...dot(p.measured, p.screen), paths: () => null }, { stroke: p.gap, width: 2, points: { show: false }, spanGaps: true }],
      cursor: { show: false }, hooks: { drawAxes: [draw_marks] },
    };
  };
  const last = data[3][data[3].length - 1] ?? median(all);
  return html`<${Chart} make=${make} data=${data} height=${240} changes=${[missions, versions]} label=${`Measured over modelled energy of ${data[0].length} missions; running median now ${format.fixed(last, 3)}`} />
    <p class="note foot"><span class="swatch measured dot"></span>mission <span class="swatch hollow dot"></span>incomplete <span class="swatch gap"></span>median of the last ${median_missions}, now <b>${format.fixed(last, 3)}</b>; vertical lines: new model versions.</p>`;
}

function flat(value, name = '', into = {}) {
  if (Array.isArray(value)) into[name] = value.map((v) => (typeof v === 'number' ? format.digits(v, 4) : String(v))).slice(0, 4).join(', ') + (value.length > 4 ? ` … (${value.length})` : '');
  else if (value !== null && typeof value === 'object') for (const [key, part] of Object.entries(value)) flat(part, name ? `${name}.${key}` : key, into);
  else into[name] = typeof value === 'number' ? format.digits(value, 4) : String(value);
  return into;
}

function changes_of(version, before) {
  if (before === undefined) return [];
  const now = flat(version.model), then = flat(before.model);
  return [...new Set([...Object.keys(now), ...Object.keys(then)])].filter((key) => now[key] !== then[key])
    .map((key) => ({ key, from: then[key] ?? '–', to: now[key] ?? '–' }));
}

function Versions({ versions }) {
  return html`<ol class="versions">${versions.map((v) => {
    const parent = versions.find((other) => other.model_version === (v.parent_version ?? v.model_version - 1));
    const changes = changes_of(v, parent);
    return html`<li key=${v.model_version} class=${v.active ? 'active' : ''}>
      <p><b>Version ${v.model_version}</b>${v.active && html` <span class="flag calm">in force</span>`} <span class="note">${format.time(v.created_utime_us)} · from ${{ file: 'a robot file', http: 'HTTP' }[v.origin] ?? `a ${v.origin}`}</span></p>
      ${v.note && html`<p class="note">${v.note}</p>`}
      ${changes.length > 0 && html`<ul class="changes">${changes.slice(0, 12).map((c) => html`<li key=${c.key}><code>${c.key}</code> ${c.from} → ${c.to}</li>`)}${changes.length > 12 && html`<li class="note">and ${changes.length - 12} more</li>`}</ul>`}
    </li>`;
  })}</ol>`;
}

function Model({ model }) {
  return html`<details class="model"><summary>Parameters in force</summary>
    <table class="facts"><tbody>${Object.entries(flat(model)).filter(([key]) => key !== 'robot_id').map(([key, value]) => html`<tr key=${key}><th scope="row"><code>${key}</code></th><td>${value}</td></tr>`)}</tbody></table></details>`;
}

// Where the robot is and was: the running mission's trace so far, then what is heard live.
function LiveMap({ entry }) {
  const mission = entry.state.mission?.id;
  const begun = useGet(mission ? `/v1/missions/${mission}/trace?points=600` : null);
  const [joined] = useState({ mission: null, rows: [] });
  if (joined.mission !== mission) Object.assign(joined, { mission, rows: [] });
  const heard = entry.path.last();
  const before = mission && begun.value && begun.value.id === mission
    ? begun.value.x_m.map((x, k) => [x ?? NaN, begun.value.y_m[k] ?? NaN, begun.value.measured_power_w.mean[k] ?? begun.value.modelled_power_w.mean[k] ?? NaN]) : [];
  const rows = [...before, ...heard.map(([x, y, , w]) => [x, y, w])];
  const [x, y, heading] = entry.state.pose;
  if (rows.length === 0 || x === null) return html`<${Empty} title="No position">This robot does not tell where it is.<//>`;
  return html`<${FloorPath} points=${rows} height=${340} ends=${false} robot=${[x, y, heading ?? 0]} label=${`Path of ${entry.id} so far, coloured by power, and where it is now`} />`;
}

export function Robot({ id }) {
  useTitleOf(id);
  const live = useLive(), dark = useTheme();
  const detail = useGet(`/v1/robots/${id_path(id)}`);
  const versions = useGet(`/v1/robots/${id_path(id)}/versions`);
  const missions = useGet(`/v1/missions${query({ robot_id: id, limit: history_missions })}`);
  const entry = live.robots.get(id), s = entry?.state;
  const running = s?.mission?.id;
  useEffect(() => {
    if (missions.value !== null) missions.reload();
  }, [running]);
  if (!s && live.loaded && detail.error?.status === 404) return html`<${Empty} title=${`There is no robot ${id}`}>See the <a href="#/fleet">fleet</a>.<//>`;
  return html`
    <div class="heading"><p class="crumbs"><a href="#/fleet">Fleet</a></p><h1>${id}</h1>
      ${s && html`<span class="health"><${Health} state=${s} /></span>`}
      <span class="spring"></span><a class="button" href=${`#/plan${query({ robot: id })}`}>Plan a drive</a></div>
    ${s && html`<dl class="readouts">
      <${Readout} large label=${s.measured_power_w === null ? 'Power (modelled)' : 'Power'} of=${format.power(s.measured_power_w ?? s.modelled_power_w)} channel=${s.measured_power_w === null ? 'modelled' : 'measured'} note=${html`<${Sparkline} track=${entry.power} revision=${entry.revision} dark=${dark} width=${120} height=${26} />`} />
      <${Readout} large label="Charge" of=${format.percent(s.state_of_charge)} note=${s.battery_voltage_v === null ? '' : format.text(format.unit(s.battery_voltage_v, 'V', 2))} />
      <${Readout} large label="Range" of=${format.length(s.range_m)} />
      <${Readout} large label="Run time" of=${format.span(s.run_time_s)} />
      <${Readout} large label="Speed" of=${format.unit(s.speed_m_s, 'm/s', 2)} />
      <${Readout} large label="Payload" of=${format.unit(s.payload_kg, 'kg')} />
      <${Readout} large label="Windings, right · left" of=${s.winding_temperature_c[0] === null ? '–' : `${format.fixed(s.winding_temperature_c[0])} · ${format.fixed(s.winding_temperature_c[1])} °C`} />
      <${Readout} large label="Mission" of=${format.energy(s.mission?.energy.battery_j)} note=${s.mission ? html`<a href=${mission_link(s.mission.id)}>${s.mission.mission_id}</a>` : 'none running'} />
    </dl>`}
    <div class="columns">
      <${Panel} class="screen" title="Measured over modelled energy"><${Answer} of=${missions} what="missions">${(page) =>
        html`<${RatioChart} missions=${page.missions} versions=${versions.value?.versions ?? []} />`}<//><//>
      <${Panel} class="screen" title="On the floor now">${entry ? html`<${LiveMap} entry=${entry} />` : html`<${Empty} title="Never heard" />`}<//>
    </div>
    <${Panel} title="Recent missions" aside=${html`<a href=${`#/missions${query({ robot: id })}`}>All missions of ${id}</a>`}><${Answer} of=${missions} what="missions">${(page) =>
      page.missions.length === 0 ? html`<${Empty} title="No mission yet" />` : html`<div class="scroll"><${MissionRows} missions=${page.missions.slice(0, recent_rows)} with_robot=${false} /></div>`}<//><//>
    <div class="columns">
      <${Panel} title="Model versions">${versions.error?.status === 404 ? html`<${Empty} title="No model">Put a robot file to <code>/v1/robots/${id}</code> to have its energy modelled.<//>`
        : html`<${Answer} of=${versions} what="versions">${(told) => html`<${Versions} versions=${told.versions} />`}<//>`}<//>
      <${Panel} title="Model">${detail.value ? html`<${Model} model=${detail.value.model} />` : html`<p class="note">none</p>`}<//>
    </div>`;
}
