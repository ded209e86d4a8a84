// A mission compared with the minimum-energy drive of the same legs.
import { useMemo } from 'preact/hooks';
import { get, idPath, post, query, useGet, useRead } from '../api.js';
import { EnergyBars } from '../bars.jsx';
import * as format from '../format.js';
import { Empty, Failure, Loading } from '../widgets.jsx';

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
// Null if the mission has none, or too many.
function runsOf(mission, trace, idlePowerW) {
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
        const utimeUs = trace.start_utime_us[k] + trace.width_us / 2;
        run = { lengthM: 0, stoodS, first: NaN, last: NaN, utimeUs };
        runs.push(run);
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
  const long = runs.filter(({ lengthM }) => lengthM >= shortest);
  const driven = long.length > 0 && long.length <= mostRuns && mission.energy.distance_m >= shortest;
  return driven ? { runs: long, stoodAtEndS: stoodS } : null;
}

function turnBetween(before, after) {
  const turn = after - before;
  return Math.atan2(Math.sin(turn), Math.cos(turn));
}

// The payload of each run as reported by the robot and used in the accounts; null if not stored or reported.
async function payloadsOf(mission, runs, signal) {
  if (runs.length > mostAsked) return null;
  const sampleOf = ({ utimeUs }) => {
    const at = query({ from_utime_us: Math.round(utimeUs), limit: 1 });
    return get(`/v1/missions/${mission.id}/telemetry${at}`, signal);
  };
  const samples = await Promise.all(runs.map(sampleOf));
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
function leastDriveRequest(mission, { runs, stoodAtEndS }, payloads) {
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

function carriedNote(mission, payloads) {
  const kg = (value) => format.text(format.unit(value, 'kg'));
  if (payloads === null)
    return `payload at the start, ${kg(mission.payload_kg ?? 0)}, on all legs: later changes are unknown`;
  const [low, high] = [Math.min(...payloads), Math.max(...payloads)];
  return low === high
    ? `payload ${kg(low)}`
    : `payload as the robot reported it on the way, ${kg(low)} to ${kg(high)}`;
}

// The service's result for the mission's legs: {least, request, payloads}.
async function readLeastDrive(mission, driven, signal) {
  const payloads = await payloadsOf(mission, driven.runs, signal);
  const request = leastDriveRequest(mission, driven, payloads);
  const path = `/v1/robots/${idPath(mission.robot_id)}/profile`;
  const least = await post(`${path}${query({ model_version: mission.model_version })}`, request, signal);
  return { least, request, payloads };
}

function Saving({ share }) {
  if (share > 0.005)
    return ['The least energy for these legs is ', <b>{format.share(share, 1)}</b>, ' below the modelled.'];
  return share > -0.005
    ? 'This drive used about as little energy as the model allows.'
    : 'Less energy than these legs need with stops between them: the robot turned while it drove.';
}

function Footnote({ mission, request, payloads, version }) {
  const sum = (key) => request.path.reduce((total, leg) => total + Math.abs(leg[key] ?? 0), 0);
  const legs = request.path.filter((leg) => leg.kind === 'straight').length;
  const stoodS = sum('duration_s');
  return (
    <p class="note foot">
      {format.count(legs, 'leg')} between stops, {format.text(format.length(mission.energy.distance_m))} in
      all, {format.fixed(format.degrees(sum('angle_rad')))}° turned at the stops,
      {stoodS > 0 ? ` ${format.span(stoodS)} at rest as in the mission,` : ''}{' '}
      {carriedNote(mission, payloads)}, arriving no later. Modelled and least energy are computed with the
      model version of the mission, {version}.
    </p>
  );
}

export function LeastEnergy({ mission, trace }) {
  const robot = useGet(`/v1/robots/${idPath(mission.robot_id)}`);
  const idlePowerW = robot.value?.model.idle_power_w;
  const driven = useMemo(
    () => (idlePowerW === undefined ? null : runsOf(mission, trace, idlePowerW)),
    [mission.id, mission.state, idlePowerW],
  );
  const key = driven && `${mission.id} ${mission.state} ${idlePowerW}`;
  const answer = useRead((signal) => readLeastDrive(mission, driven, signal), key);
  const error = robot.value === null ? robot.error : answer.error;
  if (error?.status === 422)
    return <Empty title="Not compared">The robot's model does not allow the motion that was measured.</Empty>;
  if (error !== null) return <Failure error={error} />;
  if (robot.value !== null && driven === null)
    return <Empty title="Nothing to compare">The robot did not drive, or in too many short runs.</Empty>;
  if (answer.value === null) return <Loading what="the minimum-energy drive" />;
  const e = mission.energy;
  const { least, request, payloads } = answer.value;
  const drivenS = format.span(e.duration_s);
  return (
    <>
      <p class="verdict">
        <Saving share={1 - least.energy_j / e.modelled_j} />
      </p>
      <EnergyBars
        label="Energy of the mission and of the minimum-energy drive"
        rows={[
          ['Measured', e.measured_j, 'measured', drivenS],
          ['Modelled', e.modelled_j, 'modelled', drivenS],
          ['Least energy', least.energy_j, 'least', format.span(least.duration_s)],
        ]}
      />
      <Footnote mission={mission} request={request} payloads={payloads} version={least.model_version} />
    </>
  );
}
