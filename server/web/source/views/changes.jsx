// Robot files as lists of parameters, and the differences between two of them.
import * as format from '../format.js';

const mostShown = 12;

function text(value) {
  return typeof value === 'number' ? format.digits(value, 4) : String(value);
}

// A document's leaves by their path: {"battery.capacity_ah": "40", …}.
export function flat(value, name = '', into = {}) {
  if (Array.isArray(value)) {
    const more = value.length > 4 ? ` … (${value.length})` : '';
    into[name] = value.slice(0, 4).map(text).join(', ') + more;
  } else if (value !== null && typeof value === 'object') {
    for (const [key, part] of Object.entries(value)) flat(part, name ? `${name}.${key}` : key, into);
  } else into[name] = text(value);
  return into;
}

export function changesOf(model, before) {
  if (!model || !before) return [];
  const now = flat(model);
  const then = flat(before);
  return [...new Set([...Object.keys(now), ...Object.keys(then)])]
    .filter((key) => now[key] !== then[key])
    .map((key) => ({ key, from: then[key] ?? null, to: now[key] ?? null }));
}

function words({ from, to }) {
  if (from === null) return `added: ${to}`;
  return to === null ? `removed, was ${from}` : `${from} → ${to}`;
}

export function Changes({ of, none = 'No parameter changes.' }) {
  if (of.length === 0) return <p class="note">{none}</p>;
  return (
    <ul class="changes">
      {of.slice(0, mostShown).map((c) => (
        <li key={c.key}>
          <code>{c.key}</code> {words(c)}
        </li>
      ))}
      {of.length > mostShown && <li class="note">and {of.length - mostShown} more</li>}
    </ul>
  );
}
