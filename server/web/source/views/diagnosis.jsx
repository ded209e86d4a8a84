// The result of a diagnosis.
import * as format from '../format.js';
import { Table } from '../table.jsx';
import { Empty, Panel, Readout } from '../widgets.jsx';
import { Adopt } from './adopt.jsx';
import { effectName, rangeOf, share, verdicts } from './jobs.jsx';

const channels = {
  battery_power: 'battery power',
  wheel_torque: 'wheel torque',
  motor_voltage: 'motor voltage',
  battery_voltage: 'battery voltage',
};
const suffixes = [
  ['_m_s2', 'm/s²'],
  ['_rad_s', 'rad/s'],
  ['_m_s', 'm/s'],
  ['_kg', 'kg'],
  ['_rad', 'rad'],
  ['_s', 's'],
  ['_m', 'm'],
  ['_w', 'W'],
];

// "speed_m_s" -> ["speed", "m/s"]
function unitOf(name) {
  const [suffix, unit] = suffixes.find(([s]) => name.endsWith(s)) ?? ['', ''];
  return [name.slice(0, name.length - suffix.length), unit];
}

// Ratios are relative changes of the model's value; angles are shown in degrees, slopes also in percent.
function strength(effect, name, { value, sd, unit }) {
  const scaled = (factor) => format.withDeviation(factor * value, format.known(sd) ? factor * sd : sd);
  if (name === 'ratio') return `${value < 0 ? '' : '+'}${scaled(100)} %`;
  if (unit === 'rad' || unit === 'rad/s') {
    const slope = /tilt|grade|slope|climb/.test(`${effect} ${name}`) && Math.abs(value) < 0.5;
    const percent = slope ? ` (${format.digits(format.slopePercent(value), 2)} % slope)` : '';
    return `${scaled(format.degrees(1))}${unit === 'rad' ? '°' : '°/s'}${percent}`;
  }
  return `${scaled(1)}${unit === '1' ? '' : ` ${unit}`}`;
}

// "speed_m_s" from 0.2 to 0.4 -> ["speed", "0.2 to 0.4 m/s"]
function region(w) {
  const [plain, unit] = unitOf(w.variable);
  const name = format.words(plain);
  if (typeof w.from === 'string') return [name, w.from];
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
        class={`account ${w.share < 0 ? 'back' : 'unexplained-plain'}`}
      />
      <line x1={at(ends[0])} x2={at(ends[1])} y1="8" y2="8" class="whisker" />
      {format.known(w.time_share) && (
        <line x1={at(w.time_share)} x2={at(w.time_share)} y1="0" y2="16" class="time-share" />
      )}
    </svg>
  );
}

function Where({ regions }) {
  if (regions.length === 0) return <Empty title="No region with a significant gap" />;
  const shown = regions.slice(0, 12);
  const most = Math.max(...shown.flatMap((w) => [w.share, w.ci[1] ?? 0, w.time_share ?? 0].map(Math.abs)));
  return (
    <>
      <table class="bars where">
        <thead class="hidden">
          <tr>
            <th>Region</th>
            <th>Bar</th>
            <th>Share of the gap</th>
          </tr>
        </thead>
        <tbody>
          {shown.map((w, k) => (
            <tr key={k}>
              <th scope="row">
                {channels[w.channel] ?? format.words(w.channel)} <span class="note">{region(w)[0]}</span>{' '}
                {region(w)[1]}
              </th>
              <td class="bar-cell">
                <WhereBar of={w} most={most} />
              </td>
              <td class="figure">{format.signed(share(w.share, 0))}</td>
            </tr>
          ))}
        </tbody>
      </table>
      <p class="note foot">
        Bar: share of the gap in power; upright mark: share of the time, which the gap would have if it were
        everywhere alike; line: 95 % interval. Regions overlap.
      </p>
    </>
  );
}

const effectColumns = [
  {
    key: 'effect',
    title: 'Effect',
    head: true,
    cell: (e) => (
      <>
        {effectName(e.id)}
        {e.workshop && <span class="note check">check: {e.workshop}</span>}
      </>
    ),
  },
  { key: 'probability', title: 'Probability', class: 'figure', cell: (e) => share(e.probability, 0) },
  {
    key: 'strength',
    title: 'Strength',
    cell: (e) =>
      Object.entries(e.parameters).map(([name, p]) => (
        <div key={name}>
          <span class="note">{name === 'ratio' ? 'by' : format.words(unitOf(name)[0])}</span>{' '}
          {strength(e.id, name, p)}
        </div>
      )),
  },
  {
    key: 'share',
    title: 'Explains of the gap',
    class: 'figure',
    cell: (e) => share(e.share, 0),
  },
  {
    key: 'group',
    title: 'Of its group',
    class: 'figure',
    hint: 'probability that it or one of the effects confounded with it is present',
    cell: (e) => share(e.group, 0),
  },
  {
    key: 'alternatives',
    title: 'Confounded with',
    class: 'words',
    cell: (e) => e.alternatives.map(effectName).join(', ') || '–',
  },
];

