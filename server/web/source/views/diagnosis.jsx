// The result of a diagnosis.
import { Bars } from '../bars.jsx';
import * as format from '../format.js';
import { Table, TablePanel, column, figure } from '../table.jsx';
import { Empty, Panel, Readouts, Texts } from '../widgets.jsx';
import { unitOf } from './changes.jsx';
import * as figures from './diagnosis_figures.jsx';
import { chance, effectName, likelyNames, rangeOf, share, verdictTitle } from './jobs.jsx';

const channels = {
  battery_power: 'battery power',
  wheel_torque: 'wheel torque',
  motor_voltage: 'motor voltage',
  battery_voltage: 'battery voltage',
};

// Ratios are relative changes of the model's value; angles are shown in degrees, slopes also in percent.
function strength(effect, name, { value, sd, unit }) {
  const scaled = (factor) => format.withDeviation(factor * value, format.known(sd) ? factor * sd : sd);
  if (name === 'side') return value < 0.5 ? 'right' : 'left';
  if (name === 'ratio') return `${value < 0 ? '' : '+'}${scaled(100)} %`;
  if (unit === 'rad' || unit === 'rad/s') {
    const slope = /tilt|grade|slope|climb/.test(`${effect} ${name}`) && Math.abs(value) < 0.5;
    const percent = slope ? ` (${format.digits(format.slopePercent(value), 2)} % slope)` : '';
    return `${scaled(format.degrees(1))}${unit === 'rad' ? '°' : '°/s'}${percent}`;
  }
  return `${scaled(1)}${unit === '1' ? '' : ` ${unit}`}`;
}

// The lines of an effect's parameters; a place is one line.
function strengths({ id, parameters: all }) {
  const place = all.x_m && all.y_m;
  const lines = Object.entries(all)
    .filter(
      ([name, p]) =>
        (p.value !== 0 || p.sd > 0 || name === 'side') && !(place && ['x_m', 'y_m'].includes(name)),
    )
    .map(([name, p]) => [name === 'ratio' ? 'by' : unitOf(name)[0], strength(id, name, p)]);
  if (place) lines.push(['centre', `(${format.digits(all.x_m.value)}, ${format.digits(all.y_m.value)}) m`]);
  return lines.map(([name, text]) => (
    <div key={name}>
      <span class="note">{name}</span> {text}
    </div>
  ));
}

// "speed_m_s" from 0.2 to 0.4 -> ["speed", "0.2 to 0.4 m/s"]
function region(w) {
  const [name, unit] = unitOf(w.variable);
  if (typeof w.from === 'string') return [name, unit ? `${w.from.replaceAll('-', '−')} ${unit}` : w.from];
  if (!unit.startsWith('rad')) return [name, `${format.range(w.from, w.to)} ${unit}`];
  return [name, `${format.range(format.degrees(w.from), format.degrees(w.to))} °${unit.slice(3)}`];
}

function WhereBar({ of: w, most }) {
  const at = (value) => `${(100 * Math.min(most, Math.max(0, value))) / most}%`;
  const ends = w.ci.map(Math.abs).sort((a, b) => a - b);
  return (
    <svg width="100%" height="16" aria-hidden="true">
      <rect
        x="0"
        y="3"
        height="10"
        width={at(Math.max(Math.abs(w.share), most / 200))}
        class={`account ${w.share < 0 ? 'good' : 'unexplained-plain'}`}
      />
      <line x1={at(ends[0])} x2={at(ends[1])} y1="8" y2="8" class="whisker" />
      {format.known(w.time_share) && (
        <line x1={at(w.time_share)} x2={at(w.time_share)} y1="0" y2="16" class="time-share" />
      )}
    </svg>
  );
}

// A line below the name of an effect or a term.
const Check = ({ children }) => <span class="note check">{children}</span>;

function Where({ regions }) {
  if (regions.length === 0) return <Empty title="No region with a significant gap" />;
  const shown = regions.slice(0, 12);
  const most = Math.max(...shown.flatMap((w) => [w.share, w.ci[1] ?? 0, w.time_share ?? 0].map(Math.abs)));
  return (
    <>
      <Bars
        class="where"
        head={['Region', 'Bar', 'Share of the gap']}
        rows={shown.map((w) => ({
          name: [
            `${channels[w.channel] ?? format.words(w.channel)} `,
            <span class="note">{region(w)[0]}</span>,
            ` ${region(w)[1]}`,
          ],
          bar: <WhereBar of={w} most={most} />,
          of: format.signed(share(w.share, 0)),
        }))}
      />
      <p class="note foot">
        Bar: share of the gap in power. Upright mark: share of the time; a uniform gap would reach it. Line:
        95 % interval. Regions overlap.
      </p>
    </>
  );
}

