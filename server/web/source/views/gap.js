// Diagnoses of the gap: start one, follow it, read what it found, adopt it. Loaded when first asked for.
import { useEffect, useState } from 'preact/hooks';
import { html } from '../html.js';
import * as format from '../format.js';
import { del, post, query, useGet } from '../api.js';
import { useLive } from '../live.js';
import { mission_link, robot_link } from '../route.js';
import { Answer, Empty, Failure, Panel, Quantity, Readout, useOptions, useTitleOf } from '../widgets.js';
import { JobRows, State, share, state_notes, verdicts } from './jobs.js';

export { RobotHistory } from './robot_history.js';

const ended = (d) => d.state !== 'queued' && d.state !== 'running';
const range_of = (ci, places = 1) => (ci && format.known(ci[0]) ? `${share(ci[0], places)} to ${share(ci[1], places)}` : '–');

// Follows a job that waits or runs; `onEnd` when it has ended.
function useProgress(job, onEnd) {
  const [told, set_told] = useState(null);
  const id = job && !ended(job) ? job.id : null;
  useEffect(() => {
    if (id === null) return undefined;
    const source = new EventSource(`/v1/diagnoses/${id}/events`);
    source.addEventListener('progress', (event) => set_told(JSON.parse(event.data)));
    source.addEventListener('ended', () => {
      source.close();
      onEnd();
    });
    return () => source.close();
  }, [id]);
  return told !== null && told.id === id ? told : job;
}

function Progress({ job, onEnd }) {
  const now = useProgress(job, onEnd);
  const [error, set_error] = useState(null);
  const part = Math.round(100 * now.progress);
  const words = now.state === 'queued' ? (now.ahead > 0 ? `${now.ahead} before it` : 'about to begin') : `${part} %`;
  return html`<div class="progress"><label for="progress">Diagnosis ${job.id} of ${job.robot_id}: ${state_notes[now.state]}, ${words}</label>
    <progress id="progress" max="100" value=${now.state === 'queued' ? undefined : part}></progress>
    <button type="button" onClick=${() => del(`/v1/diagnoses/${job.id}`).catch(set_error)}>Cancel</button>
    ${error && html`<${Failure} error=${error} />`}</div>`;
}

function Start({ given, onStart }) {
  const live = useLive();
  const robots = [...live.robots.values()].filter((r) => r.state.has_model).map((r) => r.id).sort();
  const [robot, set_robot] = useState(given.robot ?? '');
  const [missions, set_missions] = useState('50');
  const [busy, set_busy] = useState(false);
  const [error, set_error] = useState(null);
  const newest = useGet('/v1/missions?state=finished&limit=200');
  const lately = new Set(newest.value?.missions.map((m) => m.robot_id));
  const driven = robots.filter((id) => lately.has(id)), others = robots.filter((id) => !lately.has(id));
  const of_driven = useOptions(driven), of_others = useOptions(others);
  const chosen = robot || (newest.loading ? '' : driven[0] ?? robots[0] ?? '');
  const past = useGet(chosen && `/v1/mission-totals${query({ robot_id: chosen, state: 'finished' })}`);
  const count = chosen && past.value !== null && !past.loading ? past.value.missions : null;
  const start = async (event) => {
    event.preventDefault();
    set_busy(true);
    set_error(null);
    try {
      const job = await post('/v1/diagnoses', { robot_id: chosen, max_missions: Number(missions) });
      onStart(job);
    } catch (problem) {
      set_error(problem);
    }
    set_busy(false);
  };
  if (live.loaded && robots.length === 0) return html`<${Empty} title="No robot has a model yet">A gap is what is measured against a model: put a robot file to <code>/v1/robots/…</code>.<//>`;
  return html`<form class="filters" onSubmit=${start}>
    <label class="field"><span>Robot</span><select value=${chosen} onChange=${(e) => set_robot(e.currentTarget.value)}>${[[driven, of_driven, 'Drove lately'], [others, of_others, 'Others']].map(([ids, options, name]) => ids.length > 0 && html`<optgroup key=${name} label=${name}>${options}</optgroup>`)}</select></label>
    <label class="field"><span>Missions, newest</span><input class="short" type="number" min="1" max="1000" required value=${missions} onInput=${(e) => set_missions(e.currentTarget.value)} /></label>
    <button type="submit" class="primary" disabled=${busy || !count}>Diagnose</button>
    <p class="note" role="status">${count === 0 ? html`${chosen} has no finished mission yet: there is nothing to diagnose.` : html`${count !== null && `${format.fixed(count)} finished ${count === 1 ? 'mission' : 'missions'}. `}Every fourth is held back to test what is found.`}</p>
    ${error && html`<${Failure} error=${error} />`}</form>`;
}

