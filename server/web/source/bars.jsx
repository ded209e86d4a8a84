import { Quantity } from './widgets.jsx';

// Quantities of one kind side by side. `rows`: {name, value, of, channel, note}.
export function Bars({ rows, label, class: name = '' }) {
  const high = Math.max(...rows.map((row) => row.value ?? 0), 1e-9);
  return (
    <table class={`bars ${name}`} aria-label={label}>
      <tbody>
        {rows.map((row) => (
          <tr key={row.name}>
            <th scope="row">{row.name}</th>
            <td class="bar-cell">
              <svg width="100%" height="18" aria-hidden="true" focusable="false">
                <rect
                  class={`account ${row.channel}`}
                  x="0"
                  y="3"
                  height="12"
                  width={`${(100 * Math.max(0, row.value ?? 0)) / high}%`}
                />
              </svg>
            </td>
            <td class="figure">
              <Quantity of={row.of} />
            </td>
            <td class="note">{row.note}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
