import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import { html } from '../html.js';
import * as format from '../format.js';
import { id_path, post } from '../api.js';
import { Bars } from '../bars.js';
import { Chart, axis, with_alpha } from '../chart.js';
import { leg_kinds, new_leg, path_of_points, points_of_legs, segment_of } from '../drive_path.js';
import { FloorPath } from '../floor.js';
import { useLive } from '../live.js';
import { keep_in_address } from '../route.js';
import { palette } from '../theme.js';
import { Choice, Empty, Failure, Loading, Panel, Readout, useOptions, useTitleOf } from '../widgets.js';
import { Waterfall } from '../waterfall.js';
import { DrawPath } from './draw.js';

const front_points = 24;
const first_legs = () => [{ kind: 'straight', length: 6 }, { kind: 'turn', angle: 90 }, { kind: 'straight', length: 4 }];

function Legs({ legs, change, fault }) {
  const set = (k, part) => change(legs.map((leg, at) => (at === k ? { ...leg, ...part } : leg)));
  const swap = (k, by) => {
    const next = [...legs];
    [next[k], next[k + by]] = [next[k + by], next[k]];
    change(next);
  };
  return html`<fieldset class="legs"><legend>Legs</legend><ol>
    ${legs.map((leg, k) => html`<li key=${k} class=${fault === k ? 'faulty' : ''}>
      <select aria-label=${`Kind of leg ${k + 1}`} value=${leg.kind} onChange=${(e) => change(legs.map((old, at) => (at === k ? new_leg(e.currentTarget.value) : old)))}>
        ${Object.entries(leg_kinds).map(([kind, { name }]) => html`<option key=${kind} value=${kind}>${name}</option>`)}</select>
      <span class="leg-fields">${Object.entries(leg_kinds[leg.kind].fields).map(([key, field]) => html`<label key=${key} class="inline"><span class="hidden">${`Leg ${k + 1}, ${field.label}`}</span>
        <input type="number" step="any" min=${field.min} required title=${field.label} value=${leg[key]} onInput=${(e) => set(k, { [key]: e.currentTarget.valueAsNumber })} /><span class="unit">${field.unit}</span></label>`)}</span>
      <span class="leg-tools"><button type="button" class="plain" disabled=${k === 0} aria-label=${`Move leg ${k + 1} up`} onClick=${() => swap(k, -1)}>↑</button>
      <button type="button" class="plain" disabled=${k === legs.length - 1} aria-label=${`Move leg ${k + 1} down`} onClick=${() => swap(k, 1)}>↓</button>
      <button type="button" class="plain" disabled=${legs.length === 1} aria-label=${`Remove leg ${k + 1}`} onClick=${() => change(legs.filter((_, at) => at !== k))}>×</button></span></li>`)}
  </ol><button type="button" onClick=${() => change([...legs, new_leg('straight')])}>Add a leg</button></fieldset>`;
}

// `column` of a profile at other times, straight between its own; nothing where there is no such profile.
function at_times(time_s, profile, column) {
  if (!profile) return time_s.map(() => null);
  const own = profile.time_s, values = profile[column];
  let k = 1;
  return time_s.map((t) => {
    while (k < own.length - 1 && own[k] < t) k += 1;
    const part = own[k] > own[k - 1] ? Math.max(0, Math.min(1, (t - own[k - 1]) / (own[k] - own[k - 1]))) : 1;
    return values[k - 1] + part * (values[k] - values[k - 1]);
  });
}

