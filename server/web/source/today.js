// Energy of today and, until the same time of day, of the same weekday a week ago.
import { get, query, useRenewed } from './api.js';

const renewMs = 60_000;
const weekMs = 7 * 86_400_000;

async function readToday(signal) {
  const midnight = new Date().setHours(0, 0, 0, 0);
  const sums = ([from, to]) =>
    get(`/v1/mission-totals${query({ from_utime_us: from * 1000, to_utime_us: to * 1000 })}`, signal);
  const [today, before] = await Promise.all(
    [
      [midnight, Date.now()],
      [midnight - weekMs, Date.now() - weekMs],
    ].map(sums),
  );
  return new Map(Object.entries({ today, before }));
}

// Map with `today` and `before`, totals of missions that began then; empty until they are read.
export const useToday = () => useRenewed(readToday, renewMs, 'today');
