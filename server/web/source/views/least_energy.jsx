// A mission compared with the minimum-energy drive of the same legs.
import { useMemo } from 'preact/hooks';
import { idPath, post, query, useGet, useRead } from '../api.js';
import { EnergyBars } from '../bars.jsx';
import * as format from '../format.js';
import { drivenRuns, leastDriveRequest, payloadsOf } from '../least_drive.js';
import { Empty, Failure, Loading } from '../widgets.jsx';

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
    return (
      <>
        The same legs could have been driven for <b>{format.share(share, 1)}</b> less.
      </>
    );
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
      {carriedNote(mission, payloads)}, arriving no later. Both energies are computed with model version{' '}
      {version}, that of the mission.
    </p>
  );
}

export function LeastEnergy({ mission, trace }) {
  const robot = useGet(`/v1/robots/${idPath(mission.robot_id)}`);
  const idlePowerW = robot.value?.model.idle_power_w;
  const driven = useMemo(
    () => (idlePowerW === undefined ? null : drivenRuns(mission, trace, idlePowerW)),
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
