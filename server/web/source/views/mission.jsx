import { useEffect, useRef } from 'preact/hooks';
import { idPath, query, useGet } from '../api.js';
import { loadCharts } from '../chart.jsx';
import { chargeShare, consumption, energy } from '../energy.js';
import * as format from '../format.js';
import { useModels } from '../models.js';
import { robotLink } from '../route.js';
import { Waterfall } from '../waterfall.jsx';
import {
  Answer,
  Button,
  Empty,
  Heading,
  MissionState,
  Panel,
  Readouts,
  Texts,
  useTitleOf,
} from '../widgets.jsx';
import { LeastEnergy } from './least_energy.jsx';
import { Conditions, Findings, Record } from './record.jsx';
import { TracePanels } from './trace.jsx';

const tracePoints = 700;
const finePoints = 6000;
const renewMs = 3000; // while the mission runs

function Head({ mission: m }) {
  const reason = m.incomplete_reason ? `: ${format.words(m.incomplete_reason)}` : '';
  return (
    <Heading
      title={m.mission_id}
      crumbs={[<a href="#/missions">Missions</a>, ' / ', <a href={robotLink(m.robot_id)}>{m.robot_id}</a>]}
    >
      <MissionState mission={m} />
      {m.incomplete && <span class="flag">incomplete{reason}</span>}
      {m.findings?.payload.verdict === 'undeclared' && <span class="flag">undeclared payload</span>}
      <span class="note">{format.time(m.start_utime_us)}</span>
      <span class="spring" />
      <Button href={`#/map${query({ mission: m.id, robot: m.robot_id })}`}>Play on the map</Button>
    </Heading>
  );
}

function Contradictions({ of: list }) {
  if (list.length === 0) return null;
  return (
    <div class="failure" role="alert">
      <p>Telemetry of this mission is contradicted; its figures may be wrong.</p>
      <Texts of={list.map((c) => c.says)} />
    </div>
  );
}

function Figures({ mission: m, model }) {
  const e = m.energy;
  const { ratio } = m;
  const share = chargeShare(e.charge_ah, model);
  const unexplained = energy(e.unexplained_j);
  const modelledOnly = e.measured_j === null;
  const rows = [
    [
      modelledOnly ? 'Battery energy (modelled)' : 'Battery energy',
      energy(e.battery_j),
      share === null ? '' : `${format.share(share, 2)} of charge`,
      modelledOnly ? 'modelled' : 'measured',
    ],
    ['Modelled', energy(e.modelled_j), '', 'modelled'],
    [
      'Unexplained',
      { n: format.signed(unexplained.n), u: unexplained.u },
      ratio === null ? '' : `ratio ${format.fixed(ratio, 3)}`,
      'gap',
    ],
    ['Distance', format.length(e.distance_m)],
    ['Duration', format.span(e.duration_s)],
    ['Consumption', consumption(e.distance_m > 0.1 ? e.battery_j / e.distance_m : null)],
    ['Declared payload', format.unit(m.payload_kg, 'kg')],
  ];
  return <Readouts large rows={rows} />;
}

function Comparison({ mission: m, trace }) {
  if (m.model_version === null)
    return <Empty title="No model">The robot had no model on this mission.</Empty>;
  if (m.state === 'open') return <Empty title="Still open">Compared when the mission ends.</Empty>;
  if (m.contradictions.length > 0)
    return <Empty title="Not compared">The telemetry of this mission is contradicted.</Empty>;
  if (m.gap_s > 0)
    return (
      <Empty title="Not compared">For {format.span(m.gap_s)} of the mission there is no telemetry.</Empty>
    );
  return trace && <LeastEnergy mission={m} trace={trace} />;
}

// The service's data of a mission, read again while it runs.
function useMission(id) {
  const mission = useGet(`/v1/missions/${idPath(id)}`);
  const there = mission.value !== null;
  const part = (name) => (there ? `/v1/missions/${idPath(id)}/${name}` : null);
  const ledger = useGet(part('ledger'));
  const conditions = useGet(part('covariates'));
  const trace = useGet(part(`trace${query({ points: tracePoints })}`));
  // A long mission's path and stops need more points than a chart does.
  const merged = trace.value !== null && trace.value.start_utime_us.length >= tracePoints / 2;
  const finer = useGet(merged ? part(`trace${query({ points: finePoints })}`) : null);
  const open = mission.value?.state === 'open';
  const answers = useRef();
  answers.current = [mission, ledger, trace, conditions];
  useEffect(() => {
    if (!open) return undefined;
    // Not while a slow service answers: a new request would end the one before.
    const reload = () =>
      answers.current.some(({ loading }) => loading) || answers.current.forEach((answer) => answer.reload());
    const timer = setInterval(reload, renewMs);
    return () => clearInterval(timer);
  }, [open]);
  return { mission, ledger, conditions, trace, fine: merged ? finer.value : trace.value };
}

export function Mission({ id, given }) {
  useEffect(() => void loadCharts().catch(() => {}), []); // while the mission is read
  const { mission, ledger, conditions, trace, fine } = useMission(id);
  const robotId = mission.value?.robot_id;
  const model = useModels(robotId ? [robotId] : []).get(robotId);
  useTitleOf(mission.value?.mission_id ?? 'Mission');
  const missing = (
    <Empty title={`There is no mission ${id}`}>
      No mission of this history has that number. See <a href="#/missions">all missions</a>.
    </Empty>
  );
  return (
    <Answer of={mission} what="the mission" missing={missing}>
      {(m) => (
        <>
          <Head mission={m} />
          <Contradictions of={m.contradictions} />
          <Figures mission={m} model={model} />
          <Answer of={trace} what="the trace">
            {(value) => <TracePanels mission={m} whole={value} fine={fine ?? value} given={given} />}
          </Answer>
          <div class="columns">
            <div>
              <Panel title="Where the energy went">
                <Answer of={ledger} what="the ledger">
                  {({ ledger: l }) => (
                    <Waterfall terms={l.terms_j} total={l.battery_j} closure={l.closure_relative} />
                  )}
                </Answer>
              </Panel>
              <Panel title="Compared with the minimum-energy drive">
                <Comparison mission={m} trace={fine} />
              </Panel>
            </div>
            <div>
              <Panel title="Record">
                <Record mission={m} model={model} />
              </Panel>
              {m.findings && (
                <Panel title="Payload from the motion">
                  <Findings of={m.findings} mission={m} />
                </Panel>
              )}
              {conditions.value?.covariates.length > 0 && (
                <Panel title="Conditions">
                  <Conditions answer={conditions.value} />
                </Panel>
              )}
            </div>
          </div>
        </>
      )}
    </Answer>
  );
}
