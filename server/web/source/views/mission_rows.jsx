// Missions as rows, in the missions view and on a robot's page.
import { chargeShare, consumption, energyIn, energyScale } from '../energy.js';
import * as format from '../format.js';
import { useModels } from '../models.js';
import { missionLink, robotLink } from '../route.js';
import { Table } from '../table.jsx';
import { MissionState, Quantity, Ratio } from '../widgets.jsx';

export const ratioOf = ({ measured_j: measured, modelled_j: modelled }) =>
  measured !== null && modelled !== 0 ? measured / modelled : null;

const perMetre = (m) => (m.energy.distance_m > 0.1 ? m.energy.battery_j / m.energy.distance_m : null);

function StateCell({ mission: m }) {
  const payload = m.findings?.payload;
  return (
    <>
      <MissionState mission={m} />
      {m.incomplete && (
        <span class="flag" title={m.incomplete_reason ? format.words(m.incomplete_reason) : ''}>
          incomplete
        </span>
      )}
      {m.annulled && (
        <span class="flag" title={m.annulled.reason}>
          annulled
        </span>
      )}
      {m.contradictions.length > 0 && (
        <span class="flag" title={m.contradictions.map((c) => c.says).join(' ')}>
          contradicted
        </span>
      )}
      {payload?.verdict === 'undeclared' && (
        <span class="flag" title="Undeclared payload, estimated from the motion">
          {format.signed(format.digits(payload.undeclared_kg, 2))} kg undeclared
        </span>
      )}
    </>
  );
}

// The columns for `missions`, each energy column in one unit.
export function missionColumns(missions, models, withRobot) {
  const scale = energyScale(missions.flatMap((m) => [m.energy.battery_j, m.energy.modelled_j]));
  const share = (m) => chargeShare(m.energy.charge_ah, models.get(m.robot_id));
  const columns = [
    {
      key: 'start',
      title: 'Started',
      class: 'when',
      sort: (m) => m.start_utime_us,
      cell: (m) => format.time(m.start_utime_us),
    },
    {
      key: 'robot',
      title: 'Robot',
      sort: (m) => m.robot_id,
      cell: (m) => <a href={robotLink(m.robot_id)}>{m.robot_id}</a>,
    },
    {
      key: 'mission',
      title: 'Mission',
      head: true,
      sort: (m) => m.mission_id,
      cell: (m) => <a href={missionLink(m.id)}>{m.mission_id}</a>,
    },
    {
      key: 'state',
      title: 'State',
      class: 'states',
      sort: (m) => m.state,
      cell: (m) => <StateCell mission={m} />,
    },
    {
      key: 'duration',
      title: 'Duration',
      class: 'figure',
      sort: (m) => m.energy.duration_s,
      cell: (m) => format.span(m.energy.duration_s),
    },
    {
      key: 'distance',
      title: 'Distance',
      class: 'figure',
      sort: (m) => m.energy.distance_m,
      cell: (m) => <Quantity of={format.length(m.energy.distance_m)} />,
    },
    {
      key: 'payload',
      title: 'Payload',
      class: 'figure wide',
      sort: (m) => m.payload_kg,
      cell: (m) => <Quantity of={format.unit(m.payload_kg, 'kg')} />,
    },
    {
      key: 'energy',
      title: 'Energy',
      class: 'figure',
      sort: (m) => m.energy.battery_j,
      cell: (m) => <Quantity of={energyIn(scale, m.energy.battery_j)} />,
    },
    {
      key: 'charge',
      title: 'Of charge',
      class: 'figure',
      hint: 'part of the full battery, where its capacity is known',
      sort: share,
      cell: (m) => <Quantity of={format.percent(share(m), 2)} />,
    },
    {
      key: 'modelled',
      title: 'Modelled',
      class: 'figure wide',
      sort: (m) => m.energy.modelled_j,
      cell: (m) => <Quantity of={energyIn(scale, m.energy.modelled_j)} />,
    },
    {
      key: 'ratio',
      title: 'Ratio',
      class: 'figure',
      hint: 'measured energy over modelled energy',
      sort: (m) => ratioOf(m.energy),
      cell: (m) => <Ratio value={ratioOf(m.energy)} />,
    },
    {
      key: 'consumption',
      title: 'Consumption',
      class: 'figure',
      hint: 'energy over distance',
      sort: perMetre,
      cell: (m) => <Quantity of={consumption(perMetre(m))} />,
    },
  ];
  return withRobot ? columns : columns.filter((c) => c.key !== 'robot');
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
