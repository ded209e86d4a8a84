// Paths on the floor, to scale, on a canvas.
import { useEffect, useLayoutEffect, useRef } from 'preact/hooks';
import { digits } from './format.js';
import { isDark, palette, useTheme } from './theme.js';

const stops = {
  power: {
    light: ['#c8ccc4', '#e2b25c', '#d4682c', '#962630', '#480e34'],
    dark: ['#2c3a3e', '#684868', '#c45248', '#fa9838', '#ffeeaa'],
  },
  gap: {
    light: ['#14548c', '#78aac8', '#c4c4be', '#e28c64', '#ac2422'],
    dark: ['#46aaff', '#3c6a96', '#4e5454', '#b05c40', '#ff7854'],
  },
};

// {low, high, colour_of(value), colours}: 'power' from 0 to the 98th percentile, 'gap' symmetric about 0.
export function scaleFor(kind, values) {
  const finite = values
    .filter(Number.isFinite)
    .map((v) => (kind === 'gap' ? Math.abs(v) : v))
    .sort((a, b) => a - b);
  const top = Math.max(finite.length > 0 ? finite[Math.floor(0.98 * (finite.length - 1))] : 1, 1e-3);
  const step = 10 ** Math.floor(Math.log10(top)) / 2;
  const high = Math.ceil(top / step) * step;
  const low = kind === 'gap' ? -high : 0;
  const colours = stops[kind][isDark() ? 'dark' : 'light'];
  const colourOf = (value) => {
    const at = Math.max(0, Math.min(1, (value - low) / (high - low))) * (colours.length - 1);
    const k = Math.min(Math.floor(at), colours.length - 2);
    return `color-mix(in srgb, ${colours[k + 1]} ${(100 * (at - k)).toFixed(1)}%, ${colours[k]})`;
  };
  return { low, high, colours, colourOf };
}

// Begins a path through places of the canvas, x and y of each.
export function pathThrough(c, ...places) {
  c.beginPath();
  for (let k = 0; k < places.length; k += 2) c[k === 0 ? 'moveTo' : 'lineTo'](places[k], places[k + 1]);
}
export function strokeThrough(c, colour, width, ...places) {
  c.strokeStyle = colour;
  c.lineWidth = width;
  pathThrough(c, ...places);
  c.stroke();
}
export function strokeBox(c, colour, width, ...box) {
  c.strokeStyle = colour;
  c.lineWidth = width;
  c.strokeRect(...box);
}

// The direction of each arrow key on the floor.
export const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

// The transformation from the floor to the canvas.
export function fit(points, width, height, margin = 28, leastM = 2) {
  const placed = points.filter(([x, y]) => Number.isFinite(x) && Number.isFinite(y));
  // The middle along an axis, and the scale at which the points fit there.
  const along = (axis, pixels) => {
    const values = placed.length > 0 ? placed.map((point) => point[axis]) : [-leastM, leastM];
    const low = values.reduce((a, b) => Math.min(a, b));
    const high = values.reduce((a, b) => Math.max(a, b));
    return [(low + high) / 2, (pixels - 2 * margin) / Math.max(high - low, leastM)];
  };
  const [[cx, wide], [cy, tall]] = [along(0, width), along(1, height)];
  return viewOf(Math.min(wide, tall), cx, cy, width, height);
}

export const viewOf = (scale, cx, cy, width, height) => ({
  scale,
  width,
  height,
  to: (x, y) => [width / 2 + (x - cx) * scale, height / 2 - (y - cy) * scale],
  from: (px, py) => [cx + (px - width / 2) / scale, cy - (py - height / 2) / scale],
});

function niceLength(metre) {
  const power = 10 ** Math.floor(Math.log10(metre));
  return [5, 2, 1].map((k) => k * power).find((k) => k <= metre) ?? power;
}

