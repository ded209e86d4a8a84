import { useEffect } from 'preact/hooks';
import { idPath, query, useEvery, useGet } from '../api.js';
import { loadCharts } from '../chart.jsx';
import { chargeShare, consumption, energy } from '../energy.js';
import * as format from '../format.js';
import { useModels } from '../models.js';
import { robotLink } from '../route.js';
import { Waterfall } from '../waterfall.jsx';
import { Answer, Button, Empty, Facts, Heading, Panel, Readouts, Texts, useTitleOf } from '../widgets.jsx';
import { LeastEnergy } from './least_energy.jsx';
import { MissionState } from './missions.jsx';
import { TracePanels } from './trace.jsx';

const joined = (parts) => parts.filter(Boolean).join(' · ');
const sides = ([right, left]) =>
  right === null ? '–' : `right ${format.text(energy(right))}, left ${format.text(energy(left))}`;

function chargeOf({ energy: { charge_ah: ah } }, model) {
  const share = chargeShare(ah, model);
  return joined([
    format.text(format.unit(ah * 1000, 'mAh')),
    share !== null && `${format.share(share, 2)} of the full battery`,
  ]);
}

function Record({ mission: m, model }) {
  const e = m.energy;
  const faults = Object.entries(m.sample_faults).map(([reason, n]) => `${n} ${format.words(reason)}`);
  const rows = [
    ['Robot', <a href={robotLink(m.robot_id)}>{m.robot_id}</a>],
    ['Started', format.time(m.start_utime_us)],
    [m.state === 'open' ? 'Last sample' : 'Ended', format.time(m.end_utime_us)],
    ['Announced', m.implicit ? 'no: opened by its telemetry' : 'by the robot'],
    ['Model', m.model_version === null ? 'none' : `version ${m.model_version}`],
    ['Samples', format.fixed(m.samples)],
    ['Interruptions', m.gap_count === 0 ? 'none' : `${m.gap_count}, ${format.span(m.gap_s)} in all`],
    ['Faulty samples', faults.length === 0 ? 'none' : faults.join(', ')],
    ['Battery measured', `${format.span(e.measured_s)} of ${format.span(e.duration_s)}`],
    ['Drawn · returned', joined([format.text(energy(e.drawn_j)), format.text(energy(e.returned_j))])],
    ['Charge', chargeOf(m, model)],
    ['Motors measured', sides(e.measured_motor_j)],
    ['Motors modelled', sides(e.modelled_motor_j)],
    m.annulled && ['Annulled', m.annulled.reason],
    m.note && ['Note', m.note],
  ];
  return <Facts rows={rows} />;
}

const payloadVerdicts = {
  as_declared: () => 'as declared',
  undeclared: (p) => `${p.undeclared_kg < 0 ? 'less' : 'more'} than declared`,
  inseparable: () =>
    'not distinguishable from friction and slope with this motion, or the robot is lighter than in its file',
};

// Payload and friction estimated from the motion of this mission.
function Findings({ of: f, mission }) {
  const p = f.payload;
  const flag = <span class="flag">undeclared payload</span>;
  const unknown = mission.payload_kg === null && p.declared_kg === 0;
  const assumed = <span class="note">taken as 0 kg</span>;
  const rows = [
    ['Payload', [payloadVerdicts[p.verdict](p), ' ', p.verdict === 'undeclared' && flag]],
    ['Declared, mean', unknown ? ['– ', assumed] : format.text(format.unit(p.declared_kg, 'kg'))],
    ['Difference from declared', `${format.withDeviation(p.undeclared_kg, p.undeclared_sd_kg)}\u00a0kg`],
    ['Used for refinement', f.learned_from ? 'yes' : 'no: held out for back-tests'],
  ];
  return <Facts rows={rows} />;
}