const correctionColumns = [
  { key: 'parameter', title: 'Parameter', head: true, cell: (c) => c.parameter },
  { key: 'file', title: 'In the file', class: 'figure', cell: (c) => format.digits(c.file) },
  { key: 'fits', title: 'Would fit', class: 'figure', cell: (c) => format.withDeviation(c.fits, c.sd) },
];

function Checks({ checks }) {
  return (
    <Panel title="Checks of the recordings">
      <ul class="reasons">
        {checks.map((c, k) => (
          <li key={k}>
            {c.says}
            {c.contradicted && (
              <>
                {' '}
                <b>It is not used below.</b>
              </>
            )}
          </li>
        ))}
      </ul>
    </Panel>
  );
}

// The diagnosis compared with a plain regression, on the same held-out parts.
function Regression({ of }) {
  const rows = [
    ['Plain regression', of.held_out],
    ['This diagnosis', of.explanation_held_out],
    ['Robot file unchanged', of.unchanged_model_held_out],
  ];
  const most = Math.max(...rows.map(([, v]) => v ?? 0), 1e-9);
  return (
    <Panel title="Compared with a plain regression" aside={of.wins && <b>The regression predicts better</b>}>
      <table class="bars referee">
        <tbody>
          {rows.map(([name, v]) => (
            <tr key={name}>
              <th scope="row">{name}</th>
              <td class="bar-cell">
                <svg width="100%" height="12" aria-hidden="true">
                  <rect
                    height="8"
                    y="2"
                    width={`${Math.max(0.5, (100 * (v ?? 0)) / most)}%`}
                    class="account plain"
                  />
                </svg>
              </td>
              <td class="figure">{share(v)}</td>
            </tr>
          ))}
        </tbody>
      </table>
      {of.says.length > 0 && (
        <ul class="reasons">
          {of.says.map((text) => (
            <li key={text}>{text}</li>
          ))}
        </ul>
      )}
      <p class="note foot">
        Held-out error of the power: on parts of the missions that were not used for the fit.
      </p>
    </Panel>
  );
}

function Verdict({ result: r }) {
  const [name, words] = verdicts[r.verdict] ?? [r.verdict, ''];
  const effects = r.effects.map((e) => effectName(e.id)).join(', ');
  return (
    <div class={`verdict-box ${r.verdict === 'none' || r.verdict === 'effects' ? '' : 'fails'}`}>
      <p class="verdict">
        <b>{name}</b>
        {effects && `${r.verdict === 'effects' ? ':' : '; most likely'} ${effects}`}
      </p>
      <p class="note">{words}</p>
      {r.reasons?.length > 0 && (
        <ul class="reasons">
          {r.reasons.map((reason) => (
            <li key={reason}>{reason}</li>
          ))}
        </ul>
      )}
    </div>
  );
}

function Figures({ result: r }) {
  const s = r.shrinkage;
  return (
    <dl class="readouts">
      <Readout
        large
        label="Gap in power"
        of={format.percent(r.gap.power_absolute_relative, 1)}
        note={`noise ${share(r.gap.noise_floor)}`}
      />
      <Readout large label="Gap in energy" of={format.percent(r.gap.energy_relative, 1)} />
      {r.effects.length > 0 && (
        <>
          <Readout
            large
            label="Held-out error"
            of={format.percent(s.held_out_after, 1)}
            note={`from ${share(s.held_out_before)}`}
          />
          <Readout large label="Gap reduced by" of={format.percent(s.fraction, 0)} note={rangeOf(s.ci, 0)} />
        </>
      )}
      <Readout large label="Missions" of={`${r.missions}`} note={`${format.fixed(r.samples)} samples`} />
    </dl>
  );
}

function NextDrives({ result: r }) {
  const decided = r.verdict === 'effects' || r.verdict === 'none';
  if (r.next_drive.length === 0)
    return <p class="note">{decided ? 'No further drive is needed.' : 'No drive would decide it.'}</p>;
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

export function Result({ job }) {
  const r = job.result;
  const adoptable = r.adoption ? r.adoption.effects.length > 0 : job.model !== null;
  return (
    <>
      {r.checks?.length > 0 && <Checks checks={r.checks} />}
      <Verdict result={r} />
      <Figures result={r} />
      {r.effects.length > 0 && (
        <Panel title="Effects">
          <Table class="effects" columns={effectColumns} rows={r.effects} keyOf={(e) => e.id} />
        </Panel>
      )}
      {adoptable && (
        <Panel title="Adopt">
          <Adopt job={job} />
        </Panel>
      )}
      {r.corrections?.length > 0 && (
        <Panel title="Values that would fit in the robot file">
          <Table
            class="effects"
            columns={correctionColumns}
            rows={r.corrections}
            keyOf={(c) => c.parameter}
          />
        </Panel>
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
    </>
  );
}
