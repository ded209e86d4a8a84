// The ledger as a waterfall: each account starts where the one above ended, and the last lands on what the
// battery gave. Unexplained is hatched: it is measured, not what was left over.
import { html } from './html.js';
import * as format from './format.js';
import { Quantity } from './widgets.js';

const names = {
  accessories: 'Idle and accessories', driver: 'Motor drivers', copper: 'Copper', brush: 'Brushes',
  friction_internal: 'Friction in motors and gears', friction_rolling: 'Rolling', friction_scrub: 'Scrub in turns',
  friction_zone: 'Floor zones', friction_slip: 'Wheel slip', drag: 'Air', kinetic: 'Change of motion',
  potential: 'Change of height', braking: 'Generated in braking', recovered: 'Recovered', sensor: 'Sensor fault',
  unexplained: 'Unexplained',
};
const row_px = 30;

const next_to_nothing = 1e-5;  // of the whole

function rows_of(terms_j, battery_j) {
  const empty = (value) => Math.abs(value) <= next_to_nothing * Math.abs(battery_j);
  const rows = [];
  let at = 0;
  for (const [term, value] of Object.entries(terms_j)) {
    const change = term === 'recovered' ? -value : value;
    if (term === 'unexplained') rows.push({ key: 'modelled', name: 'Modelled', from: 0, to: at, total: true });
    if (empty(value) && term !== 'unexplained') {
      at += change;
      continue;
    }
    rows.push({ key: term, name: names[term] ?? format.words(term), from: at, to: at + change, change });
    at += change;
  }
  return { rows, sum: at, absent: Object.entries(terms_j).filter(([t, v]) => empty(v) && t !== 'unexplained').map(([t]) => (names[t] ?? t).toLowerCase()) };
}

export function Waterfall({ terms_j, battery_j, closure, measured = true }) {
  const { rows, sum, absent } = rows_of(terms_j, battery_j);
  const shown = measured ? rows : rows.filter((row) => row.key !== 'unexplained' && row.key !== 'modelled');
  const ends = shown.flatMap((row) => [row.from, row.to]).concat(battery_j, 0);
  const low = Math.min(...ends), high = Math.max(...ends), wide = Math.max(high - low, 1e-9);
  const x = (joule) => ((joule - low) / wide) * 100;
  const all = [...shown, { key: 'battery', name: measured ? 'From the battery' : 'Total', from: 0, to: battery_j, total: true }];
  const bar = (row) => {
    const left = Math.min(x(row.from), x(row.to)), width = Math.abs(x(row.to) - x(row.from));
    return html`<svg class="bar" width="100%" height=${row_px} aria-hidden="true" focusable="false">
      <line class="zero" x1=${`${x(0)}%`} x2=${`${x(0)}%`} y1="0" y2=${row_px} />
      <line class="goal" x1=${`${x(battery_j)}%`} x2=${`${x(battery_j)}%`} y1="0" y2=${row_px} />
      ${row.key !== 'battery' && html`<line class="step" x1=${`${x(row.to)}%`} x2=${`${x(row.to)}%`} y1=${row_px - 7} y2=${row_px} />`}
      <rect class=${`account ${row.total ? row.key : row.key === 'unexplained' ? 'unexplained' : row.change < 0 ? 'back' : 'out'}`}
        x=${`${left}%`} y="7" width=${`${Math.max(width, 0.15)}%`} height=${row_px - 14} />
    </svg>`;
  };
  return html`<div class="waterfall">
    <svg class="patterns" width="0" height="0" aria-hidden="true" focusable="false"><defs><pattern id="hatch" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><rect class="hatch-back" width="6" height="6" /><line class="hatch-line" x1="0" x2="0" y1="0" y2="6" /></pattern></defs></svg>
    <table>
      <thead class="hidden"><tr><th scope="col">Account</th><th scope="col">Bar</th><th scope="col">Energy</th><th scope="col">Share</th></tr></thead>
      <tbody>
      ${all.map((row) => {
        const value = row.total ? row.to : row.change;
        return html`<tr key=${row.key} class=${row.total ? `total ${row.key}` : row.key === 'unexplained' ? 'odd' : ''}>
          <th scope="row">${row.name}</th>
          <td class="bar-cell">${bar(row)}</td>
          <td class="figure"><${Quantity} of=${format.energy(value)} sign=${!row.total} /></td>
          <td class="figure share">${battery_j !== 0 ? format.fixed((100 * value) / battery_j, 1) : '–'}${'\u00a0'}%</td>
        </tr>`;
      })}
      </tbody>
    </table>
    <p class="closing">
      Accounts add up to <b>${format.fixed(sum, 2)}${'\u00a0'}J</b>; the battery gave <b>${format.fixed(battery_j, 2)}${'\u00a0'}J</b>.
      ${closure !== undefined && html` ${closure < 1e-9 ? 'Closes' : 'Does not close'}: difference ${closure === 0 ? 'none' : closure.toExponential(1)} of the whole.`}
      ${absent.length > 0 && html` <span class="note">Next to nothing in: ${absent.join(', ')}.</span>`}
    </p>
  </div>`;
}
