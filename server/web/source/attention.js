// The robots that need attention, from the service.
import { get, useRenewed } from './api.js';

const renewMs = 10_000;

async function readAttention(signal) {
  const { attention } = await get('/v1/attention', signal);
  return new Map(attention.map((entry) => [entry.robot_id ?? '', entry]));
}

// Map from robot to {severity, acknowledged, reasons}; the service itself is under ''. Empty until it is
// read; read again when `turn` changes.
export const useAttention = (turn = 0) => useRenewed(readAttention, renewMs, `all${turn}`);

// Whether an entry, absent for most robots, has a reason that no one acknowledged.
export const needsSomeone = (entry) => entry !== undefined && !entry.acknowledged;
