import { Quantity } from './widgets.jsx';

const Bar = ({ row: { value, channel }, high }) => (
  <svg width="100%" height="18" aria-hidden="true" focusable="false">
    <rect
      class={`account ${channel}`}
      x="0"
      y="3"
      height="12"
      width={`${(100 * Math.max(0, value ?? 0)) / high}%`}
    />
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
              <th key={title}>{title}</th>
            ))}
          </tr>
        </thead>
      )}
      <tbody>
        {rows.map((row, k) => (
          <tr key={row.key ?? k} class={row.class}>
            <th scope="row">{row.name}</th>
            <td class="bar-cell">{row.bar ?? <Bar row={row} high={high} />}</td>
            <td class="figure">{typeof row.of === 'string' ? row.of : <Quantity of={row.of} />}</td>
            {row.note && <td class="note">{row.note}</td>}
          </tr>
        ))}
      </tbody>
    </table>
  );
}
