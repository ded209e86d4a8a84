// A robot's gap over its missions, its model versions, and robots of its kind. Part of the file loaded with the gap view.
import { useMemo, useState } from 'preact/hooks';
import { html } from '../html.js';
import * as format from '../format.js';
import { id_path, post, query, useGet } from '../api.js';
import { Chart, axis, clock_axis } from '../chart.js';
import { palette } from '../theme.js';
import { robot_link } from '../route.js';
import { Answer, Empty, Failure, Panel } from '../widgets.js';
import { flat } from './flat.js';
import { JobRows, share } from './jobs.js';

const median_missions = 9;

function median(values) {
  const sorted = [...values].sort((a, b) => a - b), half = sorted.length >> 1;
  return sorted.length % 2 === 1 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

// Measured over modelled energy of each mission with a running median, drifts and new model versions.
function RatioChart({ told }) {
  const { missions, drift, versions } = told;
  const data = useMemo(() => {
    const ratio = missions.map((m) => m.ratio);
    return [missions.map((m) => m.start_utime_us / 1e6), ratio,
      ratio.map((_, k) => (k < 2 ? null : median(ratio.slice(Math.max(0, k + 1 - median_missions), k + 1))))];
  }, [missions]);
  if (missions.length === 0) return html`<${Empty} title="No finished mission with a measured battery yet" />`;
  const draw_marks = (u) => {
    const c = u.ctx, p = palette(), y1 = u.valToPos(1, 'y', true), px = devicePixelRatio, { left, top, width, height } = u.bbox;
    const line = (at, colour, text, row, dash) => {
      const x = u.valToPos(at / 1e6, 'x', true);
      if (x < left || x > left + width) return;
      c.strokeStyle = c.fillStyle = colour;
      c.setLineDash(dash.map((d) => d * px));
      c.beginPath();
      c.moveTo(x, top);
      c.lineTo(x, top + height);
      c.stroke();
      const room = c.measureText(text).width + 8 * px;
      c.fillText(text, x + room > left + width ? x - room : x + 4 * px, top + row * 14 * px);
    };
    c.save();
    c.lineWidth = px;
    c.font = `${11 * px}px "Liberation Sans", Arial, sans-serif`;
    c.strokeStyle = p.muted;
    c.beginPath();
    c.moveTo(left, y1);
    c.lineTo(left + width, y1);
    c.stroke();
    // A version counts from the first mission that it metered: replayed missions are older than the version.
    for (const v of versions) {
      const first = missions.find((m) => m.model_version === v.model_version);
      if (first !== undefined) line(first.start_utime_us, p.muted, `v${v.model_version}`, -0.3, []);
    }
    for (const d of drift) line(d.start_utime_us, p.gap, `${format.signed(share(d.ratio_after - d.ratio_before))}`, 1, [4, 3]);
    c.restore();
  };
  const spread = Math.max(0.05, ...data[1].map((v) => Math.min(0.6, Math.abs(v - 1)))) * 1.15;
  const make = () => {
    const p = palette();
    return {
      scales: { x: { time: false, range: (_, low, high) => { const pad = Math.max(60, 0.02 * (high - low)); return [low - pad, high + pad]; } }, y: { range: () => [1 - spread, 1 + spread] } },
      axes: [axis('', { size: 42, space: 90, ...clock_axis }), axis('measured / modelled', { size: 56 })],
      series: [{}, { stroke: 'transparent', width: 0, points: { show: true, size: 7, width: 1.5, stroke: p.measured, fill: p.measured }, paths: () => null }, { stroke: p.gap, width: 2, points: { show: false }, spanGaps: true }],
      cursor: { show: false }, hooks: { drawAxes: [draw_marks] },
    };
  };
  const last = data[2][data[2].length - 1] ?? median(data[1]);
  const drifts = drift.map((d) => `${format.time(d.start_utime_us)}: ${format.signed(share(d.ratio_after - d.ratio_before))}`).join('; ');
  return html`<${Chart} make=${make} data=${data} height=${240} changes=${[told]} label=${`Measured over modelled energy of ${missions.length} missions; running median now ${format.fixed(last, 3)}; ${drift.length} drifts${drifts && `: ${drifts}`}`} />
    <p class="note foot"><span class="swatch measured dot"></span>mission <span class="swatch gap"></span>median of the last ${median_missions}, now <b>${format.fixed(last, 3)}</b>; full vertical lines: new model versions; dashed: ${drift.length === 0 ? 'drifts (none)' : `${drift.length} ${drift.length === 1 ? 'drift' : 'drifts'}`}.</p>`;
}

function changes_of(version, before) {
  if (before === undefined) return [];
  const now = flat(version.model), then = flat(before.model);
  return [...new Set([...Object.keys(now), ...Object.keys(then)])].filter((key) => now[key] !== then[key])
    .map((key) => ({ key, from: then[key] ?? null, to: now[key] ?? null }));
}

function Versions({ versions, robot, onChange }) {
  const [told, set_told] = useState({ busy: null, error: null });
  const roll = async (version) => {
    set_told({ busy: version, error: null });
    try {
      await post(`/v1/robots/${id_path(robot)}/model`, { version });
      onChange();
      set_told({ busy: null, error: null });
    } catch (error) {
      set_told({ busy: null, error });
    }
  };
  return html`${told.error && html`<${Failure} error=${told.error} />`}<ol class="versions">${versions.map((v) => {
    const parent = versions.find((other) => other.model_version === (v.parent_version ?? v.model_version - 1));
    const changes = changes_of(v, parent);
    return html`<li key=${v.model_version} class=${v.active ? 'active' : ''}>
      <p><b>Version ${v.model_version}</b>${v.active && html` <span class="flag calm">in force</span>`} <span class="note">${format.time(v.created_utime_us)} · from ${{ file: 'a robot file', http: 'HTTP' }[v.origin] ?? `a ${v.origin}`}</span></p>
      ${v.note && !v.evidence?.diagnosis_id && html`<p class="note">${v.note}</p>`}
      ${v.evidence && html`<p class="note"><${Evidence} of=${v.evidence} /></p>`}
      ${!v.active && html`<p><button type="button" disabled=${told.busy !== null} onClick=${() => roll(v.model_version)}>${told.busy === v.model_version ? 'Putting in force …' : `Put version ${v.model_version} in force again`}</button></p>`}
      ${changes.length > 0 && html`<ul class="changes">${changes.slice(0, 12).map((c) => html`<li key=${c.key}><code>${c.key}</code> ${c.from === null ? `new: ${c.to}` : c.to === null ? `gone, was ${c.from}` : `${c.from} → ${c.to}`}</li>`)}${changes.length > 12 && html`<li class="note">and ${changes.length - 12} more</li>`}</ul>`}
    </li>`;
  })}</ol>`;
}

function Evidence({ of: { back_test: test, forced, diagnosis_id } }) {
  return html`${diagnosis_id && html`From <a href=${`#/gap/${diagnosis_id}`}>diagnosis ${diagnosis_id}</a>. `}${test.missions.length > 0 ? html`Energy error on ${test.missions.length} other missions: ${share(test.error_before, 2)} before, ${share(test.error_after, 2)} after.` : 'Not tested: there was no mission to test it on.'}${forced && html` <span class="flag">forced</span>`}`;
}

// This robot, those that stand out most, and the rest by how far they are off, in their own order.
const most_siblings = 12;
function chosen_of(siblings, id) {
  const off = (s) => (s.robot_id === id ? Infinity : (s.stands_out ? 1 : 0) + Math.min(0.9, Math.abs(s.ratio - 1)));
  const kept = new Set([...siblings].sort((a, b) => off(b) - off(a)).slice(0, most_siblings));
  return siblings.filter((s) => kept.has(s));
}

function Siblings({ siblings, id }) {
  const [whole, set_whole] = useState(false);
  const here = siblings.some((s) => s.robot_id === id);
  if (siblings.length <= (here ? 1 : 0)) return html`<${Empty} title="No other robot of this kind has missions yet" />`;
  const off = Math.max(0.02, ...siblings.flatMap((s) => [Math.abs(s.ci[0] - 1), Math.abs(s.ci[1] - 1)]).filter((v) => Number.isFinite(v)));
  const at = (v) => `${50 + 50 * Math.max(-1, Math.min(1, (v - 1) / off))}%`;
  const some = whole || siblings.length <= most_siblings ? siblings : chosen_of(siblings, id);
  return html`<table class="bars siblings"><thead class="hidden"><tr><th>Robot</th><th>Ratio</th><th></th></tr></thead><tbody>${some.map((s) => html`<tr key=${s.robot_id} class=${s.robot_id === id ? 'this' : ''}>
    <th scope="row">${s.robot_id === id ? html`<b>${id}</b>` : html`<a href=${robot_link(s.robot_id)}>${s.robot_id}</a>`}${s.stands_out && html` <span class="flag">stands out</span>`}</th>
    <td class="bar-cell"><svg width="100%" height="16" aria-hidden="true"><line x1="50%" x2="50%" y1="0" y2="16" class="one" /><line x1=${at(s.ci[0])} x2=${at(s.ci[1])} y1="8" y2="8" class="whisker" /><circle cx=${at(s.ratio)} cy="8" r="4" class=${s.stands_out ? 'out' : ''} /></svg></td>
    <td class="figure">${format.fixed(s.ratio, 3)}</td></tr>`)}</tbody></table>
    <p class="note foot">Median of measured over modelled energy of each robot's newest missions, with its 95 % interval; the line is 1.${!here && ` ${id} has not driven enough under its model in force.`}</p>
    ${siblings.length > most_siblings && html`<button type="button" aria-expanded=${String(whole)} onClick=${() => set_whole(!whole)}>${whole ? 'Show fewer' : `Show all ${siblings.length}`}</button>`}`;
}

export function RobotHistory({ id }) {
  const told = useGet(`/v1/robots/${id_path(id)}/gap-history?limit=500`);
  const versions = useGet(`/v1/robots/${id_path(id)}/versions`);
  const jobs = useGet(`/v1/diagnoses${query({ robot_id: id, limit: 5 })}`);
  const changed = () => {
    told.reload();
    versions.reload();
  };
  if (versions.error?.status === 404) return html`<${Panel} title="Model versions"><${Empty} title="No model">Put a robot file to <code>/v1/robots/${id}</code> to have its energy modelled.<//><//>`;
  return html`<div class="columns">
      <${Panel} class="screen" title="Measured over modelled energy" aside=${html`<a href=${`#/gap${query({ robot: id })}`}>Diagnose the gap</a>`}><${Answer} of=${told} what="the history">${(h) => html`<${RatioChart} told=${h} />`}<//><//>
      <${Panel} title="Robots of this kind"><${Answer} of=${told} what="robots of this kind">${(h) => html`<${Siblings} siblings=${h.siblings} id=${id} />`}<//><//>
    </div>
    <div class="columns">
      <${Panel} title="Model versions"><${Answer} of=${versions} what="versions">${(v) => html`<${Versions} versions=${v.versions} robot=${id} onChange=${changed} />`}<//><//>
      <${Panel} title="Diagnoses" aside=${html`<a href=${`#/gap${query({ robot: id })}`}>All of ${id}</a>`}><${Answer} of=${jobs} what="diagnoses">${(j) => (j.diagnoses.length === 0 ? html`<${Empty} title="No diagnosis yet" />` : html`<div class="scroll"><${JobRows} jobs=${j.diagnoses} with_robot=${false} /></div>`)}<//><//>
    </div>`;
}
