// What a minimum-energy drive would have spent on a mission's legs: the same distance in the same runs between
// stops, turned at each stop from the old direction into the new one, standing as long as it stood, carrying
// what it carried, arriving no later. The mission as driven is one of the drives that this minimum ranges over.
import { get, query } from './api.js';

const standing_m_s = 0.02, least_run_m = 0.05, chord_m = 0.05, least_turn_rad = 0.02, least_dwell_s = 0.2, most_runs = 400, most_asked = 64;
const idle_margin = 1.05;  // a standing robot that draws more than this over its idle power turns in place

// {length_m, stood_s, first, last, utime_us}: each run between stops, how long the robot stood still before it,
// the directions in which it begins and ends (rad, NaN where the robot did not tell its place), and a time within.
function runs_of(trace, idle_power_w) {
  const runs = [];
  let run = null, place = null, stood_s = 0;
  trace.speed_m_s.mean.forEach((speed, k) => {
    const size = Math.abs(speed ?? 0), [x, y] = [trace.x_m[k], trace.y_m[k]], covered_s = trace.covered_s[k] ?? 0;
    if (size <= standing_m_s) {
      run = null;
      if (trace.modelled_power_w.mean[k] <= idle_margin * idle_power_w) stood_s += covered_s;
    } else {
      if (run === null) {
        runs.push((run = { length_m: 0, stood_s, first: NaN, last: NaN, utime_us: trace.start_utime_us[k] + trace.width_us / 2 }));
        stood_s = 0;
      }
      run.length_m += size * covered_s;
    }
    if (x === null || y === null) return;
    if (place === null) place = [x, y];
    const step = Math.hypot(x - place[0], y - place[1]);
    if (step < chord_m) return;
    const direction = Math.atan2(y - place[1], x - place[0]), of = run ?? runs[runs.length - 1];
    if (of !== undefined) {
      if (Number.isNaN(of.first)) of.first = direction;
      of.last = direction;
    }
    place = [x, y];
  });
  return { runs: runs.filter(({ length_m }) => length_m >= least_run_m), stood_at_end_s: stood_s };
}

function turn_between(before, after) {
  const turn = after - before;
  return Math.atan2(Math.sin(turn), Math.cos(turn));
}

// What the mission is made of, or null where it went nowhere.
export function driven_runs(mission, trace, idle_power_w) {
  const found = runs_of(trace, idle_power_w);
  return found.runs.length === 0 || found.runs.length > most_runs || mission.energy.distance_m < least_run_m ? null : found;
}

// The payload of each run as the robot told it and the service accounted for it; null where that is not kept.
export async function payloads_of(mission, runs, signal) {
  if (runs.length > most_asked) return null;
  const told = await Promise.all(runs.map(({ utime_us }) =>
    get(`/v1/missions/${mission.id}/telemetry${query({ from_utime_us: Math.round(utime_us), limit: 1 })}`, signal)));
  if (told.some(({ payload_kg }) => payload_kg.length === 0)) return null;
  let now = mission.payload_kg ?? 0, named = false;
  return told.map(({ payload_kg: [said] }) => {
    // A 0 against the load declared at the start says nothing until a load was named.
    if (said === null || (said === 0 && !named && now > 0)) return now;
    named = true;
    return (now = said);
  });
}

// The request for /profile; `payloads`: of each run, or null for the declared one all the way.
export function least_drive_request(mission, { runs, stood_at_end_s }, payloads) {
  const { distance_m, duration_s } = mission.energy;
  const carried = payloads ?? runs.map(() => mission.payload_kg ?? 0);
  const total = runs.reduce((sum, run) => sum + run.length_m, 0);
  const dwell = (stood_s) => (stood_s > least_dwell_s ? [{ kind: 'dwell', duration_s: stood_s }] : []);
  const path = runs.flatMap((run, k) => {
    const turn = k === 0 ? NaN : turn_between(runs[k - 1].last, run.first);
    const load = k > 0 && carried[k] !== carried[k - 1] ? [{ kind: 'payload', payload_kg: carried[k] }] : [];
    return [...dwell(run.stood_s), ...load, ...(Math.abs(turn) > least_turn_rad ? [{ kind: 'turn', angle_rad: turn }] : []),
      { kind: 'straight', length_m: (run.length_m / total) * distance_m }];
  });
  return { path: [...path, ...dwell(stood_at_end_s)], payload_kg: carried[0], deadline_s: duration_s, columns: false };
}
