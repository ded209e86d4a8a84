import { useEffect, useState } from 'preact/hooks';
import { idPath, post, query, useGet } from '../api.js';
import { ConfirmButton } from '../dialog.jsx';
import { energy } from '../energy.js';
import { FloorPath, powerAt, rowsOf } from '../floor.jsx';
import * as format from '../format.js';
import * as health from '../health.jsx';
import { showRecent, useLive } from '../live.js';
import { missionLink } from '../route.js';
import { Button, Empty, Facts, Failure, Heading, Panel, Readouts, useTitleOf } from '../widgets.jsx';
import { flat } from './changes.jsx';
import { Field } from './choosing.jsx';
import { Events, useEvents } from './audit.jsx';
import { ownPart } from './fleet.jsx';
import { MissionTable } from './missions.jsx';
import { Proposals, RobotHistory } from './robot_history.jsx';

const recentRows = 12;
const recentEvents = 12;

function whyNowhere(state) {
  if (!state.has_model)
    return 'Telemetry of a robot without a model, including its position, is counted but not stored.';
  return state.live ? 'This robot does not report its position.' : 'None since the service started.';
}

// The map of the robot's path: the open mission's trace where the mission began before the oldest live
// position, then the live positions. The trace of a mission that has just begun may not be stored yet.
function LiveMap({ entry }) {
  const mission = entry.state.mission?.id;
  const oldest = entry.path.last()[0]?.[0] ?? Infinity;
  const earlier = mission && entry.state.mission.start_utime_us < oldest;
  const begun = useGet(earlier ? `/v1/missions/${mission}/trace?points=600` : null);
  const live = entry.path.last();
  const trace = mission && begun.value?.id === mission ? begun.value : null;
  const before = trace ? rowsOf(trace, (k) => powerAt(trace, k) ?? NaN) : [];
  const rows = [...before, ...live.map(([, x, y, w]) => [x, y, w])];
  const [x, y, heading] = entry.state.pose;
  if (rows.length === 0 || x === null) return <Empty title="No position">{whyNowhere(entry.state)}</Empty>;
  return (
    <FloorPath
      points={rows}
      height={340}
      robot={[x, y, heading ?? 0]}
      label={`Path of ${entry.id} so far, coloured by power, and where it is now`}
    />
  );
}

function Now({ entry }) {
  const s = entry.state;
  const [name, kind] = s.measured_power_w === null ? ['Power (modelled)', 'modelled'] : ['Power', 'measured'];
  const trace = <health.Sparkline track={entry.power} width={90} height={26} />;
  const voltage = s.battery_voltage_v === null ? '' : format.text(format.unit(s.battery_voltage_v, 'V', 2));
  const charge = s.state_of_charge === null ? '' : health.chargeNote(s).text;
  const { mission: m } = s;
  const link = m && <a href={missionLink(m.id)}>{ownPart(m.mission_id, entry.id)}</a>;
  const toCharge = s.charge.time_to_charged_s;
  const [right, left] = s.winding_temperature_c;
  const rows = [
    [name, format.power(health.powerNow(s)), trace, kind],
    ['Charge', format.percent(s.state_of_charge), [charge, voltage].filter(Boolean).join(' · ')],
    ['Range', format.length(s.range_m), health.between(s.range_quantiles_m, format.lengthBand)],
    ['Run time', format.about(s.run_time_s), health.between(s.run_time_quantiles_s, format.spanBand)],
    s.charging === null &&
      format.known(toCharge) && ['Time to charge', format.about(toCharge), 'if it started now'],
    ['Speed', format.unit(health.now(s, s.speed_m_s), 'm/s', 2)],
    ['Payload', format.unit(s.payload_kg, 'kg')],
    right !== null && ['Windings, right · left', `${format.fixed(right)} · ${format.fixed(left)} °C`],
    ['Mission', energy(m?.energy.battery_j), link ?? 'none open'],
  ];
  return (
    <>
      <Readouts large rows={rows} />
      {s.charge.limitation && <p class="note foot">{s.charge.limitation}</p>}
    </>
  );
}

function SilenceNote({ state }) {
  if (health.unheard(state))
    return <p class="note">No telemetry since the service started. Its history is below.</p>;
  if (state.live) return null;
  return (
    <p class="note">
      Silent since {health.since(state.heardUs)}: its power and speed are unknown. The other values are the
      last ones received.
    </p>
  );
}

function RecentMissions({ id, running }) {
  const missions = useGet(`/v1/missions${query({ robot_id: id, limit: recentRows })}`, running);
  return (
    <Panel
      title="Recent missions"
      aside={<a href={`#/missions${query({ robot: id })}`}>All missions of {id}</a>}
      of={missions}
      what="missions"
      from={(page) => page.missions}
      none="No mission yet"
    >
      {(rows) => <MissionTable missions={rows} withRobot={false} />}
    </Panel>
  );
}

