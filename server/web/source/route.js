import { query } from './api.js';

// "#/missions/12" -> view mission, id 12; "#/missions?state=open" -> view missions, given {state: 'open'}.
export function route_of(hash) {
  const [path, values] = hash.replace(/^#\/?/, '').split('?');
  const [view = '', id] = path.split('/');
  const given = Object.fromEntries(new URLSearchParams(values ?? ''));
  if (view === '') return { view: 'fleet', given };
  if (id === undefined || id === '') return { view: view === 'robots' ? 'fleet' : view, given };
  let name = id;
  try {
    name = decodeURIComponent(id);
  } catch {
    // not ours; shown as it stands
  }
  return { view: view === 'missions' ? 'mission' : view, id: name, given };
}

export const robot_link = (id) => `#/robots/${encodeURIComponent(id)}`;
export const mission_link = (id) => `#/missions/${id}`;

// Changes what the address says after "?", without a new step in the history.
export function keep_in_address(view, values) {
  history.replaceState(null, '', `#/${view}${query(values)}`);
}
