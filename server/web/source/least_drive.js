// What a minimum-energy drive would have spent on a mission's legs: the same distance in the same runs between
// stops, turned at each stop from the old direction into the new one, standing as long as it stood, with the
// first payload, arriving no later. The mission as driven is one of the drives that this minimum ranges over.
const standing_m_s = 0.02, least_run_m = 0.05, chord_m = 0.05, least_turn_rad = 0.02, least_dwell_s = 0.2, most_runs = 400;
const idle_margin = 1.05;  // a standing robot that draws more than this over its idle power turns in place

// {length_m, stood_s, first, last}: each run between stops, how long the robot stood still before it, and the
// directions in which it begins and ends (rad, NaN where the robot did not tell its place).
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
        runs.push((run = { length_m: 0, stood_s, first: NaN, last: NaN }));
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

// The request for /profile, or null where the mission went nowhere.
export function least_drive_request(mission, trace, idle_power_w) {
  const { distance_m, duration_s } = mission.energy;
  const { runs, stood_at_end_s } = runs_of(trace, idle_power_w);
  if (runs.length === 0 || runs.length > most_runs || distance_m < least_run_m) return null;
  const total = runs.reduce((sum, run) => sum + run.length_m, 0);
  const dwell = (stood_s) => (stood_s > least_dwell_s ? [{ kind: 'dwell', duration_s: stood_s }] : []);
  const path = runs.flatMap((run, k) => {
    const turn = k === 0 ? NaN : turn_between(runs[k - 1].last, run.first);
    return [...dwell(run.stood_s), ...(Math.abs(turn) > least_turn_rad ? [{ kind: 'turn', angle_rad: turn }] : []),
      { kind: 'straight', length_m: (run.length_m / total) * distance_m }];
  });
  return { path: [...path, ...dwell(stood_at_end_s)], payload_kg: mission.payload_kg ?? 0, deadline_s: duration_s, columns: false };
}
