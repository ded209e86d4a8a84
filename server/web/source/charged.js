// Energy charged in a period, summed over the stays at chargers in the log.
import { useRead } from './api.js';
import { newest } from './logs.js';

const mostStays = 20_000;

// {stays, joule, whole}; not whole: there are more stays, which were not read.
async function readCharged([from, to], robots, signal) {
  const filter = { kind: 'charged', robot_id: robots.join(','), from_utime_us: from, to_utime_us: to };
  const { entries, next } = await newest('/v1/event-log', filter, mostStays, signal);
  const joule = entries.reduce((sum, { detail }) => sum + (detail.charged_j ?? 0), 0);
  return { stays: entries.length, joule, whole: !next };
}

// Null until it is read. `period`: [from, to] in microseconds.
export function useCharged(period, robots) {
  const key = JSON.stringify([period, robots]);
  const { value, path } = useRead((signal) => readCharged(period, robots, signal), key);
  return path === key ? value : null;
}
