// Lists of the service that are read from their end.
import { useState } from 'preact/hooks';
import { get, query, useRead } from './api.js';

const mostOfPage = 1000;

// The newest entries of the list at `path`, newest first unless the filter has another order: at least
// `count`, or all. {entries, next}; `next` is null after the last one. `progress(entries so far)`.
export async function newest(path, filter, count, signal, progress) {
  const entries = [];
  let next = null;
  do {
    const page = { order: 'desc', ...filter, limit: Math.min(count, mostOfPage), cursor: next };
    const answer = await get(`${path}${query(page)}`, signal);
    entries.push(...(answer.events ?? answer.missions ?? answer.entries));
    next = answer.next_cursor;
    progress?.(entries.length);
  } while (next && entries.length < count);
  return { entries, next };
}

// The same as useRead() has it, at first `count` entries; `more()` reads `step` more.
export function useNewest(path, filter, count, step = count) {
  const key = JSON.stringify([path, filter]);
  const [asked, setAsked] = useState({ key, count });
  const wanted = asked.key === key ? asked.count : count;
  const read = useRead((signal) => newest(path, filter, wanted, signal), path && `${key}${wanted}`);
  return { ...read, more: () => setAsked({ key, count: wanted + step }) };
}