const Effect = ({ id, workshop, power_w: power, calibrates, varies }) => [
  effectName(id),
  workshop && <Check>check: {workshop}</Check>,
  power > 0 && <Check>{format.text(format.power(power))} on average</Check>,
  calibrates && <Check>corrects {calibrates} of the robot file</Check>,
  varies >= 0.01 && <Check>varies by {share(varies, 0)} between missions</Check>,
];
const effectColumns = [
  column('effect', 'Effect', Effect, { head: true }),
  figure('probability', 'Probability', (e) => chance(e.probability)),
  column('strength', 'Strength', strengths),
  figure('share', 'Returns without it', (e) => share(e.share, 0), {
    hint: 'part of the closed gap that returns if this effect is omitted',
  }),
  figure('group', 'Group', (e) => chance(e.group), {
    hint: 'probability that it or one of the effects confounded with it is present',
  }),
  column('alternatives', 'Confounded with', (e) => e.alternatives.map(effectName).join(', ') || '–', {
    class: 'words',
  }),
];

const correctionColumns = [
  column('parameter', 'Parameter', (c) => c.parameter, { head: true }),
  figure('file', 'In the file', (c) => format.digits(c.file)),
  figure('fits', 'Fits', (c) => format.withDeviation(c.fits, c.sd)),
];

function Checks({ checks }) {
  return (
    <Panel title="Checks of the recordings">
      <Texts of={checks.map((c) => (c.contradicted ? `${c.says} It is not used below.` : c.says))} />
    </Panel>
  );
}

const barOf = (name, value, note) => ({ name, value, of: format.percent(value, 1), channel: 'plain', note });
// "v^2" as "v²".
const powers = (text) => text.replaceAll('^2', '²').replaceAll('^3', '³');
const termColumns = [
  column('term', 'Term', ([name, { unit }]) => [powers(name), <Check> {powers(unit)}</Check>], {
    head: true,
  }),
  figure('data', 'In the data', ([, t]) => format.withDeviation(t.value, t.sd)),
  figure('model', 'Robot file', ([, t]) => format.likeDeviation(t.model, t.sd)),
  figure('explained', 'This diagnosis', ([, t]) => format.likeDeviation(t.explained, t.sd)),
];

// The diagnosis compared with a linear regression, on the same held-out parts.
function Regression({ of }) {
  const rows = [
    ['Linear regression', of.held_out],
    ['This diagnosis', of.explanation_held_out],
    ['Robot file unchanged', of.unchanged_model_held_out],
  ];
  const terms = Object.entries(of.terms);
  return (
    <Panel title="Compared with a linear regression" aside={of.wins && <b>The regression predicts better</b>}>
      <Bars class="referee" rows={rows.map(([name, value]) => barOf(name, value))} />
      {terms.length > 0 && <Table class="effects" columns={termColumns} rows={terms} />}
      <Texts of={of.says} />
      <p class="note foot">
        Power error on held-out data: parts of the missions that were not used for the fit.
      </p>
    </Panel>
  );
}

const verdictNotes = {
  none: 'Measured and modelled energy agree, as far as these missions can show.',
  effects: 'The model lacks the effects that are listed here.',
  outside: 'No effect of the catalogue describes the cause.',
  not_this_robot: 'The robot file does not match this robot.',
  inconclusive: 'The cause of the gap cannot be determined from these missions.',
};

function Verdict({ result: r }) {
  const name = verdictTitle(r);
  const effects = likelyNames(r);
  return (
    <div class={`verdict-box ${r.verdict === 'none' || r.verdict === 'effects' ? '' : 'bad'}`}>
      <p class="verdict">
        <b>{name[0].toUpperCase() + name.slice(1)}</b>
        {effects && `${r.verdict === 'effects' ? ':' : '; most likely'} ${effects}`}
      </p>
      <p class="note">
        {verdictNotes[r.verdict]} Probability of this verdict: {chance(r.verdict_probability)}.
      </p>
      <Texts of={r.reasons} />
    </div>
  );
}