function SpeedChart({ answer }) {
  const p = answer.profile, turns = p.yaw_rate_rad_s.some((v) => Math.abs(v) > 1e-6);
  const { trapezoid, triangle } = answer.baselines;
  const data = useMemo(() => [p.time_s, p.speed_m_s, at_times(p.time_s, trapezoid?.profile, 'speed_m_s'), at_times(p.time_s, triangle?.profile, 'speed_m_s'),
    turns ? p.yaw_rate_rad_s : p.time_s.map(() => null)], [answer]);
  const power = useMemo(() => [p.time_s, p.power_w], [answer]);
  const cursor = { sync: { key: 'plan' }, drag: { x: false, y: false } };
  const make = () => {
    const c = palette(), dots = { show: false };
    return {
      cursor, scales: { x: { time: false }, yaw: {} },
      axes: [axis('', { size: 28 }), axis('speed, m/s'), ...(turns ? [axis('yaw rate, rad/s', { scale: 'yaw', side: 1, grid: { show: false } })] : [])],
      series: [{}, { stroke: c.accent, width: 2.25, points: dots }, { stroke: c.muted, width: 1.25, dash: [6, 4], points: dots }, { stroke: c.muted, width: 1.25, dash: [2, 3], points: dots },
        { stroke: c.modelled, width: 1.25, scale: turns ? 'yaw' : 'y', points: dots }],
    };
  };
  const make_power = () => {
    const c = palette();
    return { cursor, scales: { x: { time: false } }, axes: [axis('time, s', { size: 28 }), axis('power, W'), ...(turns ? [axis(' ', { scale: 'y', side: 1, grid: { show: false }, ticks: { show: false }, values: () => [] })] : [])],
      series: [{}, { stroke: c.accent, width: 1.75, fill: with_alpha(c.accent, 0.12), points: { show: false } }] };
  };
  return html`
    <${Chart} make=${make} data=${data} height=${210} changes=${[turns]} label=${`Speed over ${format.span(answer.duration_s)}, greatest ${format.fixed(answer.peak_speed_m_s, 2)} metres a second`} />
    <${Chart} make=${make_power} data=${power} height=${150} changes=${[turns]} label="Battery power of the optimal profile over time" />
    <p class="note foot"><span class="swatch accent"></span>least energy ${turns && html`<span class="swatch modelled"></span>yaw rate `}<span class="swatch dashed"></span>trapezoid <span class="swatch dotted"></span>triangle</p>`;
}

function Front({ answer, take }) {
  const front = answer.pareto;
  const { trapezoid, triangle } = answer.baselines;
  const data = useMemo(() => {
    // One row a duration, in order; a column of energies for each kind of point.
    const kinds = [front, [answer], [trapezoid], [triangle]].map((points) => new Map(points.filter(Boolean).map((point) => [point.duration_s, point.energy_j])));
    const times = [...new Set(kinds.flatMap((kind) => [...kind.keys()]))].sort((a, b) => a - b);
    return [times, ...kinds.map((kind) => times.map((t) => kind.get(t) ?? null))];
  }, [answer]);
  const make = () => {
    const c = palette(), dot = (colour, size, fill) => ({ stroke: 'transparent', paths: () => null, points: { show: true, size, width: 2, stroke: colour, fill } });
    return {
      scales: { x: { time: false } }, cursor: { y: false, drag: { x: false, y: false }, points: { show: false } },
      axes: [axis('duration, s', { size: 28, space: 70 }), axis('energy, J', { size: 58 })],
      series: [{}, { stroke: c.modelled, width: 1.5, spanGaps: true, points: { show: true, size: 5, fill: c.modelled } }, dot(c.accent, 12, c.accent), dot(c.muted, 9, c.screen), dot(c.muted, 9, c.muted)],
    };
  };
  const [at, set_at] = useState(0);
  const point = front[Math.min(at, front.length - 1)];
  return html`<${Chart} make=${make} data=${data} height=${230} changes=${[]} label=${`Energy against duration, from ${format.span(front[0].duration_s)} to ${format.span(front[front.length - 1].duration_s)}`} />
    <p class="note foot"><span class="swatch accent dot"></span>this plan <span class="swatch hollow dot grey"></span>trapezoid <span class="swatch grey dot"></span>triangle <span class="swatch modelled"></span>front</p>
    <div class="front-pick"><label><span>Walk the front</span><input type="range" min="0" max=${front.length - 1} value=${at} onInput=${(e) => set_at(e.currentTarget.valueAsNumber)} aria-valuetext=${`${format.span(point.duration_s)}, ${format.text(format.energy(point.energy_j))}`} /></label>
      <span><span class="number">${format.fixed(point.duration_s, 2)} s · ${format.text(format.energy(point.energy_j, 4))}</span>; ${haste(point, answer.certificate.shortest_time_s)}</span>
      <button type="button" onClick=${() => take(point)}>Take as deadline</button></div>`;
}

// Energies near nothing: how small they are is what matters.
const little = (joule) => (joule !== 0 && Math.abs(joule) < 0.005 ? 'less than 0.01\u00a0J' : format.text(format.energy(joule)));

// What less time would cost, where the robot can be faster at all.
function haste({ duration_s, time_multiplier_w: price_w }, shortest_s) {
  if (duration_s <= shortest_s * 1.001) return 'no faster time is possible: the robot is at its limits';
  if (!(price_w >= 0.005)) return 'the cheapest time';
  return duration_s - shortest_s < 1 ? `less time costs ${format.text(format.energy(price_w))} a second or more` : `a second less costs ${format.text(format.energy(price_w))} or more`;
}

const methods = { closed_form: 'formulas', quadrature: 'quadrature', interior_point: 'an interior-point method', mixed: 'several methods' };

