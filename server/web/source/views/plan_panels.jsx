// The panels of a plan: its certificate, and the energy of usual profiles.
import { get, idPath, useRead } from '../api.js';
import { EnergyBars } from '../bars.jsx';
import { withinLimits } from '../baselines.js';
import { energy } from '../energy.js';
import * as format from '../format.js';
import { Facts, Failure } from '../widgets.jsx';
import { priceOfHaste } from './plan_charts.jsx';

const methods = {
  closed_form: 'closed-form formulas',
  interior_point: 'an interior-point method',
  mixed: 'several methods',
  quadrature: 'quadrature over the speed',
};

export function Certificate({ answer }) {
  const c = answer.certificate;
  const above = (c.gap_j + c.discretisation_j) / Math.abs(answer.energy_j);
  const energies = [answer.braking_j, answer.recovered_j].map((joule) => format.text(energy(joule)));
  const rows = [
    ['Computed by', methods[c.method] ?? format.words(c.method)],
    ['Excess over the optimum', above < 0.01 ? 'less than 1\u00a0%' : `at most ${format.share(above)}`],
    ['Global optimum', c.convex ? 'yes: the problem is convex' : 'not proven: the problem is not convex'],
    ['Cost of a shorter time', priceOfHaste({ ...answer, ...c }, c.shortest_time_s)],
    [
      'Shortest time',
      format.known(c.shortest_time_s)
        ? `${format.fixed(c.shortest_time_s, 2)} s, set by the robot’s limits`
        : 'not bounded',
    ],
    ['Limits reached', c.binding.length === 0 ? 'none' : c.binding.map(format.words).join(', ')],
    ['Braking', `${energies[0]}, of which ${energies[1]} is recovered`],
    ['Peak power', format.text(format.power(answer.peak_power_w))],
    ['Model', `version ${answer.model_version}`],
  ];
  return <Facts rows={rows} />;
}

async function readBaselines({ robot_id: robotId, baselines }, request, signal) {
  const robot = await get(`/v1/robots/${idPath(robotId)}`, signal);
  const question = {
    robotId,
    limits: robot.model.limits,
    payloadKg: request.payload_kg,
    mayScale: !request.path.some((leg) => leg.kind === 'payload'),
    signal,
  };
  const kinds = [baselines.trapezoid, baselines.triangle];
  return Promise.all(kinds.map((baseline) => withinLimits(baseline, question)));
}

// [trapezoid, triangle] within the robot's limits; undefined while they are computed, null if none exists.
function useBaselines(answer, request) {
  const key = JSON.stringify([answer.robot_id, request]);
  const { value, path, error } = useRead((signal) => readBaselines(answer, request, signal), key, answer);
  return { error, found: path === key && value ? value : [] };
}

function noteOf(found, plan) {
  if (found === undefined) return 'computing …';
  if (found === null) return 'not possible within the limits';
  const saved = 1 - plan.energy_j / found.energyJ;
  const by = format.share(Math.abs(saved), 1);
  const time = `${format.span(found.durationS)}${found.slowed ? ', slowed to keep the limits' : ''}`;
  return `${time}; ${saved >= 0 ? `the plan saves ${by}` : `costs ${by} less`}`;
}

export function Baselines({ answer, request }) {
  const { error, found } = useBaselines(answer, request);
  if (error) return <Failure error={error} />;
  const rows = ['Trapezoid', 'Triangle'].map((name, k) => [
    name,
    found[k]?.energyJ ?? null,
    'plain',
    noteOf(found[k], answer),
  ]);
  rows.unshift(['Least energy', answer.energy_j, 'least', format.span(answer.duration_s)]);
  return (
    <>
      <EnergyBars label="Energy of the plan, a trapezoid and a triangle within the limits" rows={rows} />
      <p class="note foot">
        Each profile on every leg between stops, in the plan’s time if the robot’s limits allow it.
      </p>
    </>
  );
}
