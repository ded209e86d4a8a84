import { useEffect, useRef, useState } from 'preact/hooks';
import * as format from './format.js';
import { Button } from './widgets.jsx';

// Buttons that save data as files, of rows [name, save(progress, signal)]. `total`: lines, if stated.
export function Export({ of, total, disabled }) {
  const [count, setCount] = useState(null);
  const [error, setError] = useState(null);
  const abort = useRef(null);
  useEffect(() => () => abort.current?.abort(), []);
  const run = async (save) => {
    abort.current = new AbortController();
    setError(null);
    setCount(0);
    try {
      await save(setCount, abort.current.signal);
    } catch (fault) {
      if (fault.name !== 'AbortError') setError(fault);
    }
    setCount(null);
  };
  if (count !== null)
    return (
      <div class="export" role="status">
        <progress max={total || undefined} value={total ? count : undefined} /> {format.fixed(count)}
        {total && ` of ${format.fixed(total)}`}
        <Button onClick={() => abort.current.abort()}>Stop</Button>
      </div>
    );
  return (
    <div class="export">
      {error && (
        <span class="fault" role="alert">
          {error.message}
        </span>
      )}
      {of.map(([name, save]) => (
        <button key={name} type="button" disabled={disabled} onClick={() => run(save)}>
          Export {name}
        </button>
      ))}
    </div>
  );
}
