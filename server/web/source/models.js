// Robots' models in force, each requested once, for the battery's capacity, which live states lack.
import { forget, get, getOnce, idPath, useRead, useRenewed } from './api.js';
import { useLive } from './live.js';

const pathOf = (id) => `/v1/robots/${idPath(id)}`;
const none = new Map();

export const forgetModel = (id) => forget(pathOf(id));

async function readModels(ids) {
  const answers = await Promise.allSettled(ids.map((id) => getOnce(pathOf(id))));
  return new Map(answers.map(({ value }, k) => [ids[k], value?.model]));
}

// Map from robot to its model; undefined until its model is read, and without a model.
export function useModels(ids) {
  const live = useLive();
  const wanted = [...new Set(ids)].filter((id) => live.robots.get(id)?.state.has_model).sort();
  return useRead(() => readModels(wanted), wanted.join('\n')).value ?? none;
}

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