// What is saved against a usual profile; one that breaks the limits is no choice, and may cost less.
function against(baseline) {
  if (!baseline) return 'not possible here';
  const saved = baseline.saving_fraction, by = format.text(format.percent(Math.abs(saved), 1));
  if (!baseline.within_limits) return `breaks the limits, and costs ${by} ${saved >= 0 ? 'more' : 'less'}`;
  return saved >= 0 ? `we save ${by}` : `costs ${by} less`;
}

function Certificate({ answer }) {
  const c = answer.certificate;
  const row = (name, value) => html`<tr><th scope="row">${name}</th><td>${value}</td></tr>`;
  return html`<table class="facts"><tbody>
    ${row('Found by', methods[c.method] ?? format.words(c.method))}
    ${row('At most above the optimum', little(c.gap_j))}
    ${row('Error of the time steps', little(c.discretisation_j))}
    ${row('A global optimum', c.convex ? 'yes: the problem is convex' : 'not proven: the problem is not convex')}
    ${row('In less time', haste({ ...answer, ...c }, c.shortest_time_s))}
    ${row('Shortest time', format.known(c.shortest_time_s) ? `${format.fixed(c.shortest_time_s, 2)} s, by the robot's limits` : 'not bounded')}
    ${row('Limits met', c.binding.length === 0 ? 'none' : c.binding.map(format.words).join(', '))}
    ${row('Braking', `${format.text(format.energy(answer.braking_j))}, of which ${format.text(format.energy(answer.recovered_j))} returns`)}
    ${row('Peak power', format.text(format.power(answer.peak_power_w)))}
    ${row('Model', `version ${answer.model_version}`)}
  </tbody></table>`;
}

// How likely, as far as it means something.
function chance(p) {
  if (p > 0.999) return 'more than 99.9\u00a0%';
  if (p < 0.001) return 'less than 0.1\u00a0%';
  return format.text(format.percent(p, p > 0.99 || p < 0.01 ? 1 : 0));
}

const verdicts = [[0.95, 'The robot makes it', 'makes'], [0.5, 'The robot probably makes it', 'maybe'], [0.05, 'The robot probably does not make it', 'fails'], [-1, 'The robot does not make it', 'fails']];

const bases = {
  recent_missions: ({ missions }) => `its ${missions === 1 ? 'last mission' : `last ${missions} missions`}`,
  siblings: ({ siblings }) => `missions of ${siblings} ${siblings === 1 ? 'robot' : 'robots'} of its kind`,
  model: () => 'its model alone: no mission has shown yet how far that is off',
};

function Verdict({ answer, autonomy }) {
  if (autonomy.error !== null) return html`<${Failure} error=${autonomy.error} />`;
  if (autonomy.value === null) return autonomy.busy ? html`<p class="verdict open">Reckoning the chance to make it …</p>`
    : html`<p class="verdict open">The robot has not told its charge: enter it to see how likely the robot makes it.</p>`;
  const a = autonomy.value, { plan: usual, minimum_energy: planned } = a, reserve = format.text(format.percent(a.reserve_fraction));
  const drives = [planned && { name: 'Driven as planned here', arrival: planned.arrival_charge, ...planned },
    { name: `Driven as ${a.consumption.missions > 0 ? 'it usually drives' : 'robots usually drive'}`, arrival: usual.legs[0].arrival_charge, ...usual }].filter(Boolean);
  const [, words, name] = verdicts.find(([least]) => drives[0].success_probability >= least);
  const times = drives[0].expected_energy_j > 0 ? Math.floor(a.usable_energy_j / drives[0].expected_energy_j) : null;
  const percent = (share) => format.text(format.percent(share, 1));
  return html`<div class=${`verdict-box ${name}`}>
    <p class="verdict"><b>${words}</b>: ${chance(drives[0].success_probability)} chance to finish with its reserve of ${reserve} left.</p>
    <div class="scroll"><table class="chances"><thead><tr><th scope="col"><span class="hidden">How it is driven</span></th><th scope="col">Chance</th><th scope="col" title="mean of the forecast">Energy</th><th scope="col">Takes</th><th scope="col" title="nine times of ten within the span">Charge on arrival</th></tr></thead>
      <tbody>${drives.map((drive) => html`<tr key=${drive.name}><th scope="row">${drive.name}</th><td class="number">${chance(drive.success_probability)}</td><td class="number">${format.text(format.energy(drive.expected_energy_j))}</td><td class="number">${format.about(drive.duration_s)}</td>
        <td class="number">${percent(drive.arrival.p50)}${percent(drive.arrival.p05) !== percent(drive.arrival.p95) && html` <span class="note">nine times of ten ${percent(drive.arrival.p05)} to ${percent(drive.arrival.p95)}</span>`}</td></tr>`)}</tbody></table></div>
    <p class="note">Starts with ${percent(a.state_of_charge)}${a.state_of_charge_sd > 0.0005 ? ` ± ${percent(a.state_of_charge_sd)}` : ''} charge, ${format.text(format.energy(a.usable_energy_j))} usable${times >= 2 ? `: about ${format.fixed(Number(times.toPrecision(2)))} such drives` : ''}. Foreseen by ${bases[a.consumption.basis](a.consumption)}${a.driving.pause_s > 0.05 ? `, with its usual pause of ${format.fixed(a.driving.pause_s, 1)} s at each stop` : ''}.</p></div>`;
}

export function Plan({ given }) {
  useTitleOf('Plan');
  const live = useLive();
  const able = [...live.robots.values()].filter((entry) => entry.state.has_model).map((entry) => entry.id).sort();
  const [robot, set_robot] = useState(given.robot ?? '');
  const [way, set_way] = useState('legs');
  const [legs, set_legs] = useState(first_legs);
  const [points, set_points] = useState([[-5, -2], [2, -2], [2, 2.5], [5, 2.5]]);
  const [terms, set_terms] = useState({ payload: '', deadline: '', value: '', charge: '' });
  const [told, set_told] = useState({ answer: null, error: null, busy: false, autonomy: { value: null, error: null } });
  const running = useRef(null);
  const options = useOptions(able);
  const chosen = able.includes(robot) ? robot : able[0] ?? '';

  const preview = useMemo(() => (way === 'legs' ? points_of_legs(legs).filter(([x, y]) => Number.isFinite(x + y)) : points), [way, legs, points]);
  const driven = useMemo(() => told.answer?.profile.x_m.map((x, k) => [x, told.answer.profile.y_m[k], told.answer.profile.power_w[k]]), [told.answer]);

  const compute = async (more = {}) => {
    const asked = { ...terms, ...more }, number = (text) => (text === '' ? undefined : Number(text));
    if (way === 'draw' && points.length < 2) {
      set_told((before) => ({ ...before, error: Object.assign(new Error('Draw at least two points.'), { title: 'No path yet' }) }));
      return;
    }
    running.current?.abort();
    const abort = (running.current = new AbortController());
    set_told((before) => ({ ...before, busy: true, error: null }));
    const body = {
      ...(way === 'draw' ? path_of_points(points) : { path: legs.map(segment_of) }),
      payload_kg: number(asked.payload), deadline_s: number(asked.deadline), value_of_time_w: number(asked.value), pareto_points: front_points, baseline_columns: true,
    };
    const charge = number(asked.charge);
    const url = `/v1/robots/${id_path(chosen)}`;
    const known = charge !== undefined || live.robots.get(chosen)?.state.state_of_charge !== null;
    try {
      const answer = await post(`${url}/profile`, body, abort.signal);
      set_told({ answer, of: preview, error: null, busy: false, autonomy: { value: null, error: null, busy: known } });
      if (!known) return;
      // The chance of this very plan: a deadline's plan is the one that values a second as its certificate says.
      const asked_for = { state_of_charge: charge === undefined ? undefined : charge / 100, payload_kg: body.payload_kg ?? 0, start_pose: body.start_pose ?? { x_m: 0, y_m: 0, heading_rad: 0 },
        value_of_time_w: Math.min(1e6, answer.certificate.time_multiplier_w), tasks: [{ name: 'this drive', path: body.path }] };
      const autonomy = await post(`${url}/autonomy`, asked_for, abort.signal).then((value) => ({ value, error: null }), (error) => ({ value: null, error }));
      if (!abort.signal.aborted) set_told((before) => ({ ...before, autonomy }));
    } catch (error) {
      if (error.name !== 'AbortError') set_told((before) => ({ ...before, error, busy: false }));
    }
  };
  useEffect(() => {
    if (chosen !== '') compute();
    return () => running.current?.abort();
  }, [chosen]);

  if (live.loaded && able.length === 0) return html`<h1>Plan</h1><${Empty} title="No robot has a model">Put a robot file to <code>/v1/robots/…</code> to plan with it.<//>`;
  if (!live.loaded) return html`<${Loading} what="the fleet" />`;
  const term = (key, label, unit, more) => html`<label class="field"><span>${label}</span><span class="with-unit"><input type="number" step="any" min="0" value=${terms[key]} onInput=${(e) => set_terms({ ...terms, [key]: e.currentTarget.value })} ...${more} /><span class="unit">${unit}</span></span></label>`;
  const answer = told.answer;
  const faulty = /^\/path\/(\d+)/.exec(told.error?.field ?? '');
  const take = ({ duration_s }) => {
    const deadline = String(Math.ceil(duration_s * 100) / 100);
    set_terms({ ...terms, deadline });
    compute({ deadline });
  };
  const base = answer?.baselines;
  return html`<h1 class="hidden">Plan</h1><div class="plan">
    <form class="plan-form" onSubmit=${(e) => { e.preventDefault(); compute(); }}>
      <label class="field"><span>Robot</span><select value=${chosen} onChange=${(e) => { set_robot(e.currentTarget.value); keep_in_address('plan', { robot: e.currentTarget.value }); }}>${options}</select></label>
      <${Choice} label="How to give the path" value=${way} onChange=${set_way} options=${[['legs', 'Enter legs'], ['draw', 'Draw']]} />
      ${way === 'legs' ? html`<${Legs} legs=${legs} change=${set_legs} fault=${faulty ? Number(faulty[1]) : null} />`
        : html`<p class="note">${points.length} points, ${format.text(format.length(points.slice(1).reduce((sum, [x, y], k) => sum + Math.hypot(x - points[k][0], y - points[k][1]), 0)))}. Draw on the floor.</p>`}
      <div class="terms">
        ${term('payload', 'Payload', 'kg', { placeholder: '0' })}
        ${term('deadline', 'Deadline', 's', { placeholder: 'free' })}
        ${term('value', 'Value of time', 'W', { placeholder: '0' })}
        ${term('charge', 'Charge now', '%', { placeholder: 'live', max: 100 })}
      </div>
      <button type="submit" class="primary" disabled=${chosen === ''}>${told.busy ? 'Computing …' : 'Compute'}</button>
    </form>
    <div class="plan-result" aria-live="polite" aria-busy=${String(told.busy)}>
      ${told.error && html`<${Failure} error=${told.error} />`}
      ${way === 'draw' && html`<${Panel} class="screen" title="Draw the path"><${DrawPath} points=${points} change=${set_points} /><//>`}
      ${answer === null ? told.error === null && html`<${Loading} what="the plan" />` : html`<div class=${told.busy ? 'stale' : ''}>
        <${Verdict} answer=${answer} autonomy=${told.autonomy} />
        <dl class="readouts">
          <${Readout} large label="Least energy" of=${format.energy(answer.energy_j)} channel="accent" />
          <${Readout} large label="Duration" of=${format.span(answer.duration_s)} />
          <${Readout} large label="Distance" of=${format.length(answer.distance_m)} />
          <${Readout} large label="Top speed" of=${format.unit(answer.peak_speed_m_s, 'm/s', 2)} />
          <${Readout} large label="Per metre" of=${format.unit(answer.distance_m > 0 ? answer.energy_j / answer.distance_m : null, 'J/m')} />
        </dl>
        <div class="columns">
          <div>
            <${Panel} class="screen" title="Speed and power"><${SpeedChart} answer=${answer} /><//>
            <${Panel} title="Against the usual profiles">
              <${Bars} label="Energy of the plan, a trapezoid and a triangle in the same time" rows=${[
                { name: 'Least energy', value: answer.energy_j, of: format.energy(answer.energy_j, 4), channel: 'least', note: '' },
                ...['trapezoid', 'triangle'].map((name) => ({ name: name[0].toUpperCase() + name.slice(1), value: base[name]?.energy_j ?? null, of: format.energy(base[name]?.energy_j, 4), channel: 'plain', note: against(base[name]) }))]} />
              <p class="note foot">All three in the same time on every run between stops.</p>
            <//>
            <${Panel} title="Where the energy goes"><${Waterfall} terms_j=${answer.ledger_j} battery_j=${answer.energy_j} measured=${false} /><//>
          </div>
          <div>
            <${Panel} class="screen" title="On the floor"><${FloorPath} points=${driven} under=${told.of === preview ? null : preview} height=${340} label="The planned path, coloured by power; circle: start, square: end" /><//>
            <${Panel} class="screen" title="Energy against time">${answer.pareto.length < 2 ? html`<${Empty} title="No front">Nothing to trade: time and energy do not compete on this path.<//>` : html`<${Front} answer=${answer} take=${take} />`}<//>
            <${Panel} title="How sure the optimum is"><${Certificate} answer=${answer} /><//>
          </div>
        </div></div>`}
      ${way === 'legs' && answer === null && preview.length > 1 && html`<${Panel} class="screen" title="Path"><${FloorPath} points=${preview.map(([x, y]) => [x, y, NaN])} legend=${false} label="The path that was entered" /><//>`}
    </div></div>`;
}
