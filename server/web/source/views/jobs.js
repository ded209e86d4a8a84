// Lists of diagnoses, and how their states and verdicts are said. Part of the file loaded with the gap view.
import { html } from '../html.js';
import * as format from '../format.js';
import { robot_link } from '../route.js';

export const state_notes = { queued: 'waiting', running: 'running', done: 'done', failed: 'failed', cancelled: 'cancelled', interrupted: 'cut off by a restart' };
export const share = (value, places = 1) => format.text(format.percent(value, places));

export const verdicts = {
  none: ['No gap', 'What is measured agrees with the model, as far as these missions tell.'],
  effects: ['Effects found', 'The model leaves out what is listed here.'],
  outside: ['Outside the catalogue', 'Something is at work that no known effect describes.'],
  not_this_robot: ['Not this robot', 'The robot file is not this robot’s, or not as it ran here.'],
  inconclusive: ['Inconclusive', 'These missions do not decide what causes the gap.'],
};

export function State({ of }) {
  return html`<span class=${`job job-${of.state}`}>${state_notes[of.state]}</span>`;
}

function found_words(summary) {
  if (!summary) return '–';
  const verdict = (verdicts[summary.verdict]?.[0] ?? summary.verdict).toLowerCase(), effects = summary.effects.map((e) => format.words(e.id)).join(', ');
  if (effects === '') return verdict;
  return summary.verdict === 'effects' ? effects : `${verdict}; likeliest ${effects}`;
}

export function JobRows({ jobs, with_robot = true }) {
  return html`<table class="grid jobs"><thead><tr><th scope="col">Diagnosis</th>${with_robot && html`<th scope="col">Robot</th>`}<th scope="col">Begun</th><th scope="col">State</th><th scope="col">Found</th>
    <th scope="col" class="figure">Gap</th>${with_robot && html`<th scope="col" class="figure">Left, held out</th><th scope="col" class="figure">Missions</th>`}</tr></thead>
    <tbody>${jobs.map((d) => html`<tr key=${d.id}>
      <th scope="row"><a href=${`#/gap/${d.id}`}>${d.id}</a>${d.cause === 'watch' && html` <span class="note">by the watch</span>`}</th>
      ${with_robot && html`<td><a href=${robot_link(d.robot_id)}>${d.robot_id}</a></td>`}
      <td class="when">${format.time(d.created_utime_us)}</td><td><${State} of=${d} /></td>
      <td>${d.error ? html`<span class="note">${d.error}</span>` : found_words(d.summary)}</td>
      <td class="figure">${share(d.summary?.gap.power_absolute_relative)}</td>${with_robot && html`<td class="figure">${share(d.summary?.effects.length > 0 ? d.summary.shrinkage.held_out_after : null)}</td>
      <td class="figure">${d.fitted_on.length || '–'}</td>`}</tr>`)}</tbody></table>`;
}
