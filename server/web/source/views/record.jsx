// The record of a mission apart from its energy: facts, conditions, and the payload estimated from its
// motion.
import { chargeShare, energy } from '../energy.js';
import * as format from '../format.js';
import { robotLink } from '../route.js';
import { Facts } from '../widgets.jsx';

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

export function Record({ mission: m, model }) {
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
export function Findings({ of: f, mission }) {
  const p = f.payload;
  const flag = <span class="flag">undeclared payload</span>;
  const assumed = <span class="note">taken as 0 kg</span>;
  const rows = [
    ['Payload', [payloadVerdicts[p.verdict](p), ' ', p.verdict === 'undeclared' && flag]],
    [
      'Declared, mean',
      mission.payload_kg === null && p.declared_kg === 0
        ? ['– ', assumed]
        : format.text(format.unit(p.declared_kg, 'kg')),
    ],
    ['Difference from declared', `${format.withDeviation(p.undeclared_kg, p.undeclared_sd_kg)}\u00a0kg`],
    ['Used for refinement', f.learned_from ? 'yes' : 'no: held out for back-tests'],
  ];
  return <Facts rows={rows} />;
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
      <Facts rows={conditionsOf(answer.covariates).map(([name, values]) => [format.words(name), values])} />
      {answer.next_cursor !== null && (
        <p class="note foot">
          Of the first {answer.covariates.reduce((n, c) => n + c.value.length, 0)} changes.
        </p>
      )}
    </>
  );
}
