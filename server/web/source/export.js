// Downloads of lists, read page by page; energies are always in joules.
import { getText, query } from './api.js';
import { newest } from './logs.js';

const pageRows = 1000;

function save(parts, name, kind) {
  const type = kind === 'csv' ? 'text/csv' : 'application/json';
  const url = URL.createObjectURL(new Blob(parts, { type }));
  const stamp = new Date().toISOString().slice(0, 19).replaceAll(':', '');
  const download = `joulecast-${name}-${stamp}.${kind}`;
  const anchor = Object.assign(document.createElement('a'), { href: url, download });
  document.body.append(anchor);
  anchor.click();
  anchor.remove();
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}

// Saves the CSV of `path` and its following pages. `progress` is called with the number of lines so far.
export async function saveText(path, name, progress, signal) {
  const parts = [];
  let count = 0;
  for (let at = path; at !== null;) {
    const { text, next } = await getText(at, 'text/csv', signal);
    parts.push(parts.length === 0 ? text : text.slice(text.indexOf('\n') + 1));
    count += text.split('\r\n').length - 2;
    progress?.(count);
    at = next;
  }
  save(parts, name, 'csv');
}

async function saveJson(filter, progress, signal) {
  const { entries } = await newest('/v1/missions', filter, Infinity, signal, progress);
  save(['[\n', entries.map((m) => JSON.stringify(m)).join(',\n'), '\n]\n'], 'missions', 'json');
}

export const exportMissions = (kind, filter, progress, signal) =>
  kind === 'csv'
    ? saveText(`/v1/missions${query({ ...filter, limit: pageRows })}`, 'missions', progress, signal)
    : saveJson(filter, progress, signal);
