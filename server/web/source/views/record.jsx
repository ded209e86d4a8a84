// The record of a mission apart from its energy: facts, conditions, and the payload estimated from its
// motion.
import { chargeShare, energy } from '../energy.js';
import * as format from '../format.js';
import { robotLink } from '../route.js';

const Row = ({ name, children }) => (
  <tr>
    <th scope="row">{name}</th>
    <td>{children}</td>
  </tr>
);

const joined = (parts) => parts.filter(Boolean).join(' · ');
const sides = ([right, left]) =>
  right === null ? '–' : `right ${format.text(energy(right))}, left ${format.text(energy(left))}`;

function Charge({ mission, model }) {
  const ah = mission.energy.charge_ah;
  const share = chargeShare(ah, model);
  return joined([
    format.text(format.unit(ah * 1000, 'mAh')),
    share !== null && `${format.text(format.percent(share, 2))} of the full battery`,
  ]);
}

export function Facts({ mission, model }) {
  const e = mission.energy;
  const faults = Object.entries(mission.sample_faults).map(([reason, n]) => `${n} ${format.words(reason)}`);
  return (
    <table class="facts">
      <tbody>
        <Row name="Robot">
          <a href={robotLink(mission.robot_id)}>{mission.robot_id}</a>
        </Row>
        <Row name="Started">{format.time(mission.start_utime_us)}</Row>
        <Row name={mission.state === 'open' ? 'Last sample' : 'Ended'}>
          {format.time(mission.end_utime_us)}
        </Row>
        <Row name="Announced">{mission.implicit ? 'no: opened by its telemetry' : 'by the robot'}</Row>
        <Row name="Model">{mission.model_version === null ? 'none' : `version ${mission.model_version}`}</Row>
        <Row name="Samples">{format.fixed(mission.samples)}</Row>
        <Row name="Interruptions">
          {mission.gap_count === 0 ? 'none' : `${mission.gap_count}, ${format.span(mission.gap_s)} in all`}
        </Row>
        <Row name="Faulty samples">{faults.length === 0 ? 'none' : faults.join(', ')}</Row>
        <Row name="Battery measured">
          {format.span(e.measured_s)} of {format.span(e.duration_s)}
        </Row>
        <Row name="Drawn · returned">
          {joined([format.text(energy(e.drawn_j)), format.text(energy(e.returned_j))])}
        </Row>
        <Row name="Charge">
          <Charge mission={mission} model={model} />
        </Row>
        <Row name="Motors measured">{sides(e.measured_motor_j)}</Row>
        <Row name="Motors modelled">{sides(e.modelled_motor_j)}</Row>
        {mission.annulled && <Row name="Annulled">{mission.annulled.reason}</Row>}
        {mission.note && <Row name="Note">{mission.note}</Row>}
      </tbody>
    </table>
  );
}

const payloadVerdicts = {
  as_declared: () => 'as declared',
  undeclared: (p) => `${p.undeclared_kg < 0 ? 'less' : 'more'} than declared`,
  inseparable: () => 'not distinguishable from friction and slope with this motion',
};

// Payload and friction estimated from the motion of this mission.
export function Findings({ of: f, mission }) {
  const p = f.payload;
  return (
    <table class="facts">
      <tbody>
        <Row name="Payload">
          {payloadVerdicts[p.verdict](p)}{' '}
          {p.verdict === 'undeclared' && <span class="flag">undeclared payload</span>}
        </Row>
        <Row name="Declared, mean">
          {mission.payload_kg === null && p.declared_kg === 0 ? (
            <>
              – <span class="note">taken as 0 kg</span>
            </>
          ) : (
            format.text(format.unit(p.declared_kg, 'kg'))
          )}
        </Row>
        <Row name="Difference from declared">
          {format.withDeviation(p.undeclared_kg, p.undeclared_sd_kg)}
          {'\u00a0'}kg
        </Row>
        <Row name="Used for learning">{f.learned_from ? 'yes' : 'no: kept for back-tests'}</Row>
        <Row name="Surprise">
          {format.digits(f.surprise, 2)} <span class="note">1 is usual</span>
        </Row>
      </tbody>
    </table>
  );
}

// The values of each covariate: of labels the words, of numbers their range.
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
  return [...[...labels].map(([name, words]) => [name, words.join(', ')]), ...numbers];
}

export function Conditions({ answer }) {
  return (
    <>
      <table class="facts">
        <tbody>
          {conditionsOf(answer.covariates).map(([name, values]) => (
            <Row key={name} name={format.words(name)}>
              {values}
            </Row>
          ))}
        </tbody>
      </table>
      {answer.next_cursor !== null && (
        <p class="note foot">
          Of the first {answer.covariates.reduce((n, c) => n + c.value.length, 0)} changes.
        </p>
      )}
    </>
  );
}