function All({ given }) {
  useTitleOf('Gap');
  const jobs = useGet(`/v1/diagnoses${query({ robot_id: given.robot, limit: 50 })}`);
  const running = jobs.value?.diagnoses.find((d) => d.state === 'running') ?? jobs.value?.diagnoses.findLast?.((d) => d.state === 'queued');
  return html`<div class="heading"><h1>Gap between robot and model</h1></div>
    <${Start} given=${given} onStart=${(job) => { location.hash = `#/gap/${job.id}`; }} />
    ${running && html`<${Progress} key=${running.id} job=${running} onEnd=${jobs.reload} />`}
    <${Panel} title=${given.robot ? `Diagnoses of ${given.robot}` : 'Diagnoses'} aside=${given.robot && html`<a href="#/gap">All robots</a>`}><${Answer} of=${jobs} what="diagnoses">${(told) =>
      told.diagnoses.length === 0 ? html`<${Empty} title="No diagnosis yet">A diagnosis says where measured power leaves the model, and which effect is missing.<//>`
        : html`<div class="scroll"><${JobRows} jobs=${told.diagnoses} /></div>`}<//><//>`;
}

const channels = { battery_power: 'battery power', wheel_torque: 'wheel torque', motor_voltage: 'motor voltage', battery_voltage: 'battery voltage' };
const suffixes = [['_m_s2', 'm/s²'], ['_rad_s', 'rad/s'], ['_m_s', 'm/s'], ['_kg', 'kg'], ['_rad', 'rad'], ['_s', 's'], ['_m', 'm'], ['_w', 'W']];

// "speed_m_s" -> ["speed", "m/s"]
function unit_of(name) {
  const [suffix, unit] = suffixes.find(([s]) => name.endsWith(s)) ?? ['', ''];
  return [name.slice(0, name.length - suffix.length), unit];
}

const in_degrees = (rad) => `${format.digits(rad * 180 / Math.PI)}°`;

// A ratio changes what the model has by a part of it; the others stand in their unit.
function strength(name, { value, sd, unit }) {
  if (name !== 'ratio') return `${format.with_deviation(value, sd)}${unit === '1' ? '' : ` ${unit}`}${unit === 'rad' ? ` (${in_degrees(value)})` : ''}`;
  return `${value < 0 ? '' : '+'}${format.with_deviation(100 * value, format.known(sd) ? 100 * sd : sd)} %`;
}

// "speed_m_s" from 0.2 to 0.4 -> ["speed", "0.2 to 0.4 m/s"]
function region(w) {
  const [plain, unit] = unit_of(w.variable), name = format.words(plain);
  if (typeof w.from === 'string') return [name, w.from];
  const angle = unit.startsWith('rad') ? ` (${in_degrees(w.from)} to ${in_degrees(w.to)}${unit.slice(3)})` : '';
  return [name, `${format.range(w.from, w.to)}${unit && ` ${unit}`}${angle}`];
}

function Where({ regions }) {
  if (regions.length === 0) return html`<${Empty} title="Nowhere in particular" />`;
  const shown = regions.slice(0, 12), most = Math.max(...shown.map((w) => Math.max(Math.abs(w.share), Math.abs(w.ci[1] ?? 0))));
  return html`<table class="bars where"><thead class="hidden"><tr><th>Where</th><th>Share</th><th></th></tr></thead><tbody>${shown.map((w, k) => html`<tr key=${k}>
    <th scope="row">${channels[w.channel] ?? format.words(w.channel)} <span class="note">${region(w)[0]}</span> ${region(w)[1]}</th>
    <td class="bar-cell"><svg width="100%" height="16" aria-hidden="true"><rect x="0" y="3" height="10" width=${`${Math.max(0.5, 100 * Math.abs(w.share) / most)}%`} class=${`account ${w.share < 0 ? 'back' : 'unexplained-plain'}`} />
      <line x1=${`${100 * Math.max(0, Math.min(Math.abs(w.ci[0]), Math.abs(w.ci[1]))) / most}%`} x2=${`${Math.min(100, 100 * Math.max(Math.abs(w.ci[0]), Math.abs(w.ci[1])) / most)}%`} y1="8" y2="8" class="whisker" /></svg></td>
    <td class="figure">${format.signed(share(w.share, 0))}</td></tr>`)}</tbody></table>
    <p class="note foot">Share of the integral of |measured − modelled| power; line: 95 % interval, widened for the number of regions looked at. Regions overlap.</p>`;
}

