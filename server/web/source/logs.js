import { get, query } from './api.js';

const mostOfPage = 1000;

// The newest entries of the log at `path`, newest first: at least `count`, or all. {entries, next}; `next` is
// null after the last one.
export async function newest(path, filter, count, signal) {
  const entries = [];
  let next = null;
  do {
    const page = { order: 'desc', limit: Math.min(count, mostOfPage), cursor: next };
    const answer = await get(`${path}${query({ ...filter, ...page })}`, signal);
    entries.push(...(answer.events ?? answer.entries));
    next = answer.next_cursor;
  } while (next && entries.length < count);
  return { entries, next };
}
