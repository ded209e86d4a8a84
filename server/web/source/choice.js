// A choice of the reader's, kept in the browser where storage is allowed, for this visit otherwise.
import { useEffect, useState } from 'preact/hooks';

export function keptChoice(name, values, fallback) {
  const key = `joulecast.${name}`;
  const listeners = new Set();
  let chosen = null;
  try {
    chosen = localStorage.getItem(key);
  } catch {
    // storage may be forbidden
  }
  if (!values.includes(chosen)) chosen = null;
  const get = () => chosen ?? fallback();
  const tell = () => listeners.forEach((listener) => listener(get()));
  return {
    get,
    tell,
    listen: (listener) => listeners.add(listener),
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
    use() {
      const [value, setValue] = useState(get);
      useEffect(() => {
        listeners.add(setValue);
        return () => listeners.delete(setValue);
      }, []);
      return value;
    },
  };
}