function Figures({ result: r }) {
  const { gap, shrinkage: s } = r;
  const found = r.effects.length > 0;
  const rows = [
    ['Gap in power', format.percent(gap.power_absolute_relative, 1), `noise ${share(gap.noise_floor)}`],
    ['Gap in energy', format.percent(gap.energy_relative, 1)],
    found && ['Held-out error', format.percent(s.held_out_after, 1), `from ${share(s.held_out_before)}`],
    found && ['Gap reduced by', format.percent(s.fraction, 0), rangeOf(s.ci, 0)],
    ['Missions', `${r.missions}`, `${format.fixed(r.samples)} samples`],
  ];
  return <Readouts large rows={rows} />;
}

function NextDrives({ result: r }) {
  const decided =
    r.verdict === 'none' || (r.verdict === 'effects' && r.effects.every((e) => e.alternatives.length === 0));
  if (r.next_drive.length === 0)
    return (
      <p class="note">
        {decided
          ? 'No further drive is needed.'
          : `No drive would determine the cause${r.effects.length > 0 ? '; the effects list what to check' : ''}.`}
      </p>
    );
  return (
    <ol class="next">
      {r.next_drive.map((n, k) => (
        <li key={k}>
          <b>{n.manoeuvre}</b> <span class="note">to distinguish {format.words(n.separates)}</span>
        </li>
      ))}
    </ol>
  );
}

const floorOf = (r) =>
  r.figures?.floor.x_m.length > 3 && <figures.FloorFigure floor={r.figures.floor} effects={r.effects} />;

function Charts({ result: r }) {
  const f = r.figures;
  const after = r.effects.length > 0;
  return (
    <>
      <figures.Conditions maps={f.maps} after={after} />
      {f.power.t_s.length > 4 && <figures.PowerFigure power={f.power} after={after} />}
      <figures.MissionFigures missions={f.missions} total={r.missions} after={after} />
    </>
  );
}

function Readings({ channels: all }) {
  const rows = Object.entries(all).filter(([, c]) => format.known(c.absolute_relative));
  if (rows.length === 0) return null;
  return (
    <Panel title="Error of each kind of reading">
      <Bars
        rows={rows.map(([name, c]) =>
          barOf(channels[name] ?? format.words(name), c.absolute_relative, `noise ${share(c.noise_floor)}`),
        )}
      />
    </Panel>
  );
}

const limitsOf = (r) =>
  [
    !r.motor_channels &&
      'Motor currents were not recorded: effects in motors, drivers and friction are harder to distinguish.',
    r.power === 'motors' &&
      'The battery was not recorded: power is that of the motors, without the base load.',
    r.power === 'none' && 'No power was recorded: effects are estimated from other readings.',
    r.gap.detectable_share > 0 &&
      `An effect of less than ${share(r.gap.detectable_share)} of the power is not detectable.`,
    ...(r.limits ?? []),
    ...(r.notes ?? []),
  ].filter(Boolean);

// `children`: the adoption of its effects.
export function Result({ result: r, children }) {
  const limits = limitsOf(r);
  const placed = r.effects.some((e) => e.parameters.x_m); // its map comes first
  return (
    <>
      {r.checks?.length > 0 && <Checks checks={r.checks} />}
      <Verdict result={r} />
      <Figures result={r} />
      {r.effects.length > 0 && (
        <TablePanel title="Effects" class="effects" columns={effectColumns} rows={r.effects} />
      )}
      {placed && floorOf(r)}
      {children && <Panel title="Adopt">{children}</Panel>}
      {r.corrections?.length > 0 && (
        <TablePanel
          title="Values of the robot file that fit"
          class="effects"
          columns={correctionColumns}
          rows={r.corrections}
        />
      )}
      {r.verdict !== 'none' && (
        <div class="columns">
          <Panel title="Where the gap arises">
            <Where regions={r.where} />
          </Panel>
          <div>
            {r.baseline && <Regression of={r.baseline} />}
            <Panel title="Next drives">
              <NextDrives result={r} />
            </Panel>
          </div>
        </div>
      )}
      {r.groups && <figures.Comparison of={r} />}
      {r.runs && <figures.Runs of={r} />}
      {r.figures && <Charts result={r} />}
      {!placed && floorOf(r)}
      {r.channels && <Readings channels={r.channels} />}
      {limits.length > 0 && (
        <Panel title="Limits">
          <Texts of={limits} />
        </Panel>
      )}
    </>
  );
}
