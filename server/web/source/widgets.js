import { Component } from 'preact';
import { useMemo } from 'preact/hooks';
import { html } from './html.js';
import * as format from './format.js';

// A number with its unit; `of` is what a function of format.js gave.
export function Quantity({ of, sign }) {
  const n = sign ? format.signed(of.n) : of.n;
  return html`<span class="quantity"><span class="number">${n}</span>${of.u && html`<span class="unit">${'\u00a0'}${of.u}</span>`}</span>`;
}

export function Readout({ label, of, note, channel, large }) {
  return html`<div class=${`readout ${large ? 'large' : ''} ${channel ?? ''}`}>
    <dt>${label}</dt>
    <dd>${typeof of === 'string' ? html`<span class="number">${of}</span>` : html`<${Quantity} of=${of} />`}
      ${note && html`<span class="note">${note}</span>`}</dd>
  </div>`;
}

export function Empty({ title, children }) {
  return html`<div class="empty"><p class="empty-title">${title}</p>${children && html`<p>${children}</p>`}</div>`;
}

export function Loading({ what }) {
  return html`<div class="loading" role="status"><span class="sweep" aria-hidden="true"></span>Reading ${what} …</div>`;
}

export function Failure({ error, retry }) {
  const where = error.field && !error.message.includes(error.field) ? ` (${error.field})` : '';
  return html`<div class="failure" role="alert">
    <p class="empty-title">${error.status === 0 ? error.title : `${error.title ?? 'Fault'}${error.status ? ` · ${error.status}` : ''}`}</p>
    <p>${error.message}${where}</p>
    ${retry && html`<button type="button" onClick=${retry}>Try again</button>`}
  </div>`;
}

// What useGet told: its value through `children`, or why there is none.
export function Answer({ of, what, children }) {
  if (of.value !== null) return children(of.value);
  if (of.error !== null) return html`<${Failure} error=${of.error} retry=${of.reload} />`;
  return html`<${Loading} what=${what} />`;
}

export function Panel({ title, aside, children, class: name }) {
  return html`<section class=${`panel ${name ?? ''}`}>
    <header><h2>${title}</h2>${aside && html`<div class="aside">${aside}</div>`}</header>
    ${children}
  </section>`;
}

export function Choice({ label, options, value, onChange }) {
  return html`<div class="choice" role="group" aria-label=${label}>
    ${options.map(([key, name]) => html`<button key=${key} type="button" aria-pressed=${String(key === value)} onClick=${() => onChange(key)}>${name}</button>`)}
  </div>`;
}

export const state_notes = {
  open: 'running', finished: 'finished', aborted: 'aborted', unfinished: 'fell silent', superseded: 'superseded',
  interrupted: 'interrupted',
};

export function MissionState({ mission }) {
  return html`<span class=${`state state-${mission.state}`}>${state_notes[mission.state] ?? mission.state}</span>`;
}

// Keeps a fault in one view from taking the whole page.
export class Guard extends Component {
  constructor() {
    super();
    this.state = { error: null };
  }
  static getDerivedStateFromError(error) {
    return { error };
  }
  componentDidCatch(error) {
    console.error(error);
  }
  componentDidUpdate(before) {
    if (before.view !== this.props.view && this.state.error !== null) this.setState({ error: null });
  }
  render() {
    if (this.state.error === null) return this.props.children;
    return html`<${Failure} error=${this.state.error} retry=${() => this.setState({ error: null })} />`;
  }
}

// Robots as options of a choice; drawn anew only when they change, since what is live is told many times a second.
export function useOptions(ids) {
  return useMemo(() => ids.map((id) => html`<option key=${id} value=${id}>${id}</option>`), [ids.join('\n')]);
}

export function useTitleOf(text) {
  document.title = text ? `${text} · joulecast` : 'joulecast';
}
