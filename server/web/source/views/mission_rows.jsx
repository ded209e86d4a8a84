// Missions as rows, in the missions view and on a robot's page.
import { chargeShare, consumption, energyIn, energyScale } from '../energy.js';
import * as format from '../format.js';
import { useModels } from '../models.js';
import { missionLink, robotLink } from '../route.js';
import { Table } from '../table.jsx';
import { MissionState, Quantity, Ratio } from '../widgets.jsx';

// The service's sort keys that differ from the column's key.
export const sortNames = { consumption: 'wh_per_km' };

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
        <span class="flag" title="Difference from the declared payload, estimated from the motion">
          {format.signed(format.digits(payload.undeclared_kg, 2))} kg payload
        </span>
      )}
    </>
  );
}

// The columns for `missions`, each energy column in one unit. The service sorts.
export function missionColumns(missions, models, withRobot) {
  const scale = energyScale(missions.flatMap((m) => [m.energy.battery_j, m.energy.modelled_j]));
  const share = (m) => chargeShare(m.energy.charge_ah, models.get(m.robot_id));
  const columns = [
    {
      key: 'start',
      title: 'Started',
      class: 'when',
      sort: true,
      cell: (m) => format.time(m.start_utime_us),
    },
    {
      key: 'robot',
      title: 'Robot',
      sort: true,
      cell: (m) => <a href={robotLink(m.robot_id)}>{m.robot_id}</a>,
    },
    {
      key: 'mission',
      title: 'Mission',
      head: true,
      sort: true,
      cell: (m) => <a href={missionLink(m.id)}>{m.mission_id}</a>,
    },
    {
      key: 'state',
      title: 'State',
      class: 'states',
      sort: true,
      cell: (m) => <StateCell mission={m} />,
    },
    {
      key: 'duration',
      title: 'Duration',
      class: 'figure',
      sort: true,
      cell: (m) => format.span(m.energy.duration_s),
    },
    {
      key: 'distance',
      title: 'Distance',
      class: 'figure',
      sort: true,
      cell: (m) => <Quantity of={format.length(m.energy.distance_m)} />,
    },
    {
      key: 'payload',
      title: 'Payload',
      class: 'figure wide',
      sort: true,
      cell: (m) => <Quantity of={format.unit(m.payload_kg, 'kg')} />,
    },
    {
      key: 'energy',
      title: 'Energy',
      class: 'figure',
      sort: true,
      cell: (m) => <Quantity of={energyIn(scale, m.energy.battery_j)} />,
    },
    {
      key: 'charge',
      title: 'Of charge',
      class: 'figure',
      hint: 'share of the full battery, if the robot file states its capacity',
      cell: (m) => <Quantity of={format.percent(share(m), 2)} />,
    },
    {
      key: 'modelled',
      title: 'Modelled',
      class: 'figure wide',
      sort: true,
      cell: (m) => <Quantity of={energyIn(scale, m.energy.modelled_j)} />,
    },
    {
      key: 'ratio',
      title: 'Ratio',
      class: 'figure',
      hint: 'measured energy over modelled energy',
      sort: true,
      cell: (m) => <Ratio value={m.ratio} />,
    },
    {
      key: 'consumption',
      title: 'Consumption',
      class: 'figure long',
      hint: 'energy over distance',
      sort: true,
      cell: (m) => <Quantity of={consumption(m.wh_per_km === null ? null : 3.6 * m.wh_per_km)} />,
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
