import { useRef, useState } from 'preact/hooks';
import { query } from './api.js';

// "#/missions/12" -> view mission, id 12; "#/missions?state=open" -> view missions, given {state: 'open'}.
export function routeOf(hash) {
  const [path, values] = hash.replace(/^#\/?/, '').split('?');
  const [view = 'fleet', name = ''] = path.split('/').filter(Boolean);
  const given = Object.fromEntries(new URLSearchParams(values ?? ''));
  const id = new URLSearchParams(`id=${name}`).get('id'); // of any text, unlike decodeURIComponent()
  if (id === '') return { view: view === 'robots' ? 'fleet' : view, given, hash };
  return { view: view === 'missions' ? 'mission' : view, id, given, hash };
}

export const robotLink = (id) => `#/robots/${encodeURIComponent(id)}`;
export const missionLink = (id) => `#/missions/${id}`;

// Changes the parameters of the address, without a new entry in the history.
export function keepInAddress(values) {
  const [path] = location.hash.split('?');
  history.replaceState(null, '', `${path || '#/fleet'}${query(values)}`);
}

// A view's parameters in its address, and a function that changes some; an empty value removes one.
export function useChoices(asked) {
  const [given, setGiven] = useState(asked);
  const latest = useRef(given); // charts keep the function that they were made with
  const change = (part) => {
    const all = Object.entries({ ...latest.current, ...part });
    latest.current = Object.fromEntries(all.filter(([, value]) => value));
    setGiven(latest.current);
    keepInAddress(latest.current);
  };
  return [given, change];
}
