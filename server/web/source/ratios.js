// Measured over modelled energy of each robot, from its newest missions.
import { useEffect, useState } from 'preact/hooks';
import { get, idPath } from './api.js';

const renewMs = 120_000;
const mostRobots = 100; // one request for each kind of robot; larger fleets would load the service

// One response contains all robots of a kind.
async function readRatios(ids, signal) {
  const ratios = new Map();
  for (const id of ids) {
    if (ratios.has(id)) continue;
    const { siblings } = await get(`/v1/robots/${idPath(id)}/gap-history?limit=1`, signal);
    for (const s of siblings) ratios.set(s.robot_id, s.ratio);
  }
  return ratios;
}

// Map from robot to measured over modelled energy; empty until it is read.
export function useRatios(ids) {
  const [ratios, setRatios] = useState(new Map());
  const key = ids.length > mostRobots ? '' : ids.join('\n');
  useEffect(() => {
    if (key === '') return undefined;
    const abort = new AbortController();
    const read = () => readRatios(key.split('\n'), abort.signal).then(setRatios, () => {}); // the live view reports that the service is gone
    const first = setTimeout(read, 300); // after the first view is drawn
    const timer = setInterval(read, renewMs);
    return () => {
      abort.abort();
      clearTimeout(first);
      clearInterval(timer);
    };
  }, [key]);
  return ratios;
}
