// The map of a level: its plan, grid and scale, chargers, and what `draw(context, view)` adds.
import { useEffect, useState } from 'preact/hooks';
import { idPath } from '../api.js';
import { FloorView, drawRobot, drawText, fit, pathThrough } from '../floor.jsx';
import { isDark, palette } from '../theme.js';
import { useNarrow } from '../widgets.jsx';

export const planPath = ({ map, level }) => `/v1/maps/${idPath(map)}/levels/${idPath(level)}`;

// The decoded image of the level; null until loaded, and without a plan. As an image, an SVG runs no scripts.
export function useImage(level) {
  const [image, setImage] = useState(null);
  const path = level && planPath(level);
  useEffect(() => {
    setImage(null);
    if (!path) return;
    const next = new Image();
    next.onload = () => setImage(next);
    next.src = path;
  }, [path, level?.changed_utime_us]);
  return image;
}

// Metres east and north of the lower left corner, turned about it.
function cornerOf(level, x, y) {
  const [cos, sin] = [Math.cos(level.origin_yaw_rad), Math.sin(level.origin_yaw_rad)];
  return [level.origin_x_m + cos * x - sin * y, level.origin_y_m + sin * x + cos * y];
}

function cornersOf(level, image) {
  const [wide, tall] = [image.naturalWidth * level.resolution_m, image.naturalHeight * level.resolution_m];
  return [0, wide].flatMap((x) => [0, tall].map((y) => cornerOf(level, x, y)));
}

function drawPlan(c, view, level, image) {
  const perPixel = view.scale * level.resolution_m;
  const [left, top] = view.to(...cornerOf(level, 0, image.naturalHeight * level.resolution_m));
  c.save();
  c.translate(left, top);
  c.rotate(-level.origin_yaw_rad);
  c.globalAlpha = 0.75;
  if (isDark()) c.filter = 'invert(1)';
  c.drawImage(image, 0, 0, image.naturalWidth * perPixel, image.naturalHeight * perPixel);
  c.restore();
}

// A line through rows [x m, y m].
export function drawLine(c, view, rows, colour, width = 2) {
  c.strokeStyle = colour;
  c.lineWidth = width;
  c.lineJoin = c.lineCap = 'round';
  c.beginPath();
  let down = false;
  for (const [x, y] of rows) {
    if (Number.isFinite(x) && Number.isFinite(y)) c[down ? 'lineTo' : 'moveTo'](...view.to(x, y));
    down = Number.isFinite(x);
  }
  c.stroke();
}

export function drawNamed(c, view, [x, y, heading], text, colour) {
  drawRobot(c, view, x, y, heading ?? 0, colour);
  const [px, py] = view.to(x, y);
  drawText(c, view, text, px + 13, py - 11, colour, px - 13);
}

function drawCharger(c, view, { x_m: x, y_m: y }) {
  const p = palette();
  const [px, py] = view.to(x, y);
  c.fillStyle = p.screen;
  c.strokeStyle = p.good;
  c.lineWidth = 2;
  c.beginPath();
  c.rect(px - 8, py - 8, 16, 16);
  c.fill();
  c.stroke();
  c.fillStyle = p.good;
  c.translate(px, py);
  pathThrough(c, 1, -6, -4, 1, -0.5, 1, -1, 6, 4, -1, 0.5, -1);
  c.fill();
  c.translate(-px, -py);
}

// `points`: [x m, y m] that are to be seen, where there is no plan. `onPick(x m, y m, m in 12 px)`.
export function MapCanvas({ level, image, points, draw, changes, label, onPick }) {
  const narrow = useNarrow();
  const height = narrow ? 420 : Math.max(420, Math.min(820, innerHeight - 330));
  const viewFor = (width, tall) =>
    fit(image ? cornersOf(level, image) : points, width, tall, image ? 8 : 34, 4);
  const paint = (c, view) => {
    level?.chargers.forEach((charger) => drawCharger(c, view, charger));
    draw(c, view);
  };
  return (
    <FloorView
      viewFor={viewFor}
      draw={paint}
      under={image ? (c, view) => drawPlan(c, view, level, image) : undefined}
      height={height}
      aria-label={label}
      changes={[image, level, height, ...changes]}
      onPlace={(x, y, view, { type }) => type === 'click' && onPick?.(x, y, 12 / view.scale)}
    />
  );
}