// Rows of the values of each covariate: of labels the words, of numbers their range.
function conditionsOf(covariates) {
  const labels = new Map();
  const numbers = [];
  for (const { name, value } of covariates) {
    const known = value.filter((v) => v !== null);
    const at = name.indexOf('=');
    if (known.length === 0) continue;
    if (at > 0) {
      const label = name.slice(0, at);
      if (known.some((v) => v !== 0)) labels.set(label, [...(labels.get(label) ?? []), name.slice(at + 1)]);
    } else {
      const digits = (v) => `${Number(v.toPrecision(4))}`;
      const [least, most] = [Math.min(...known), Math.max(...known)];
      const range = `${digits(least)} to ${digits(most)}, ${known.length} changes`;
      numbers.push([name, least === most ? digits(least) : range]);
    }
  }
  const rows = [...[...labels].map(([name, words]) => [name, words.join(', ')]), ...numbers];
  return rows.map(([name, values]) => [format.words(name), values]);
}

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

function Figures({ mission: m, model }) {
  const e = m.energy;
  const [name, kind] =
    e.measured_j === null ? ['Battery energy (modelled)', 'modelled'] : ['Battery energy', 'measured'];
  const share = chargeShare(e.charge_ah, model);
  const ratio = m.ratio === null ? '' : `ratio ${format.fixed(m.ratio, 3)}`;
  const rows = [
    [name, energy(e.battery_j), share === null ? '' : `${format.share(share, 2)} of charge`, kind],
    ['Modelled', energy(e.modelled_j), '', 'modelled'],
    ['Unexplained', format.withSign(energy(e.unexplained_j)), ratio, 'gap'],
    ['Distance', format.length(e.distance_m)],
    ['Duration', format.span(e.duration_s)],
    ['Consumption', consumption(e.distance_m > 0.1 ? e.battery_j / e.distance_m : null)],
    ['Declared payload', format.unit(m.payload_kg, 'kg')],
  ];
  return <Readouts large rows={rows} />;
}

function Comparison({ mission: m, trace }) {
  const uncompared = (why, title = 'Not compared') => <Empty title={title}>{why}</Empty>;
  if (m.model_version === null) return uncompared('The robot had no model on this mission.', 'No model');
  if (m.state === 'open') return uncompared('Compared when the mission ends.', 'Still open');
  if (m.contradictions.length > 0) return uncompared('The telemetry of this mission is contradicted.');
  if (m.gap_s > 0) return uncompared(`For ${format.span(m.gap_s)} of the mission there is no telemetry.`);
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
  const answers = [mission, ledger, trace, conditions];
  // Not while a slow service answers: a new request would end the one before.
  useEvery(open && renewMs, () => {
    if (!answers.some(({ loading }) => loading)) answers.forEach((answer) => answer.reload());
  });
  return { mission, ledger, conditions, trace, fine: merged ? finer.value : trace.value };
}

export function Mission({ id, given }) {
  useEffect(() => void loadCharts().catch(() => {}), []); // while the mission is read
  const { mission, ledger, conditions, trace, fine } = useMission(id);
  const robotId = mission.value?.robot_id;
  const model = useModels(robotId ? [robotId] : []).get(robotId);
  const { covariates = [], next_cursor: more } = conditions.value ?? {};
  const counted = covariates.reduce((n, c) => n + c.value.length, 0);
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
          {m.contradictions.length > 0 && (
            <div class="failure" role="alert">
              <p>Telemetry of this mission is contradicted; its figures may be wrong.</p>
              <Texts of={m.contradictions.map((c) => c.says)} />
            </div>
          )}
          <Figures mission={m} model={model} />
          <Answer of={trace} what="the trace">
            {(value) => <TracePanels mission={m} whole={value} fine={fine ?? value} given={given} />}
          </Answer>
          <div class="columns">
            <div>
              <Panel title="Where the energy went" of={ledger} what="the ledger" from={(l) => l.ledger}>
                {(l) => <Waterfall terms={l.terms_j} total={l.battery_j} closure={l.closure_relative} />}
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
              {covariates.length > 0 && (
                <Panel title="Conditions">
                  <Facts rows={conditionsOf(covariates)} />
                  {more !== null && <p class="note foot">Of the first {counted} changes.</p>}
                </Panel>
              )}
            </div>
          </div>
        </>
      )}
    </Answer>
  );
}
