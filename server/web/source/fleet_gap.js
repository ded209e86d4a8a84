// How far measured energy of each robot departs from its model, and whether that has changed: what the
// history says, beside the live state.
import { useEffect, useState } from 'preact/hooks';
import { get, idPath } from './api.js';
import { newestEvents } from './audit_log.js';

const renewMs = 120_000;
const mostRobots = 100; // one question for each kind of robot; larger fleets would keep the service busy
const driftKinds = ['gap_drift', 'consumption_drift'];
const changeOf = { gap_drift: (d) => d.ratio_after - d.ratio_before, consumption_drift: (d) => d.ratio - 1 };

// One answer holds all robots of a kind.
async function readRatios(ids, gaps, signal) {
  const asked = new Set();
  for (const id of ids) {
    if (asked.has(id)) continue;
    const { siblings } = await get(`/v1/robots/${idPath(id)}/gap-history?limit=1`, signal);
    for (const s of siblings) {
      asked.add(s.robot_id);
      gaps.set(s.robot_id, { ratio: s.ratio, standsOut: s.stands_out });
    }
  }
}

// Models that wait for somebody to adopt them.
async function readProposals(gaps, signal) {
  const { proposals } = await get('/v1/proposals?limit=1000', signal);
  for (const p of proposals)
    if (p.closed_reason === null) gaps.set(p.robot_id, { ...gaps.get(p.robot_id), proposed: true });
}

// A drift counts until another model is in force.
async function readDrifts(gaps, signal) {
  const events = await newestEvents({ count: 1000, signal });
  const settled = new Set();
  for (const { robot_id: id, kind, detail } of events) {
    if (settled.has(id)) continue;
    if (kind === 'model_adopted' || kind === 'model_activated') settled.add(id);
    if (!driftKinds.includes(kind)) continue;
    settled.add(id);
    gaps.set(id, {
      ...gaps.get(id),
      drift: changeOf[kind](detail),
      driftUs: detail.since_utime_us ?? detail.utime_us,
    });
  }
}

// Map from robot to {ratio, standsOut, drift, driftUs, proposed}; empty until it is read.
export function useFleetGap(ids) {
  const [gaps, setGaps] = useState(new Map());
  const key = ids.length > mostRobots ? '' : ids.join('\n');
  useEffect(() => {
    if (key === '') return undefined;
    const abort = new AbortController();
    const read = async () => {
      const next = new Map();
      await readRatios(key.split('\n'), next, abort.signal);
      await readDrifts(next, abort.signal);
      await readProposals(next, abort.signal);
      setGaps(next);
    };
    const quietly = () => read().catch(() => {}); // the live view says when the service is gone
    const first = setTimeout(quietly, 300); // after the first view is drawn
    const timer = setInterval(quietly, renewMs);
    return () => {
      abort.abort();
      clearTimeout(first);
      clearInterval(timer);
    };
  }, [key]);
  return gaps;
}
