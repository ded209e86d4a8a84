// The ledger as a waterfall: each account starts where the one above ended, and the last ends at the
// battery's energy. Unexplained is hatched: it is integrated from the measured gap, not computed as the rest.
import { Bars } from './bars.jsx';
import { energyIn, energyScale } from './energy.js';
import * as format from './format.js';
import { Quantity } from './widgets.jsx';

const names = {
  accessories: 'Idle and accessories',
  driver: 'Motor drivers',
  copper: 'Copper',
  brush: 'Brushes',
  friction_internal: 'Friction in motors and gears',
  friction_rolling: 'Rolling',
  friction_scrub: 'Scrub in turns',
  friction_zone: 'Floor zones',
  friction_slip: 'Wheel slip',
  drag: 'Air',
  kinetic: 'Change of motion',
  potential: 'Change of height',
  braking: 'Generated in braking',
  recovered: 'Recovered',
  sensor: 'Sensor error',
  unexplained: 'Unexplained',
};
export const termName = (term) => names[term] ?? format.words(term);
const rowPx = 30;
const negligible = 1e-5; // of the whole

// Recovered energy is reported as positive and subtracted from the sum.
export const effectOn = (term, value) => (term === 'recovered' && value ? -value : value);

function rowsOf(terms, total, measured) {
  const empty = ([term, value]) => Math.abs(value) <= negligible * Math.abs(total) && term !== 'unexplained';
  const rows = [];
  let at = 0;
  for (const [term, value] of Object.entries(terms)) {
    const change = effectOn(term, value);
    if (measured && term === 'unexplained')
      rows.push({ key: 'modelled', name: 'Modelled', from: 0, to: at, total: true });
    if ((measured || term !== 'unexplained') && !empty([term, value]))
      rows.push({ key: term, name: termName(term), from: at, to: at + change, change });
    at += change;
  }
  rows.push({ key: 'battery', name: measured ? 'Battery energy' : 'Total', from: 0, to: total, total: true });
  const absent = Object.entries(terms).filter(empty);
  return { rows, sum: at, absent: absent.map(([term]) => termName(term).toLowerCase()) };
}

function Bar({ row, x, end }) {
  const colour = row.total || row.key === 'unexplained' ? row.key : row.change < 0 ? 'good' : 'out';
  const vertical = (value) => ({ x1: `${x(value)}%`, x2: `${x(value)}%` });
  return (
    <svg class="bar" width="100%" height={rowPx} aria-hidden="true" focusable="false">
      <line stroke="var(--line)" {...vertical(0)} y1="0" y2={rowPx} />
      <line stroke="var(--measured)" stroke-dasharray="2 3" {...vertical(end)} y1="0" y2={rowPx} />
      {row.key !== 'battery' && (
        <line stroke="var(--muted)" {...vertical(row.to)} y1={rowPx - 7} y2={rowPx} />
      )}
      <rect
        class={`account ${colour}`}
        x={`${Math.min(x(row.from), x(row.to))}%`}
        y="7"
        width={`${Math.max(Math.abs(x(row.to) - x(row.from)), 0.15)}%`}
        height={rowPx - 14}
      />
    </svg>
  );
}

const hatch = (
  <svg class="hidden" width="0" height="0" aria-hidden="true" focusable="false">
    <defs>
      <pattern id="hatch" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">
        <rect width="6" height="6" fill="color-mix(in srgb, var(--hatch) 40%, transparent)" />
        <line x1="0" x2="0" y1="0" y2="6" stroke="var(--gap)" stroke-width="2.4" />
      </pattern>
    </defs>
  </svg>
);

// `terms`: energy of each account in joules; `total`: the battery's.
export function Waterfall({ terms, total, closure, measured = true }) {
  const { rows, sum, absent } = rowsOf(terms, total, measured);
  const ends = rows.flatMap((row) => [row.from, row.to]);
  const low = Math.min(...ends);
  const span = Math.max(Math.max(...ends) - low, 1e-9);
  const x = (joule) => ((joule - low) / span) * 100;
  const scale = energyScale([total], 4);
  const text = (value) => format.text(energyIn({ ...scale, places: scale.places + 1 }, value));
  const barOf = (row) => {
    const value = row.total ? row.to : row.change;
    const quantity = energyIn(scale, value);
    return {
      key: row.key,
      class: row.total ? `total ${row.key}` : row.key === 'unexplained' ? 'odd' : '',
      name: row.name,
      bar: <Bar row={row} x={x} end={total} />,
      of: row.total ? quantity : format.withSign(quantity),
      note: <Quantity of={format.percent(total !== 0 ? value / total : null, 1)} />,
    };
  };
  return (
    <>
      {hatch}
      <Bars class="waterfall" head={['Account', 'Bar', 'Energy', 'Share']} rows={rows.map(barOf)} />
      <p class="closing foot">
        Sum of the terms <b>{text(sum)}</b>, battery energy <b>{text(total)}</b>.
        {closure !== undefined &&
          (closure < 1e-9 ? ' They agree.' : ` They differ by ${format.share(closure, 3)}.`)}
        {absent.length > 0 && <span class="note"> Negligible: {absent.join(', ')}.</span>}
      </p>
    </>
  );
}
