// The robots that need attention, from the service.
import { get, useRenewed } from './api.js';

const renewMs = 10_000;

async function readAttention(signal) {
  const { attention } = await get('/v1/attention', signal);
  return new Map(attention.map((entry) => [entry.robot_id ?? '', entry]));
}

// Map from robot to {severity, reasons}; the service itself is under ''. Empty until it is read.
export const useAttention = () => useRenewed(readAttention, renewMs, 'all');
