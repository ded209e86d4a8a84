// Views that come in a file of their own, asked for when first shown, so that the first view stays small.
import { useEffect, useState } from 'preact/hooks';
import { html } from '../html.js';
import { Failure, Loading } from '../widgets.js';

let asked = null, present = null;

function ask() {
  asked ??= import('./gap.js').then((module) => { present = module; }, (error) => {
    asked = null;
    throw error;
  });
  return asked;
}

function bring_style() {
  if (document.getElementById('gap-style')) return;
  document.head.append(Object.assign(document.createElement('link'), { id: 'gap-style', rel: 'stylesheet', href: 'gap-style.css' }));
}

export function Later({ part, ...rest }) {
  const [, set_turn] = useState(0);
  const [error, set_error] = useState(null);
  const turn = () => set_turn((n) => n + 1);
  const fetch_it = () => {
    set_error(null);
    bring_style();
    ask().then(turn, () => set_error({ status: 0, title: 'This part of the page could not be loaded', message: 'The service may be restarting, or the network is down.' }));
  };
  useEffect(() => {
    if (present === null) fetch_it();
  }, []);
  if (error !== null) return html`<${Failure} error=${error} retry=${fetch_it} />`;
  if (present === null) return html`<${Loading} what="this part of the page" />`;
  const Part = present[part];
  return html`<${Part} ...${rest} />`;
}

export const Gap = (props) => html`<${Later} part="Gap" ...${props} />`;
