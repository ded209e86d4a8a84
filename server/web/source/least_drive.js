// The energy of a minimum-energy drive along a mission's legs: with the same runs between stops, turns at
// the stops from the old direction into the new one, times at rest and payloads, and no later arrival. The
// mission as driven is one of the feasible drives.
import { get, query } from './api.js';

const standing = 0.02; // m/s
const shortest = 0.05; // m, of a run
const chord = 0.05; // m, between positions that give a direction
const straight = 0.02; // rad, below which a change of direction is not a turn
const leastDwell = 0.2; // s
const mostRuns = 400;
const mostAsked = 64;
const idleMargin = 1.05; // a standing robot that draws more than this over its idle power turns in place

// {lengthM, stoodS, first, last, utimeUs}: each run between stops, how long the robot stood still before it,
// the directions in which it begins and ends (rad, NaN without reported positions), and a time within it.
function runsOf(trace, idlePowerW) {
  const runs = [];
  let run = null;
  let place = null;
  let stoodS = 0;
  trace.speed_m_s.mean.forEach((speed, k) => {
    const size = Math.abs(speed ?? 0);
    const [x, y] = [trace.x_m[k], trace.y_m[k]];
    const coveredS = trace.covered_s[k] ?? 0;
    if (size <= standing) {
      run = null;
      if (trace.modelled_power_w.mean[k] <= idleMargin * idlePowerW) stoodS += coveredS;
    } else {
      if (run === null) {
        runs.push(
          (run = {
            lengthM: 0,
            stoodS,
            first: NaN,
            last: NaN,
            utimeUs: trace.start_utime_us[k] + trace.width_us / 2,
          }),
        );
        stoodS = 0;
      }
      run.lengthM += size * coveredS;
    }
    if (x === null || y === null) return;
    if (place === null) place = [x, y];
    const step = Math.hypot(x - place[0], y - place[1]);
    if (step < chord) return;
    const direction = Math.atan2(y - place[1], x - place[0]);
    const of = run ?? runs[runs.length - 1];
    if (of !== undefined) {
      if (Number.isNaN(of.first)) of.first = direction;
      of.last = direction;
    }
    place = [x, y];
  });
  return { runs: runs.filter(({ lengthM }) => lengthM >= shortest), stoodAtEndS: stoodS };
}

function turnBetween(before, after) {
  const turn = after - before;
  return Math.atan2(Math.sin(turn), Math.cos(turn));
}

// The runs of the mission; null if it has none.
export function drivenRuns(mission, trace, idlePowerW) {
  const found = runsOf(trace, idlePowerW);
  return found.runs.length === 0 || found.runs.length > mostRuns || mission.energy.distance_m < shortest
    ? null
    : found;
}

// The payload of each run as reported by the robot and used in the accounts; null if it is not stored or was
// never reported.
export async function payloadsOf(mission, runs, signal) {
  if (runs.length > mostAsked) return null;
  const samples = await Promise.all(
    runs.map(({ utimeUs }) =>
      get(
        `/v1/missions/${mission.id}/telemetry${query({ from_utime_us: Math.round(utimeUs), limit: 1 })}`,
        signal,
      ),
    ),
  );
  if (samples.some(({ payload_kg: [said] }) => said === undefined)) return null;
  if (samples.every(({ payload_kg: [said] }) => said === null)) return null;
  let now = mission.payload_kg ?? 0;
  let named = false;
  return samples.map(({ payload_kg: [said] }) => {
    // Until a payload is reported, a 0 does not replace the payload declared at the start.
    if (said === null || (said === 0 && !named && now > 0)) return now;
    named = true;
    return (now = said);
  });
}

// The request for /profile; `payloads`: of each run, or null for the declared one all the way.
export function leastDriveRequest(mission, { runs, stoodAtEndS }, payloads) {
  const { distance_m: distance, duration_s: duration } = mission.energy;
  const carried = payloads ?? runs.map(() => mission.payload_kg ?? 0);
  const total = runs.reduce((sum, run) => sum + run.lengthM, 0);
  const dwell = (stoodS) => (stoodS > leastDwell ? [{ kind: 'dwell', duration_s: stoodS }] : []);
  const path = runs.flatMap((run, k) => {
    const turn = k === 0 ? NaN : turnBetween(runs[k - 1].last, run.first);
    const load = k > 0 && carried[k] !== carried[k - 1] ? [{ kind: 'payload', payload_kg: carried[k] }] : [];
    return [
      ...dwell(run.stoodS),
      ...load,
      ...(Math.abs(turn) > straight ? [{ kind: 'turn', angle_rad: turn }] : []),
      { kind: 'straight', length_m: (run.lengthM / total) * distance },
    ];
  });
  return {
    path: [...path, ...dwell(stoodAtEndS)],
    payload_kg: carried[0],
    deadline_s: duration,
    columns: false,
  };
}
