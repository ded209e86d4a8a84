// Squares of the floor in colours, with the zones of significant departure, read by the pointer or by keys.
import { FloorView, Legend, arrows, drawZones, fit, scaleFor, strokeBox } from '../floor.jsx';
import { palette, useTheme } from '../theme.js';
import { useNarrow } from '../widgets.jsx';

// The nearest square in a direction, adjacent or not.
function stepFrom(cells, at, [dx, dy]) {
  let best = at;
  let least = Infinity;
  for (const cell of cells) {
    const [x, y] = [cell.x_m - at.x_m, cell.y_m - at.y_m];
    const along = x * dx + y * dy;
    const far = along + 3 * Math.abs(x * dy - y * dx);
    if (along > 1e-9 && far < least) [best, least] = [cell, far];
  }
  return best;
}

function drawSquares(c, view, { map, value, scale, marked }) {
  const p = palette();
  const side = map.cell_m * view.scale;
  const gap = side > 6 ? 1 : 0;
  for (const cell of map.cells) {
    const [x, y] = view.to(cell.x_m, cell.y_m + map.cell_m);
    const of = value(cell);
    if (of === null) {
      strokeBox(c, p.line, 1, x + 0.5, y + 0.5, Math.max(1, side - 1 - gap), Math.max(1, side - 1 - gap));
    } else {
      c.fillStyle = scale.colourOf(of);
      c.fillRect(x, y, side - gap, side - gap);
    }
  }
  if (marked === null) return;
  const [x, y] = view.to(marked.x_m, marked.y_m + map.cell_m);
  strokeBox(c, p.accent, 3, x - 1.5, y - 1.5, side + 3, side + 3);
}

// `value(cell)`: the value that its colour shows, null if missing. `kind` as of scaleFor().
export function FloorCanvas({ map, value, kind, title, unit, marked, onMark }) {
  const narrow = useNarrow();
  useTheme(); // the scale is of the theme
  const b = map.bounds;
  const aspect = (b.y_max_m - b.y_min_m) / (b.x_max_m - b.x_min_m);
  const wide = narrow ? Math.min(720, innerWidth - 30) : 740; // about
  const height = Math.round(Math.min(600, 1.3 * wide, Math.max(240, wide * aspect)));
  const scale = scaleFor(kind, map.cells.map(value));
  const corners = [
    [b.x_min_m, b.y_min_m],
    [b.x_max_m, b.y_max_m],
  ];
  const draw = (c, view) => {
    drawSquares(c, view, { map, value, scale, marked });
    drawZones(c, view, map.zones);
  };
  const point = (x, y) => {
    const within = (low, at) => at >= low && at < low + map.cell_m;
    const cell = map.cells.find((one) => within(one.x_m, x) && within(one.y_m, y));
    if (cell) onMark(cell);
  };
  const key = (event) => {
    if (event.key === 'Escape') onMark(null);
    else if (event.key in arrows)
      onMark(marked === null ? map.cells[0] : stepFrom(map.cells, marked, arrows[event.key]));
    else return;
    event.preventDefault();
  };
  return (
    <FloorView
      viewFor={(width, tall) => fit(corners, width, tall, 30)}
      draw={draw}
      height={height}
      changes={[map, title, unit, marked, height]}
      role="application"
      tabindex="0"
      aria-label={`Map of the floor: ${title}, ${map.cells.length} squares of ${map.cell_m} metres, ${map.zones.length} zones. Arrow keys go from square to square; the tables below have the same figures.`}
      onPlace={point}
      onKeyDown={key}
    >
      <Legend scale={scale} title={title} unit={unit} />
    </FloorView>
  );
}
