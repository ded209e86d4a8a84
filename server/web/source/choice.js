// A choice of the reader's, kept in the browser where storage is allowed, for this visit otherwise.
import { useSource } from './api.js';

export function keptChoice(name, values, fallback) {
  const key = `joulecast.${name}`;
  const changes = new EventTarget();
  let chosen = null;
  try {
    chosen = localStorage.getItem(key);
  } catch {
    // storage may be forbidden
  }
  if (!values.includes(chosen)) chosen = null;
  const get = () => chosen ?? fallback();
  const tell = () => changes.dispatchEvent(new Event('change'));
  return {
    get,
    tell,
    listen: (listener) => changes.addEventListener('change', listener),
    set(value) {
      chosen = value;
      try {
        localStorage.setItem(key, value);
      } catch {
        // kept for this visit only
      }
      tell();
    },
    // A component that uses it is drawn again when the choice changes.
    use: () => useSource(get, changes),
  };
}