function RecentEvents({ id }) {
  const events = useEvents(id, recentEvents);
  return (
    <Panel
      title="Log"
      aside={<a href={`#/audit${query({ robot: id })}`}>All of {id}</a>}
      of={events}
      what="the log"
      from={({ entries }) => entries}
      none="No events yet"
    >
      {(rows) => <Events events={rows} withRobot={false} />}
    </Panel>
  );
}

// The acknowledgement of a reason for attention, or the button for it.
function Acknowledge({ robot, reason, onChange, onError }) {
  const { kind, acknowledged: by } = reason;
  if (by)
    return (
      <span class="note">
        Acknowledged{by.by ? ` by ${by.by}` : ''} {format.minute(by.utime_us)}
        {by.note && `: ${by.note}`}
      </span>
    );
  const send = ({ note }) =>
    post(`/v1/robots/${idPath(robot)}/acknowledge`, { kind, note }).then(onChange, onError);
  return (
    <ConfirmButton
      class="plain"
      label="Acknowledge"
      title={`Acknowledge: ${format.words(kind)}`}
      needs="operate"
      onConfirm={send}
    >
      <p>{reason.message} It no longer counts as needing attention until this condition ends.</p>
      <Field label="Note">
        <input type="text" name="note" maxlength="250" />
      </Field>
    </ConfirmButton>
  );
}

// What needs the robot's model: its gap, versions and proposals.
function WithModel({ id, detail }) {
  const [turn, setTurn] = useState(0);
  if (detail.error?.status === 404)
    return (
      <Panel title="Model">
        <Empty title="No robot file">
          <a href={`#/robot-file${query({ robot: id })}`}>Add its robot file</a> to record and model its
          energy. Until then its telemetry is only counted.
        </Empty>
      </Panel>
    );
  const changed = () => {
    detail.reload();
    setTurn(turn + 1);
  };
  return (
    <>
      <Proposals id={id} inForce={detail.value} turn={turn} onChange={changed} />
      <RobotHistory id={id} turn={turn} onChange={changed} />
    </>
  );
}

export function Robot({ id }) {
  useTitleOf(id);
  const live = useLive();
  const [turn, setTurn] = useState(0);
  const [failure, setFailure] = useState(null);
  const attention = health.useAttention(turn);
  const detail = useGet(`/v1/robots/${idPath(id)}`);
  const entry = live.robots.get(id);
  const s = entry?.state;
  const heard = s && !health.unheard(s);
  const { robot_id: _, ...parameters } = flat(detail.value?.model ?? {});
  useEffect(() => {
    if (entry) showRecent([entry]);
  }, [entry, live.loads]);
  if (!s && live.loaded && detail.error?.status === 404)
    return (
      <Empty title={`There is no robot ${id}`}>
        See the <a href="#/fleet">fleet</a>.
      </Empty>
    );
  return (
    <>
      <Heading title={id} crumbs={<a href="#/fleet">Fleet</a>}>
        {s && (
          <span class="row wrap health" style={{ gap: '2px 12px', fontSize: '14px' }}>
            <health.Health state={s} />
          </span>
        )}
        <span class="spring" />
        {s?.has_model && <Button href={`#/robot-file/${idPath(id)}`}>Edit</Button>}
        <Button href={`#/plan${query({ robot: id })}`}>Plan a drive</Button>
      </Heading>
      {s && <SilenceNote state={s} />}
      <health.Reasons
        of={attention.get(id)}
        more={(reason) => (
          <Acknowledge robot={id} reason={reason} onChange={() => setTurn(turn + 1)} onError={setFailure} />
        )}
      />
      {failure && <Failure error={failure} />}
      {heard && <Now entry={entry} />}
      {(s || detail.value) && <WithModel id={id} detail={detail} />}
      <RecentMissions id={id} running={s?.mission?.id} />
      <div class="columns">
        {heard ? (
          <Panel class="screen" title={s.live ? 'Position' : 'Last known position'}>
            <LiveMap entry={entry} />
          </Panel>
        ) : (
          <RecentEvents id={id} />
        )}
        <div>
          {heard && <RecentEvents id={id} />}
          <Panel title="Model">
            {detail.value ? (
              <details class="model">
                <summary>Parameters in force</summary>
                <Facts rows={Object.entries(parameters).map(([key, value]) => [<code>{key}</code>, value])} />
              </details>
            ) : (
              <p class="note">none</p>
            )}
          </Panel>
        </div>
      </div>
    </>
  );
}
