// What a minimum-energy drive would have spent on a mission's legs: the same distance in the same runs between
// stops, turned at each stop from the old direction into the new one, the first payload, no more time. What is
// left of the time the robot waits at idle power, so that both spans are equal.
const standing_m_s = 0.02, least_run_m = 0.05, chord_m = 0.05, least_turn_rad = 0.02, most_runs = 400;

// {length_m, first, last}: each run between stops, with the directions in which it begins and ends (rad, NaN
// where the robot did not tell its place).
export function runs_of(trace) {
  const runs = [];
  let run = null, place = null;
  trace.speed_m_s.mean.forEach((speed, k) => {
    const size = Math.abs(speed ?? 0), [x, y] = [trace.x_m[k], trace.y_m[k]];
    if (size <= standing_m_s) {
      run = null;
    } else {
      if (run === null) runs.push((run = { length_m: 0, first: NaN, last: NaN }));
      run.length_m += size * (trace.covered_s[k] ?? 0);
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
  return runs.filter(({ length_m }) => length_m >= least_run_m);
}

function turn_between(before, after) {
  const turn = after - before;
  return Math.atan2(Math.sin(turn), Math.cos(turn));
}

// The request for /profile, or null where the mission went nowhere.
export function least_drive_request(mission, trace) {
  const { distance_m, duration_s } = mission.energy;
  const runs = runs_of(trace);
  if (runs.length === 0 || runs.length > most_runs || distance_m < least_run_m) return null;
  const total = runs.reduce((sum, run) => sum + run.length_m, 0);
  const path = runs.flatMap((run, k) => {
    const turn = k === 0 ? NaN : turn_between(runs[k - 1].last, run.first);
    return [...(Math.abs(turn) > least_turn_rad ? [{ kind: 'turn', angle_rad: turn }] : []),
      { kind: 'straight', length_m: (run.length_m / total) * distance_m }];
  });
  return { path, payload_kg: mission.payload_kg ?? 0, deadline_s: duration_s, columns: false };
}
