// Robot files as lists of parameters, and the differences between two of them.
import * as format from '../format.js';

const units = new Map(
  'nm_s_rad=N m s/rad,v_s_rad=V s/rad,kg_m2=kg m²,rad_s=rad/s,nm_a=N m/A,m_s2=m/s²,m_s=m/s,k_w=K/W,ohm=Ω,nm=N m,kg=kg,ah=Ah,m=m,h=H,v=V,w=W,a=A,s=s,k=K,rad=rad'
    .split(',')
    .map((pair) => pair.split('=')),
);
const mostShown = 12;

// "speed_m_s" -> ["speed", "m/s"]
export function unitOf(name) {
  const end = [...units.keys()].find((unit) => name.endsWith(`_${unit}`));
  return [format.words(end ? name.slice(0, -end.length - 1) : name), units.get(end) ?? ''];
}

const text = (value) => (typeof value === 'number' ? format.digits(value, 4) : String(value));

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

export function Changes({ of }) {
  if (of.length === 0) return <p class="note">No parameter changes.</p>;
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
