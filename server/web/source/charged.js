// Energy charged in a period, summed over the stays at chargers in the log.
import { get, query, useRead } from './api.js';
import { lastId, pageEntries } from './audit_log.js';

const mostPages = 20;

// {stays, joule, whole}; not whole: the period begins before the entries that were read.
async function readCharged([from, to], robots, signal) {
  const found = { stays: 0, joule: 0, whole: true };
  let end = await lastId(signal);
  for (let page = 0; end > 0; ++page) {
    if (page === mostPages) return { ...found, whole: false };
    const after = Math.max(0, end - pageEntries);
    const path = `/v1/event-log${query({ cursor: after || undefined, limit: pageEntries })}`;
    const events = (await get(path, signal)).events.filter(({ id }) => id <= end);
    for (const { kind, robot_id: robot, utime_us: us, detail } of events) {
      if (kind !== 'charged' || us < from || us >= to) continue;
      if (robots.length > 0 && !robots.includes(robot)) continue;
      found.stays += 1;
      found.joule += detail.charged_j ?? 0;
    }
    if (events.length > 0 && Math.max(...events.map((e) => e.utime_us)) < from) break;
    end = after;
  }
  return found;
}

// Null until it is read. `period`: [from, to] in microseconds.
export function useCharged(period, robots) {
  const key = JSON.stringify([period, robots]);
  const { value, path } = useRead((signal) => readCharged(period, robots, signal), key);
  return path === key ? value : null;
}
