// Missions as rows, in the missions view and on a robot's page.
import { chargeShare, consumption, energyIn, energyScale, perMetre } from '../energy.js';
import * as format from '../format.js';
import { useModels } from '../models.js';
import { missionLink, robotLink } from '../route.js';
import { Table, column, figure } from '../table.jsx';
import { Ratio } from '../widgets.jsx';

// The states of missions, in the service's words.
export const missionStates = {
  open: 'not ended yet',
  finished: 'ended by the robot',
  aborted: 'ended early by the robot',
  unfinished: 'its end was never reported',
  superseded: 'another mission began before its end',
  interrupted: 'the service was stopped',
};

export const MissionState = ({ mission: { state } }) => (
  <span class={`state ${state}`} title={missionStates[state]}>
    {state}
  </span>
);

// The service's sort keys that differ from the column's key.
export const sortNames = { consumption: 'wh_per_km' };

function StateCell({ mission: m }) {
  const payload = m.findings?.payload;
  const flag = (on, name, title) =>
    on && (
      <span class="flag" title={title}>
        {name}
      </span>
    );
  return (
    <>
      <MissionState mission={m} />
      {flag(m.incomplete, 'incomplete', format.words(m.incomplete_reason ?? ''))}
      {flag(m.annulled, 'annulled', m.annulled?.reason)}
      {flag(m.contradictions.length > 0, 'contradicted', m.contradictions.map((c) => c.says).join(' '))}
      {flag(
        payload?.verdict === 'undeclared',
        `${format.signed(format.digits(payload?.undeclared_kg, 2))} kg payload`,
        'Difference from the declared payload, estimated from the motion',
      )}
    </>
  );
}

// The columns for `missions`, each energy column in one unit. The service sorts.
function missionColumns(missions, models, withRobot) {
  const scale = energyScale(missions.flatMap((m) => [m.energy.battery_j, m.energy.modelled_j]));
  const share = (m) => chargeShare(m.energy.charge_ah, models.get(m.robot_id));
  const columns = [
    column('start', 'Started', (m) => format.time(m.start_utime_us), { class: 'when' }),
    column('robot', 'Robot', (m) => <a href={robotLink(m.robot_id)}>{m.robot_id}</a>),
    column('mission', 'Mission', (m) => <a href={missionLink(m.id)}>{m.mission_id}</a>, {
      head: true,
    }),
    column('state', 'State', (m) => <StateCell mission={m} />, { class: 'states' }),
    figure('duration', 'Duration', (m) => format.span(m.energy.duration_s)),
    figure('distance', 'Distance', (m) => format.length(m.energy.distance_m)),
    figure('payload', 'Payload', (m) => format.unit(m.payload_kg, 'kg'), {
      class: 'figure wide',
    }),
    figure('energy', 'Energy', (m) => energyIn(scale, m.energy.battery_j)),
    figure('charge', 'Charge used', (m) => format.percent(share(m), 2), {
      hint: 'share of a full battery, if the robot file states its capacity',
    }),
    figure('modelled', 'Modelled', (m) => energyIn(scale, m.energy.modelled_j), {
      class: 'figure wide',
    }),
    figure('ratio', 'Ratio', (m) => <Ratio value={m.ratio} />, {
      hint: 'measured energy over modelled energy',
    }),
    figure('consumption', 'Consumption', (m) => consumption(perMetre(m)), {
      class: 'figure long',
      hint: 'energy over distance',
    }),
  ];
  return columns
    .filter((c) => withRobot || c.key !== 'robot')
    .map((c) => ({ ...c, sort: c.key !== 'charge' }));
}

export function MissionTable({ missions, withRobot = true, sort, onSort }) {
  const models = useModels(missions.map((m) => m.robot_id));
  const columns = missionColumns(missions, models, withRobot);
  return (
    <Table
      class="missions"
      columns={columns}
      rows={missions}
      keyOf={(m) => m.id}
      sort={sort}
      onSort={onSort}
    />
  );
}
