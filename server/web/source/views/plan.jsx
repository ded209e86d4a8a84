import { useEffect, useMemo, useState } from 'preact/hooks';
import { idPath, post, useRead } from '../api.js';
import { consumption, energy } from '../energy.js';
import * as drive from '../drive_path.js';
import { FloorPath } from '../floor.jsx';
import * as format from '../format.js';
import { useLive, useModelled } from '../live.js';
import { keepInAddress } from '../route.js';
import { Waterfall } from '../waterfall.jsx';
import { Button, Empty, Failure, Loading, Panel, Readouts } from '../widgets.jsx';
import { DrawPath, PlanForm } from './plan_form.jsx';
import { Baselines, Certificate, Front, PlanVerdict, SpeedChart } from './plan_panels.jsx';

const frontPoints = 24;
const firstLegs = 'straight:6,turn:90,straight:4';
const firstPoints = '-5:-2,2:-2,2:2.5,5:2.5';

const number = (text) => (text === '' ? undefined : Number(text));

// The request of the plan, read from the address and kept there.
function useQuestion(address, robots) {
  const [given, setGiven] = useState({
    robot: address.robot ?? '',
    way: address.points ? 'draw' : 'legs',
    legs: drive.legsFrom(address.path) ?? drive.legsFrom(firstLegs),
    points: drive.pointsFrom(address.points) ?? drive.pointsFrom(firstPoints),
    payload: address.payload ?? '',
    deadline: address.deadline ?? '',
    value: address.value ?? '',
    charge: address.charge ?? '',
  });
  const change = (part) => {
    const next = { ...given, ...part };
    setGiven(next);
    const { way, legs, points, ...terms } = next;
    const path = drive.legsText(legs);
    keepInAddress({
      ...terms,
      path: way === 'legs' && path !== firstLegs ? path : '',
      points: way === 'draw' ? drive.pointsText(points) : '',
    });
  };
  return [{ ...given, robot: robots.includes(given.robot) ? given.robot : (robots[0] ?? '') }, change];
}

const requestOf = (given) => ({
  ...(given.way === 'draw' ? drive.pathOfPoints(given.points) : { path: given.legs.map(drive.segmentOf) }),
  payload_kg: number(given.payload),
  deadline_s: number(given.deadline),
  value_of_time_w: number(given.value),
  pareto_points: frontPoints,
  baseline_columns: true,
});

// The forecast for the same plan: a plan with a deadline is optimal for the value of time in its certificate.
const autonomyRequest = (request, answer, charge) => ({
  state_of_charge: charge === undefined ? undefined : charge / 100,
  payload_kg: request.payload_kg ?? 0,
  start_pose: request.start_pose ?? { x_m: 0, y_m: 0, heading_rad: 0 },
  value_of_time_w: Math.min(1e6, answer.certificate.time_multiplier_w),
  tasks: [{ task_id: 'this drive', path: request.path }],
});

const noPath = Object.assign(new Error('Draw at least two points.'), { title: 'No path yet' });
const robotPath = (robot) => `/v1/robots/${idPath(robot)}`;

async function readPlan(asked, signal) {
  if (asked.way === 'draw' && asked.points.length < 2) throw noPath;
  const request = requestOf(asked);
  return { asked, request, answer: await post(`${robotPath(asked.robot)}/profile`, request, signal) };
}

// {answer, asked, error, busy, autonomy, compute}; `asked` contains the parameters of the answer.
function usePlan() {
  const live = useLive();
  const [wanted, compute] = useState(null);
  const { value, error, loading } = useRead((signal) => readPlan(wanted, signal), wanted && 'plan', wanted);
  const { asked, request, answer } = value ?? {};
  const charge = asked && number(asked.charge);
  const known = asked && (charge ?? live.robots.get(asked.robot)?.state.state_of_charge ?? null) !== null;
  const readAutonomy = (signal) =>
    post(`${robotPath(asked.robot)}/autonomy`, autonomyRequest(request, answer, charge), signal);
  const key = known ? JSON.stringify(asked) : null;
  const autonomy = useRead(readAutonomy, key, answer);
  const current = autonomy.path === key && autonomy;
  return {
    answer: answer ?? null,
    asked,
    error,
    busy: loading,
    autonomy: { value: current?.value ?? null, error: current?.error ?? null, busy: known },
    compute: (given) => compute({ ...given }),
  };
}

