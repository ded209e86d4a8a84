// The event log as the service keeps it: entries in order, read from its end.
import { get, query } from './api.js';

export const pageEntries = 1000;

// At least the greatest id, by a fraction of a page.
export async function lastId(signal) {
  const after = async (id) =>
    (await get(`/v1/event-log${query({ cursor: id > 0 ? id : undefined, limit: 1 })}`, signal)).events;
  let low = 0; // there is an entry with a greater id, unless the log is empty
  let high = 1;
  while ((await after(high)).length > 0) [low, high] = [high, 4 * high];
  while (high - low > pageEntries / 4) {
    const middle = Math.floor((low + high) / 2);
    if ((await after(middle)).length > 0) low = middle;
    else high = middle;
  }
  return high;
}

// The newest entries, newest first: about `count` of all robots, or all of one.
export async function newestEvents({ robotId, count = 200, signal }) {
  let after = robotId ? 0 : Math.max(0, (await lastId(signal)) - count);
  const found = [];
  for (;;) {
    const path = `/v1/event-log${query({ robot_id: robotId, cursor: after > 0 ? after : undefined, limit: pageEntries })}`;
    const { events } = await get(path, signal);
    found.push(...events);
    if (events.length < pageEntries) return found.reverse();
    after = events[events.length - 1].id;
  }
}
