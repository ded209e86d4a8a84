import * as format from '../format.js';

// A document's leaves by their path, as people read them.
export function flat(value, name = '', into = {}) {
  if (Array.isArray(value)) into[name] = value.map((v) => (typeof v === 'number' ? format.digits(v, 4) : String(v))).slice(0, 4).join(', ') + (value.length > 4 ? ` … (${value.length})` : '');
  else if (value !== null && typeof value === 'object') for (const [key, part] of Object.entries(value)) flat(part, name ? `${name}.${key}` : key, into);
  else into[name] = typeof value === 'number' ? format.digits(value, 4) : String(value);
  return into;
}
