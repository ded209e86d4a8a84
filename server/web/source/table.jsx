// Tables of records. On a narrow screen each row becomes a card, with the column's title next to each value.
import { Button, Options, Panel, shown } from './widgets.jsx';

export const names = new Intl.Collator('en', { numeric: true });

const absent = (v) => v === null || v === undefined;
const compare = (a, b) => (typeof a === 'string' ? names.compare(a, b) : a - b);

// A copy of `rows` in the given order, of orderOf(); rows without a value come last in both directions.
export function sorted(rows, columns, [sort]) {
  const value = columns.find((c) => c.key === sort.key)?.sort;
  if (value === undefined) return rows;
  return [...rows].sort((one, other) => {
    const [a, b] = [value(one), value(other)];
    return absent(a) || absent(b) ? absent(a) - absent(b) : (sort.down ? -1 : 1) * compare(a, b);
  });
}

// The order in the address, {key, down}, or the usual one, and a function that sorts by a column; the one
// that it is sorted by already is turned round.
export function orderOf(given, change, usual) {
  const sort = given.sort ? { key: given.sort, down: given.down === '1' } : usual;
  const onSort = (key) => {
    const down = sort.key === key ? !sort.down : usual.down;
    change({ sort: key, down: down ? '1' : '' });
  };
  return [sort, onSort];
}

export function Head({ columns, order: [sort, onSort] = [] }) {
  const direction = (c) => (c.key !== sort?.key ? undefined : sort.down ? 'descending' : 'ascending');
  return (
    <thead>
      <tr>
        {columns.map((c) => (
          <th scope="col" class={c.class} style={{ width: c.width }} title={c.hint} aria-sort={direction(c)}>
            {onSort && c.sort ? (
              <button type="button" onClick={() => onSort(c.key)}>
                {c.title}
                <span class="arrow" style={{ display: 'inline-block', width: '12px' }} aria-hidden="true">
                  {c.key === sort?.key ? (sort.down ? '▾' : '▴') : ''}
                </span>
              </button>
            ) : (
              c.title
            )}
          </th>
        ))}
      </tr>
    </thead>
  );
}

// The choice of a table's order on narrow screens, which do not show the column titles.
export function SortChoice({ columns, order: [sort, onSort] }) {
  const sortable = columns.filter((c) => c.sort).map((c) => [c.key, c.title]);
  return (
    <span class="sort-choice">
      <label class="row with-unit">
        <span class="note">Sort by</span>
        <select value={sort.key} onChange={(event) => onSort(event.currentTarget.value)}>
          <Options of={sortable} />
        </select>
      </label>
      <Button onClick={() => onSort(sort.key)}>{sort.down ? 'Descending' : 'Ascending'}</Button>
    </span>
  );
}

export const column = (key, title, cell, more) => ({ key, title, cell, ...more });
export const figure = (key, title, cell, more) => ({ key, title, class: 'figure', cell, ...more });

// The cells of a row. A cell may be a quantity.
export const Cells = ({ columns, row }) =>
  columns.map((c) =>
    c.head ? (
      <th key={c.key} scope="row" class={c.class}>
        {shown(c.cell(row))}
      </th>
    ) : (
      <td key={c.key} class={c.class} data-title={c.title}>
        {shown(c.cell(row))}
      </td>
    ),
  );

// columns: {key, title, cell(row), class, head: the row's name, hint, sort(row) where it can be sorted by};
// `order`, of orderOf(): of a table that can be sorted. Rows are identified by key or id, if any.
export const Table = ({ columns, rows, order, class: name = '' }) => (
  <>
    {order && <SortChoice columns={columns} order={order} />}
    <table class={`grid cards ${name}`}>
      <Head columns={columns} order={order} />
      <tbody>
        {rows.map((row, k) => (
          <tr key={row.key ?? row.id ?? k}>
            <Cells columns={columns} row={row} />
          </tr>
        ))}
      </tbody>
    </table>
  </>
);

// Nothing without rows.
export const TablePanel = ({ title, aside, note, ...table }) =>
  table.rows?.length > 0 && (
    <Panel title={title} aside={aside}>
      <Table {...table} />
      {note && <p class="note foot">{note}</p>}
    </Panel>
  );
