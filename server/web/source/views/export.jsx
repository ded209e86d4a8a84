// Downloads of lists, read page by page; energies are always in joules.
import { useEffect, useRef, useState } from 'preact/hooks';
import { getText, query } from '../api.js';
import * as format from '../format.js';
import { newest } from '../logs.js';
import { Button } from '../widgets.jsx';

const pageRows = 1000;

function save(parts, name, kind) {
  const type = kind === 'csv' ? 'text/csv' : 'application/json';
  const url = URL.createObjectURL(new Blob(parts, { type }));
  const stamp = new Date().toISOString().slice(0, 19).replaceAll(':', '');
  const download = `joulecast-${name}-${stamp}.${kind}`;
  Object.assign(document.createElement('a'), { href: url, download }).click();
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}

// A row of Export: the CSV of `path` and its following pages.
export function csvOf(path, name) {
  const saveCsv = async (progress, signal) => {
    const parts = [];
    let count = 0;
    for (let at = path; at !== null;) {
      const { text, next } = await getText(at, 'text/csv', signal);
      parts.push(parts.length === 0 ? text : text.slice(text.indexOf('\n') + 1));
      count += text.split('\r\n').length - 2;
      progress(count);
      at = next;
    }
    save(parts, name, 'csv');
  };
  return ['CSV', saveCsv];
}

// Rows of Export: missions in both formats.
export function missionFiles(filter) {
  const saveJson = async (progress, signal) => {
    const { entries } = await newest('/v1/missions', filter, Infinity, signal, progress);
    save(['[\n', entries.map((m) => JSON.stringify(m)).join(',\n'), '\n]\n'], 'missions', 'json');
  };
  return [csvOf(`/v1/missions${query({ ...filter, limit: pageRows })}`, 'missions'), ['JSON', saveJson]];
}

// Buttons that save data as files, of rows [name, save(progress, signal)], where `progress` is called with
// the number of lines so far. `total`: lines, if stated.
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
      <div class="row export" role="status">
        <progress max={total || undefined} value={total ? count : undefined} /> {format.fixed(count)}
        {total && ` of ${format.fixed(total)}`}
        <Button onClick={() => abort.current.abort()}>Stop</Button>
      </div>
    );
  return (
    <div class="row export">
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
