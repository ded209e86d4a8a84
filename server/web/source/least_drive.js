// What a minimum-energy drive would have spent on a mission's legs: the same distance in the same number of
// runs between stops, the same turning (taken in place at the stops), the first payload, no more time. What is
// left of the time the robot waits at idle power, so that both spans are equal.
const standing_m_s = 0.02, least_run_m = 0.05, most_runs = 120;

export function runs_of(trace) {
  const runs = [];
  let length = 0;
  trace.speed_m_s.mean.forEach((speed, k) => {
    const size = Math.abs(speed ?? 0);
    if (size > standing_m_s) length += size * (trace.covered_s[k] ?? 0);
    else if (length > 0) {
      runs.push(length);
      length = 0;
    }
  });
  if (length > 0) runs.push(length);
  return runs.filter((run) => run >= least_run_m);
}

// The request for /profile, or null where the mission went nowhere.
export function least_drive_request(mission, trace) {
  const { distance_m, turned_rad, duration_s } = mission.energy;
  let runs = runs_of(trace);
  if (runs.length === 0 || distance_m < least_run_m) return null;
  const total = runs.reduce((sum, run) => sum + run, 0);
  if (runs.length > most_runs) runs = Array(most_runs).fill(total / most_runs);
  const turn = Math.abs(turned_rad) / runs.length;
  const path = runs.flatMap((run) => [
    ...(turn > 0.01 ? [{ kind: 'turn', angle_rad: turn }] : []),
    { kind: 'straight', length_m: (run / total) * distance_m },
  ]);
  return { path, payload_kg: mission.payload_kg ?? 0, deadline_s: duration_s, columns: false };
}