const named = (id) => (id.startsWith('covariate:') ? `covariate ${format.words(id.slice(10))}` : format.words(id));
const surrogates = (controls) => (controls ? `${controls.named_in} of ${controls.surrogates}` : '–');

function Effects({ effects }) {
  return html`<table class="grid effects"><thead><tr><th scope="col">Effect</th><th scope="col" class="figure">Probability</th><th scope="col">Strength</th><th scope="col" class="figure">Closes of the gap</th><th scope="col" class="figure">In surrogates</th><th scope="col">Cannot be told from</th></tr></thead>
    <tbody>${effects.map((e) => html`<tr key=${e.id}><th scope="row">${named(e.id)}${e.workshop && html`<span class="note check">check: ${e.workshop}</span>`}</th><td class="figure">${share(e.probability, 0)}</td>
      <td>${Object.entries(e.parameters).map(([name, p]) => html`<div key=${name}><span class="note">${name === 'ratio' ? 'by' : format.words(unit_of(name)[0])}</span> ${strength(name, p)}</div>`)}</td>
      <td class="figure">${share(e.share, 0)}</td><td class="figure">${surrogates(e.controls)}</td><td>${e.alternatives.map(named).join(', ') || '–'}</td></tr>`)}</tbody></table>`;
}

function Checks({ checks }) {
  return html`<${Panel} title="What is wrong with the recordings"><ul class="reasons">${checks.map((c, k) => html`<li key=${k}>${c.says}${c.contradicted && html` <b>It takes no part in what follows.</b>`}</li>`)}</ul><//>`;
}

// The plain regression beside what was found, on the same parts left out.
function Referee({ of }) {
  const rows = [['A plain regression', of.held_out], ['What is found here', of.explanation_held_out], ['The robot file', of.unchanged_model_held_out]];
  const most = Math.max(...rows.map(([, v]) => v ?? 0), 1e-9);
  return html`<${Panel} title="Beside a plain regression" aside=${of.wins && html`<b>It is not beaten</b>`}><table class="bars referee"><tbody>${rows.map(([name, v]) => html`<tr key=${name}><th scope="row">${name} misses</th>
    <td class="bar-cell"><svg width="100%" height="12" aria-hidden="true"><rect height="8" y="2" width=${`${Math.max(0.5, 100 * (v ?? 0) / most)}%`} class="account plain" /></svg></td><td class="figure">${share(v)}</td></tr>`)}</tbody></table>
    ${of.says.length > 0 && html`<ul class="reasons">${of.says.map((says) => html`<li key=${says}>${says}</li>`)}</ul>`}
    <p class="note foot">Of the power, on parts that had no part in the fit.</p><//>`;
}

function Corrections({ of }) {
  return html`<${Panel} title="What would fit in the robot file"><div class="scroll" tabindex="0"><table class="grid effects"><thead><tr><th scope="col">Parameter</th><th scope="col" class="figure">In the file</th><th scope="col" class="figure">Would fit</th></tr></thead>
    <tbody>${of.map((c) => html`<tr key=${c.parameter}><th scope="row">${c.parameter}</th><td class="figure">${format.digits(c.file)}</td><td class="figure">${format.with_deviation(c.fits, c.sd)}</td></tr>`)}</tbody></table></div><//>`;
}

function TestTable({ test }) {
  const most = Math.max(0.01, ...test.missions.flatMap((m) => [Math.abs(m.before.relative), Math.abs(m.after.relative)]));
  const bar = (error, name) => html`<svg width="100%" height="12" aria-hidden="true"><rect height="8" y="2" width=${`${Math.max(0.5, 100 * Math.abs(error.relative) / most)}%`} class=${`account ${name}`} /></svg>`;
  return html`<table class="grid test"><thead><tr><th scope="col">Mission</th><th scope="col" class="figure">Measured</th><th scope="col" class="figure">Error before</th><th scope="col" class="wide"></th><th scope="col" class="figure">Error after</th><th scope="col" class="wide"></th></tr></thead>
    <tbody>${test.missions.map((m) => html`<tr key=${m.id}><th scope="row"><a href=${mission_link(m.id)}>${m.mission_id}</a>${m.basis === 'motors' && html` <span class="note">at the motors</span>`}</th>
      <td class="figure"><${Quantity} of=${format.energy(m.measured_j)} /></td>
      <td class="figure" title=${range_of(m.before.ci)}>${format.signed(share(m.before.relative))}</td><td class="wide bar-cell">${bar(m.before, 'plain')}</td>
      <td class="figure" title=${range_of(m.after.ci)}>${format.signed(share(m.after.relative))}</td><td class="wide bar-cell">${bar(m.after, 'modelled')}</td></tr>`)}</tbody></table>`;
}

