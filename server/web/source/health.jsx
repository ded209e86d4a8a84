// The robots that need attention, and texts of a robot's telemetry and charge.
import { get, useRenewed } from './api.js';
import * as format from './format.js';
import { Quantity } from './widgets.jsx';

const spanUs = 90e6;
const pauseUs = 5e6; // longer ones are left empty

// The last minute and a half of a robot's power: measured as a trace, modelled as a thin line behind.
export function Sparkline({ track, width = 128, height = 30 }) {
  const rows = track.last();
  const known = rows.flatMap(([, ...powers]) => powers).filter(Number.isFinite);
  const [low, high] = [Math.min(0, ...known), Math.max(1, ...known)];
  const end = rows.at(-1)?.[0];
  const x = (us) => (width - 2 - ((end - us) / spanUs) * width).toFixed(1);
  const y = (value) => (height - 2 - ((value - low) / (high - low)) * (height - 5)).toFixed(1);
  const step = ([us, value], k, all) => `${us - all[k - 1]?.[0] <= pauseUs ? 'L' : 'M'}${x(us)} ${y(value)}`;
  const lineOf = (column) =>
    rows
      .map((row) => [row[0], row[column]])
      .filter(([, value]) => Number.isFinite(value))
      .map(step)
      .join('');
  const graticule = Array.from({ length: width / 32 }, (_, k) => `M${width - 0.5 - 32 * k} 0V${height}`);
  return (
    <svg class="sparkline" width={width} height={height} aria-hidden="true">
      <path d={`M0 ${Math.round(y(0)) + 0.5}H${width}${graticule.join('')}`} />
      <path class="modelled" d={lineOf(2)} />
      <path class="measured" stroke-width="1.5" d={lineOf(1)} />
    </svg>
  );
}

const attentionMs = 10_000;

async function readAttention(signal) {
  const { attention } = await get('/v1/attention', signal);
  return new Map(attention.map((entry) => [entry.robot_id ?? '', entry]));
}

// Map from robot to {severity, acknowledged, reasons}; the service itself is under ''. Empty until it is
// read; read again when `turn` changes.
export const useAttention = (turn = 0) => useRenewed(readAttention, attentionMs, `all${turn}`);

// Whether an entry, absent for most robots, has a reason that no one acknowledged.
export const needsSomeone = (entry) => entry !== undefined && !entry.acknowledged;

export const lowCharge = 0.25;

// Reasons of normal operation: restarts of robots and the service, and rest between missions.
const ordinary = ['restart', 'gap', 'outside_mission'];

// True without telemetry since the start of the service.
export const unheard = (state) => state.silent_s === null;

// The value if the robot is live, else null: the last value is not valid for a silent robot.
export const now = (state, value) => (state.live ? value : null);

// The power of a live robot: modelled where it is not measured.
export const powerNow = (state) => now(state, state.measured_power_w ?? state.modelled_power_w);

// A time, as short as today allows.
export function since(utimeUs) {
  const [day, clock] = format.time(utimeUs).split(' ');
  return Date.now() - utimeUs / 1000 < 86_400e3 ? clock.slice(0, 5) : day;
}

function telemetryOf(state) {
  if (!state.has_model) return { level: 'bad', text: 'no robot file' };
  if (state.live) return { level: 'good', text: 'live' };
  if (unheard(state)) return { level: 'none', text: 'no telemetry yet' };
  const text = (
    <span>
      silent since <span class="number">{since(state.heardUs)}</span>
    </span>
  );
  return { level: 'bad', text };
}

// The most urgent reason, and the number of the others; silence is in the line above. The state contains
// contradictions before the list is read.
function shortly({ contradictions }, reasons) {
  const said = reasons.filter(({ kind }) => kind !== 'silent');
  if (said.length === 0)
    return contradictions.map((c) => `${c.channel || 'messages'}: ${format.words(c.kind)}`).join(', ');
  const [{ message, acknowledged }] = said;
  return `${acknowledged ? 'Acknowledged: ' : ''}${message}${said.length > 1 ? ` + ${said.length - 1} more` : ''}`;
}

export function Health({ state, reasons = [] }) {
  const { level, text } = telemetryOf(state);
  const faults = Object.entries(state.faults).filter(([reason]) => !ordinary.includes(reason));
  const noteOf = (r) => (state.fault_notes?.[r] ? `: ${state.fault_notes[r]}` : '');
  const listed = faults.map(([r, n]) => `${format.fixed(n)} ${format.words(r)}${noteOf(r)}`).join(', ');
  const short = shortly(state, reasons);
  const title = short
    ? reasons.map((r) => `${r.message} ${r.action}`).join('\n')
    : 'Rejected, repaired or missing samples since the service started';
  const calm = !short || reasons[0]?.severity === 'notice' || reasons[0]?.acknowledged;
  return (
    <>
      <span class="row telemetry">
        <span class={`lamp ${level}`} aria-hidden="true" />
        {text}
      </span>
      {(short || listed) && (
        <span class={calm ? 'below' : 'below fault'} title={title}>
          {short || `samples: ${listed}`}
        </span>
      )}
    </>
  );
}

// Reasons for attention with their actions; `of`: an entry of useAttention(), `more(reason)`: after each.
export function Reasons({ of, more }) {
  if (!of) return null;
  return (
    <div class={of.severity === 'fault' && !of.acknowledged ? 'failure' : 'verdict-box'} role="alert">
      <ul class="reasons">
        {of.reasons.map((r) => (
          <li key={r.kind + r.since_utime_us}>
            {r.message} {r.action} {more?.(r)}
          </li>
        ))}
      </ul>
    </div>
  );
}

// The state of charging, or the standard deviation of the charge: {text, what}.
export function chargeNote({ charging, charge, state_of_charge_sd: sd }) {
  const leftS = charge?.time_to_charged_s;
  const left = format.known(leftS) ? `, ${format.about(leftS)}` : '';
  if (charging?.phase === 'full') return { text: 'charged', what: 'At its charger; charging has ended' };
  if (charging) return { text: `charging${left}`, what: `At its charger${left}` };
  return {
    text: format.known(sd) ? `± ${format.share(sd)}` : '',
    what: charge.limitation ?? 'standard deviation',
  };
}

export function Charge({ state }) {
  const share = state.state_of_charge;
  if (share === null) return <span class="note">unknown</span>;
  const { text, what } = chargeNote(state);
  return (
    <>
      <span
        class={`charge-bar ${state.charging ? 'modelled' : share < lowCharge ? 'bad' : 'good'}`}
        aria-hidden="true"
      >
        <span style={{ width: `${Math.max(2, share * 100)}%` }} />
      </span>
      <Quantity of={format.percent(share)} />
      <span class="below" title={what}>
        {text}
      </span>
    </>
  );
}

// The central 90 % of a forecast, formatted by `as(low, high)`; empty without a forecast.
export function between(band, as) {
  if (!format.known(band?.p05) || !format.known(band.p95)) return '';
  return (
    <span title="90 % interval of the forecast">
      <span class="hidden">90 % interval </span>
      {as(band.p05, band.p95)}
    </span>
  );
}
