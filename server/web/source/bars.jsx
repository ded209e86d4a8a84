import { energyIn, energyScale } from './energy.js';
import { shown } from './widgets.jsx';

// Bars below one another, of rows [share of the width, kind].
export const Strips = ({ of, tallPx }) => (
  <svg width="100%" height={tallPx * of.length} aria-hidden="true" focusable="false">
    {of.map(([share, kind], k) => (
      <rect
        class={`account ${kind}`}
        y={tallPx * (k + 1 / 6)}
        height={(2 / 3) * tallPx}
        width={`${100 * Math.max(0, share)}%`}
      />
    ))}
  </svg>
);

// Quantities of one kind side by side. `rows`: {name, of, note}, with {value, channel} of a bar or {bar},
// another drawing; `head`: hidden titles of the columns.
export function Bars({ rows, label, head, class: name = '' }) {
  const high = Math.max(...rows.map((row) => row.value ?? 0), 1e-9);
  return (
    <table class={`bars ${name}`} aria-label={label}>
      {head && (
        <thead class="hidden">
          <tr>
            {head.map((title) => (
              <th scope="col">{title}</th>
            ))}
          </tr>
        </thead>
      )}
      <tbody>
        {rows.map((row, k) => (
          <tr key={row.key ?? k} class={row.class}>
            <th scope="row">{row.name}</th>
            <td class="bar-cell">
              {row.bar ?? <Strips of={[[(row.value ?? 0) / high, row.channel]]} tallPx={18} />}
            </td>
            <td class="figure">{shown(row.of)}</td>
            {row.note && <td class="note">{row.note}</td>}
          </tr>
        ))}
      </tbody>
    </table>
  );
}

// Energies in one unit, of rows [name, joules, channel, note].
export function EnergyBars({ label, rows }) {
  const values = rows.map(([, value]) => value);
  const scale = energyScale(values, 4);
  const barOf = ([name, value, channel, note]) => ({
    name,
    value,
    channel,
    note,
    of: energyIn(scale, value),
  });
  return <Bars label={label} rows={rows.map(barOf)} />;
}
