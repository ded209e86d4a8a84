// Measured over modelled energy of each robot, from its newest missions.
import { get, idPath, useRenewed } from './api.js';

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
  const key = ids.length > mostRobots ? '' : ids.join('\n');
  return useRenewed((signal) => readRatios(ids, signal), renewMs, key);
}