function BackTest({ test }) {
  if (test.missions.length === 0) return html`<p>There is no mission to test it on: none with stored telemetry and measured energy that it was not fitted on.</p>`;
  const left = [[test.left_out.fitted_on, 'it was found on'], [test.left_out.open, 'still running'], [test.left_out.no_telemetry, 'without telemetry'], [test.left_out.beyond_limits, 'beyond the limits']].filter(([n]) => n > 0).map(([n, why]) => `${n} ${why}`).join(', ');
  return html`<div class=${`verdict-box ${test.improves ? 'makes' : 'fails'}`}><p class="verdict">On ${test.missions.length} missions that it was not found on, the energy error ${test.error_after < test.error_before ? 'falls' : 'goes'} from <b>${share(test.error_before, 2)}</b> to <b>${share(test.error_after, 2)}</b>.</p>
    <p class="note">Improvement ${range_of(test.improvement_ci, 2)} (95 %); power gap ${share(test.power_gap_before, 2)} to ${share(test.power_gap_after, 2)}, falls by ${range_of(test.power_gap_fall_ci, 2)}; against model version ${test.tested_against}.${left && ` Left out: ${left}.`}</p></div>
    <div class="scroll" tabindex="0"><${TestTable} test=${test} /></div>`;
}

// One of several effects that the data do not tell apart.
function ChooseEffect({ of, value, onChange }) {
  const ids = [of.id, ...of.instead.filter((e) => Object.keys(e.parameters).length > 0).map((e) => e.id)];
  return html`<label class="field"><span>Which of those not told apart</span><select value=${value} onChange=${(e) => onChange(e.currentTarget.value)}>
    <option value="">choose one</option>${ids.map((id) => html`<option key=${id} value=${id}>${named(id)}</option>`)}</select></label>`;
}

function Adopt({ job }) {
  const offer = job.result.adoption, groups = offer?.effects.filter((e) => e.instead.length > 0) ?? [];
  const refusal = offer && !offer.choice_settles ? offer.refusal : null;
  const [chosen, set_chosen] = useState({});
  const effect = groups.map((g) => chosen[g.id] ?? ''), open = effect.includes('');
  const [told, set_told] = useState({ test: null, error: null, busy: '', adopted: null });
  const ask = async (doing, body) => {
    set_told((t) => ({ ...t, busy: doing, error: null }));
    try {
      const answer = await post(`/v1/robots/${encodeURIComponent(job.robot_id)}/model`, { diagnosis_id: job.id, ...(effect.length > 0 && { effect }), ...body });
      set_told((t) => ({ test: answer.back_test, error: null, busy: '', adopted: answer.adopted ? answer.model_version : t.adopted }));
    } catch (error) {
      set_told((t) => ({ ...t, test: error.told?.back_test ?? t.test, error, busy: '' }));
    }
  };
  const { test, error, busy, adopted } = told, refused = error?.status === 409 && error.told?.back_test != null;
  const hold = busy !== '' || open;
  return html`${adopted !== null && html`<p class="adopted" role="status">Version ${adopted} is in force for <a href=${robot_link(job.robot_id)}>${job.robot_id}</a>: planning and autonomy use it now, the meter from the next mission on.</p>`}
    ${refusal && html`<p class="failure"><b>Not to be adopted:</b> ${refusal}.</p>`}
    ${test && html`<${BackTest} test=${test} />`}
    ${refused ? html`<p class="failure" role="alert"><b>Not adopted:</b> it does not bring the model closer on these missions.</p>` : error && html`<${Failure} error=${error} />`}
    ${adopted === null && html`<div class="tools adopt">
      ${groups.map((g) => html`<${ChooseEffect} key=${g.id} of=${g} value=${chosen[g.id] ?? ''} onChange=${(id) => set_chosen((c) => ({ ...c, [g.id]: id }))} />`)}
      <button type="button" disabled=${hold} onClick=${() => ask('test', { dry_run: true })}>${busy === 'test' ? 'Testing …' : test ? 'Test again' : 'Test on other missions'}</button>
      ${!refusal && html`<button type="button" class="primary" disabled=${hold} onClick=${() => ask('adopt', {})}>${busy === 'adopt' ? 'Testing and adopting …' : 'Adopt'}</button>`}
      ${(refused || refusal) && html`<button type="button" disabled=${hold} onClick=${() => ask('adopt', { force: true })}>Adopt all the same</button>`}
      <span class="note">Adopting makes the next model version, after a test on missions that this was not found on.</span></div>`}`;
}