function drawGrid(c, view) {
  const { graticule } = palette();
  const step = niceLength(90 / view.scale);
  const [left, top] = view.from(0, 0);
  const [right, bottom] = view.from(view.width, view.height);
  const sharp = (px) => Math.round(px) + 0.5;
  for (let x = Math.ceil(left / step) * step; x <= right; x += step) {
    const px = sharp(view.to(x, 0)[0]);
    strokeThrough(c, graticule, 1, px, 0, px, view.height);
  }
  for (let y = Math.ceil(bottom / step) * step; y <= top; y += step) {
    const py = sharp(view.to(0, y)[1]);
    strokeThrough(c, graticule, 1, 0, py, view.width, py);
  }
}

function drawScaleBar(c, view) {
  const { ink } = palette();
  const metre = niceLength(120 / view.scale);
  const long = metre * view.scale;
  const x = 14.5;
  const y = view.height - 14.5;
  strokeThrough(c, ink, 1.5, x, y - 5, x, y, x + long, y, x + long, y - 5);
  c.fillStyle = ink;
  c.font = '12px "Liberation Sans", "Helvetica Neue", Arial, sans-serif';
  c.textAlign = 'left';
  c.textBaseline = 'alphabetic';
  c.fillText(`${digits(metre, 1)} m`, x + long + 6, y);
}

export function drawRobot(c, view, x, y, heading, colour) {
  const [px, py] = view.to(x, y);
  c.save();
  c.translate(px, py);
  c.rotate(-heading);
  c.fillStyle = colour;
  c.strokeStyle = palette().screen;
  c.lineWidth = 2;
  pathThrough(c, 11, 0, -7, 7, -3.5, 0, -7, -7);
  c.closePath();
  c.stroke();
  c.fill();
  c.restore();
}

// A canvas to scale with grid and scale bar, which fills its box at the screen's density. Between them
// `draw(context, view)` draws in the view that `viewFor(width, height)` gives; `onPlace(x m, y m, view,
// event)` is called where the pointer moves or clicks.
export function FloorView({ viewFor, draw, under = drawGrid, onPlace, height, changes, children, ...more }) {
  const canvas = useRef(null);
  const view = useRef(null);
  const latest = useRef(null);
  const dark = useTheme();
  latest.current = () => {
    const { current: at } = canvas;
    const width = at?.clientWidth ?? 0;
    if (width === 0) return;
    const density = devicePixelRatio || 1;
    at.width = Math.round(width * density);
    at.height = Math.round(height * density);
    const c = at.getContext('2d');
    c.scale(density, density);
    const v = (view.current = viewFor(width, height));
    under(c, v);
    draw(c, v);
    drawScaleBar(c, v);
  };
  useLayoutEffect(() => {
    const observer = new ResizeObserver(() => latest.current());
    observer.observe(canvas.current);
    return () => observer.disconnect();
  }, [height]);
  useEffect(() => latest.current(), [dark, ...changes]);
  const point = (event) =>
    view.current && onPlace?.(...view.current.from(...placeIn(event)), view.current, event);
  return (
    <div class="floor-box">
      <canvas
        class="floor"
        role="img"
        ref={canvas}
        style={{ display: 'block', width: '100%', height: `${height}px` }}
        onClick={point}
        onPointerMove={point}
        {...more}
      />
      {children}
    </div>
  );
}

// The place of the pointer in the element, in pixels.
export function placeIn(event) {
  const box = event.currentTarget.getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
}

export function drawDot(c, [x, y], radius, colour) {
  c.beginPath();
  c.arc(x, y, radius, 0, 7);
  c.fillStyle = colour;
  c.fill();
  c.stroke();
}

function drawEnds(c, view, points) {
  const p = palette();
  c.lineWidth = 2;
  c.strokeStyle = p.ink;
  drawDot(c, view.to(...points[0]), 5, p.screen);
  const [x, y] = view.to(...points[points.length - 1]);
  c.fillStyle = p.ink;
  c.fillRect(x - 4.5, y - 4.5, 9, 9);
}

function drawUnder(c, view, points) {
  c.setLineDash([5, 4]);
  strokeThrough(c, palette().muted, 1.25, ...points.flatMap(([x, y]) => view.to(x, y)));
  c.setLineDash([]);
}

