// The usual speed profiles, for comparison with the plan. A profile that exceeds the robot's limits in the
// plan's duration is slowed down until it satisfies them; its energy is that of the slower profile.
import { idPath, post } from './api.js';

// Multiples of the factor that speed and acceleration require.
const slower = [1.001, 1.03, 1.07, 1.15, 1.3, 1.5, 2];
const standing = 1e-6;

// The factor of time by which speed, acceleration and yaw rate come within their limits.
function leastFactor({ time_s: t, speed_m_s: v, yaw_rate_rad_s: w }, limits) {
  let factor = 1;
  for (let k = 0; k < t.length; ++k) {
    factor = Math.max(factor, Math.abs(v[k]) / limits.speed_m_s, Math.abs(w[k]) / limits.yaw_rate_rad_s);
    if (k === 0 || t[k] <= t[k - 1]) continue;
    const acceleration = Math.abs(v[k] - v[k - 1]) / (t[k] - t[k - 1]);
    factor = Math.max(factor, Math.sqrt(acceleration / limits.acceleration_m_s2));
  }
  return factor;
}

// The same way in `factor` times the time; stops last as long as before.
function slowed({ time_s: t, speed_m_s: v, yaw_rate_rad_s: w }, factor) {
  const stands = (k) => Math.abs(v[k]) < standing && Math.abs(w[k]) < standing;
  const rows = [[t[0], v[0], w[0]]];
  for (let k = 1; k < t.length; ++k) {
    if (t[k] <= t[k - 1]) continue; // both sides of a corner
    const pace = stands(k) && stands(k - 1) ? 1 : factor;
    rows.push([rows[rows.length - 1][0] + (t[k] - t[k - 1]) * pace, v[k], w[k]]);
  }
  return {
    time_s: rows.map(([at]) => at),
    speed_m_s: rows.map(([, speed]) => speed / factor),
    yaw_rate_rad_s: rows.map(([, , rate]) => rate / factor),
  };
}

// {energyJ, durationS, slowed} of a baseline within the limits; null if none exists.
export async function withinLimits(baseline, { robotId, limits, payloadKg, mayScale, signal }) {
  if (!baseline) return null;
  if (baseline.within_limits)
    return { energyJ: baseline.energy_j, durationS: baseline.duration_s, slowed: false };
  if (!mayScale) return null;
  const least = leastFactor(baseline.profile, limits);
  for (const more of slower) {
    const body = { profile: slowed(baseline.profile, least * more), payload_kg: payloadKg };
    const priced = await post(`/v1/robots/${idPath(robotId)}/estimate`, body, signal);
    if (priced.beyond_limits.length === 0)
      return { energyJ: priced.energy_j, durationS: priced.duration_s, slowed: true };
  }
  return null;
}