function Result({ job }) {
  const r = job.result, [name, words] = verdicts[r.verdict] ?? [r.verdict, ''];
  const s = r.shrinkage, something = r.adoption ? r.adoption.effects.length > 0 : job.model !== null;
  return html`${r.checks?.length > 0 && html`<${Checks} checks=${r.checks} />`}<div class=${`verdict-box ${r.verdict === 'none' || r.verdict === 'effects' ? '' : 'fails'}`}><p class="verdict"><b>${name}</b>${r.effects.length > 0 && html`${r.verdict === 'effects' ? ':' : '; likeliest'} ${r.effects.map((e) => named(e.id)).join(', ')}`}</p><p class="note">${words}</p>${r.reasons?.length > 0 && html`<ul class="reasons">${r.reasons.map((reason) => html`<li key=${reason}>${reason}</li>`)}</ul>`}</div>
    <dl class="readouts">
      <${Readout} large label="Gap in power" of=${format.percent(r.gap.power_absolute_relative, 1)} note=${`noise ${share(r.gap.noise_floor)}`} />
      <${Readout} large label="Gap in energy" of=${format.percent(r.gap.energy_relative, 1)} />
      ${r.effects.length > 0 && html`<${Readout} large label="Held out, with it" of=${format.percent(s.held_out_after, 1)} note=${`from ${share(s.held_out_before)}`} />
        <${Readout} large label="Gap shrinks by" of=${format.percent(s.fraction, 0)} note=${range_of(s.ci, 0)} />`}
      <${Readout} large label="Missions" of=${`${r.missions}`} note=${`${format.fixed(r.samples)} samples`} />
    </dl>
    ${r.effects.length > 0 && html`<${Panel} title="Which effect"><div class="scroll" tabindex="0"><${Effects} effects=${r.effects} /></div><//>`}
    ${r.baseline && html`<${Referee} of=${r.baseline} />`}
    ${r.corrections?.length > 0 && html`<${Corrections} of=${r.corrections} />`}
    <div class="columns"><${Panel} title="Where measured power leaves the model"><${Where} regions=${r.where} /><//>
      <${Panel} title="What to drive next">${r.next_drive.length === 0 ? html`<${Empty} title=${r.verdict === 'effects' || r.verdict === 'none' ? 'Nothing more is needed' : 'No drive would tell more'} />`
        : html`<ol class="next">${r.next_drive.map((n, k) => html`<li key=${k}><b>${n.manoeuvre}</b> <span class="note">to tell ${format.words(n.separates)}</span></li>`)}</ol>`}<//></div>
    <${Panel} title="Adopt">${!something ? html`<${Empty} title="Nothing to adopt" />` : html`<${Adopt} job=${job} />`}<//>`;
}

function One({ id }) {
  useTitleOf(`Diagnosis ${id}`);
  const job = useGet(`/v1/diagnoses/${encodeURIComponent(id)}`);
  if (job.value === null && [400, 404].includes(job.error?.status)) return html`<${Empty} title=${`There is no diagnosis ${id}`}>See <a href="#/gap">all diagnoses</a>.<//>`;
  return html`<${Answer} of=${job} what="the diagnosis">${(d) => html`
    <div class="heading"><p class="crumbs"><a href="#/gap">Gap</a></p><h1>Diagnosis ${d.id}</h1><span><a href=${robot_link(d.robot_id)}>${d.robot_id}</a></span> <${State} of=${d} />
      <span class="note">${format.time(d.created_utime_us)}${d.model_version !== null && ` · model version ${d.model_version}`}</span><span class="spring"></span>
      ${d.state === 'done' && html`<a class="button" href=${`/v1/diagnoses/${d.id}/report`} target="_blank" rel="noopener">Whole report</a>`}</div>
    ${!ended(d) && html`<${Progress} key=${d.id} job=${d} onEnd=${job.reload} />`}
    ${d.error && html`<div class="failure" role="alert"><p class="empty-title">${state_notes[d.state]}</p><p>${d.error}</p></div>`}
    ${d.result && html`<${Result} job=${d} />`}`}<//>`;
}

export function Gap({ id, given }) {
  return id ? html`<${One} id=${id} />` : html`<${All} given=${given} />`;
}