function Result({ plan, path, take }) {
  const { answer } = plan;
  const driven = useMemo(
    () => answer.profile.x_m.map((x, k) => [x, answer.profile.y_m[k], answer.profile.power_w[k]]),
    [answer],
  );
  return (
    <>
      <PlanVerdict answer={answer} autonomy={plan.autonomy} />
      <Readouts
        large
        rows={[
          ['Least energy', energy(answer.energy_j), '', 'accent'],
          ['Duration', format.span(answer.duration_s)],
          ['Distance', format.length(answer.distance_m)],
          ['Top speed', format.unit(answer.peak_speed_m_s, 'm/s', 2)],
          ['Consumption', consumption(answer.distance_m > 0 ? answer.energy_j / answer.distance_m : null)],
        ]}
      />
      <div class="columns">
        <div>
          <Panel class="screen" title="Speed and power">
            <SpeedChart answer={answer} />
          </Panel>
          <Panel title="Compared with usual profiles">
            <Baselines answer={answer} />
          </Panel>
          <Panel title="Where the energy goes">
            <Waterfall terms={answer.ledger_j} total={answer.energy_j} measured={false} />
          </Panel>
        </div>
        <div>
          <Panel class="screen" title="Path">
            <FloorPath
              points={driven}
              under={path}
              height={340}
              label="The planned path, coloured by power; circle: start, square: end"
            />
          </Panel>
          <Panel class="screen" title="Energy against time">
            <Front answer={answer} take={take} />
          </Panel>
          <Panel title="Accuracy of the plan">
            <Certificate answer={answer} />
          </Panel>
        </div>
      </div>
    </>
  );
}

function ResultArea({ plan, given, change }) {
  const { way, legs, points } = given;
  const path = useMemo(
    () => (way === 'legs' ? drive.pointsOfLegs(legs).filter(([x, y]) => Number.isFinite(x + y)) : points),
    [way, legs, points],
  );
  const outdated = plan.answer !== null && JSON.stringify(plan.asked) !== JSON.stringify(given);
  const take = ({ duration_s: durationS }) => {
    const next = { ...given, deadline: String(Math.ceil(durationS * 100) / 100) };
    change({ deadline: next.deadline });
    plan.compute(next);
  };
  return (
    <div class="plan-result" aria-live="polite" aria-busy={String(plan.busy)}>
      {plan.error && <Failure error={plan.error} />}
      {way === 'draw' && (
        <Panel class="screen" title="Draw the path">
          <DrawPath points={points} change={(next) => change({ points: next })} />
        </Panel>
      )}
      {plan.answer === null && plan.error === null && <Loading what="the plan" />}
      {outdated && !plan.busy && (
        <div class="verdict-box outdated" role="status">
          <b>Out of date.</b> The path or the terms have changed since this was computed.{' '}
          <Button onClick={() => plan.compute(given)}>Compute again</Button>
        </div>
      )}
      {plan.answer !== null && (
        <div class={plan.busy || outdated ? 'stale' : ''}>
          <Result plan={plan} path={outdated ? path : null} take={take} />
        </div>
      )}
      {way === 'legs' && plan.answer === null && path.length > 1 && (
        <Panel class="screen" title="Path">
          <FloorPath points={path.map(([x, y]) => [x, y, NaN])} label="The path that was entered" />
        </Panel>
      )}
    </div>
  );
}

export function Plan({ given: address }) {
  const live = useLive();
  const robots = useModelled();
  const [given, change] = useQuestion(address, robots);
  const plan = usePlan();
  useEffect(() => {
    if (given.robot !== '') plan.compute(given);
  }, [given.robot]);
  if (!live.loaded) return <Loading what="the fleet" />;
  if (robots.length === 0)
    return (
      <>
        <h1>Plan</h1>
        <Empty title="No robot has a model">
          <a href="#/robot-file">Add a robot</a> to plan with it.
        </Empty>
      </>
    );
  const fault = /^\/path\/(\d+)/.exec(plan.error?.field ?? '');
  return (
    <>
      <h1 class="hidden">Plan</h1>
      <div class="plan">
        <PlanForm
          given={given}
          robots={robots}
          change={change}
          busy={plan.busy}
          fault={fault ? Number(fault[1]) : null}
          onCompute={() => plan.compute(given)}
        />
        <ResultArea plan={plan} given={given} change={change} />
      </div>
    </>
  );
}