// A text at x, or left of `before` where there is no room.
export function drawText(c, view, text, x, y, colour, before = view.width - 4) {
  c.font = '12px "Liberation Sans", "Helvetica Neue", Arial, sans-serif';
  c.textAlign = 'left';
  c.textBaseline = 'middle';
  c.lineWidth = 3;
  c.strokeStyle = palette().screen;
  const wide = c.measureText(text).width;
  const at = x + wide > view.width ? before - wide : x;
  c.strokeText(text, at, y);
  c.fillStyle = colour;
  c.fillText(text, at, y);
}

// Outlines of zones with their numbers and, where available, their departure.
export function drawZones(c, view, zones) {
  const p = palette();
  zones.forEach((zone, k) => {
    const [left, top] = view.to(zone.x_min_m, zone.y_max_m);
    const [right, bottom] = view.to(zone.x_max_m, zone.y_min_m);
    const percent = Math.round(100 * zone.departure);
    const more = Number.isFinite(percent) ? `, ${percent > 0 ? '+' : ''}${percent} %` : '';
    const text = `Zone ${k + 1}${more}`;
    const box = [left - 2, top - 2, right - left + 4, bottom - top + 4];
    strokeBox(c, p.screen, 4, ...box);
    strokeBox(c, p.gap, 2, ...box);
    drawText(c, view, text, left, Math.max(top - 10, 10), p.gap);
  });
}

// The power of a trace's k-th part, modelled where it is not measured; null where neither is known.
export const powerAt = ({ measured_power_w: measured, modelled_power_w: modelled }, k) =>
  measured.mean[k] ?? modelled.mean[k];

// Rows [x m, y m, value(k)] of a trace.
export const rowsOf = ({ x_m: x, y_m: y }, value) => x.map((m, k) => [m ?? NaN, y[k] ?? NaN, value?.(k)]);

// `points`: rows [x m, y m, value]. `cursor`: the marked row, or null. `robot`: [x m, y m, heading] of
// the robot, in place of marks of the ends. `under`: a path drawn dashed below it.
export function FloorPath({ points, kind = 'power', height = 380, label, cursor, robot, under }) {
  const shown = points.filter(([x, y]) => Number.isFinite(x) && Number.isFinite(y));
  useTheme(); // the scale is of the theme
  const values = shown.map((row) => row[2]);
  const scale = scaleFor(kind, values);
  const changes = [points, kind, cursor, robot, under];
  const viewFor = (width, tall) =>
    fit([...shown, ...(robot ? [robot] : []), ...(under ?? [])], width, tall, 34);
  const draw = (c, view) => {
    if (under) drawUnder(c, view, under);
    c.lineCap = 'round';
    c.lineJoin = 'round';
    for (let k = 1; k < shown.length; ++k) {
      const colour = Number.isFinite(values[k]) ? scale.colourOf(values[k]) : palette().line;
      strokeThrough(c, colour, 3.2, ...view.to(...shown[k - 1]), ...view.to(...shown[k]));
    }
    if (robot) drawRobot(c, view, ...robot, palette().ink);
    else if (shown.length > 1) drawEnds(c, view, shown);
    const at = points[cursor];
    if (at && Number.isFinite(at[0])) {
      const [px, py] = view.to(at[0], at[1]);
      strokeThrough(c, palette().ink, 1, px, 0, px, view.height);
      strokeThrough(c, palette().ink, 1, 0, py, view.width, py);
      drawDot(c, [px, py], 6, palette().accent);
    }
  };
  return (
    <FloorView viewFor={viewFor} draw={draw} height={height} changes={changes} aria-label={label}>
      {values.some((value) => value > 0 || kind === 'gap') && (
        <Legend scale={scale} title={kind === 'gap' ? 'measured − modelled' : 'power'} />
      )}
    </FloorView>
  );
}

export const Legend = ({ scale, title, unit = 'W' }) => (
  <div class="row legend">
    <span>{title}</span>
    <span class="number">{digits(scale.low, 2)}</span>
    <span class="colours" style={{ background: `linear-gradient(90deg, ${scale.colours})` }} />
    <span class="number">{`${digits(scale.high, 2)}\u00a0${unit}`}</span>
  </div>
);
