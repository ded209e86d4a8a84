import { useEffect, useRef } from 'preact/hooks';
import { palette } from './theme.js';

const spanUs = 90e6;

function draw(canvas, track, width, height) {
  const density = devicePixelRatio || 1;
  const c = canvas.getContext('2d');
  const p = palette();
  if (canvas.width !== width * density) {
    canvas.width = width * density;
    canvas.height = height * density;
  }
  c.setTransform(density, 0, 0, density, 0, 0);
  c.clearRect(0, 0, width, height);
  c.strokeStyle = p.graticule;
  c.lineWidth = 1;
  c.beginPath();
  for (let x = width - 0.5; x > 0; x -= 32) {
    c.moveTo(x, 0);
    c.lineTo(x, height);
  }
  const rows = track.last();
  let high = 1;
  let low = 0;
  for (const [, measured, modelled] of rows) {
    if (measured > high) high = measured;
    if (modelled > high) high = modelled;
    if (measured < low) low = measured;
  }
  const y = (value) => height - 2 - ((value - low) / (high - low)) * (height - 5);
  c.moveTo(0, Math.round(y(0)) + 0.5);
  c.lineTo(width, Math.round(y(0)) + 0.5);
  c.stroke();
  if (rows.length < 2) return;
  const end = rows[rows.length - 1][0];
  for (const [column, colour, thickness] of [
    [2, p.modelled, 1],
    [1, p.measured, 1.5],
  ]) {
    c.strokeStyle = colour;
    c.lineWidth = thickness;
    c.lineJoin = 'round';
    c.beginPath();
    let before = -Infinity;
    for (const row of rows) {
      const x = width - 2 - ((end - row[0]) / spanUs) * width;
      if (!Number.isFinite(row[column])) continue;
      if (row[0] - before > 5e6) c.moveTo(x, y(row[column]));
      else c.lineTo(x, y(row[column]));
      before = row[0];
    }
    c.stroke();
  }
}

// The last minute and a half of a robot's power: measured as a trace, modelled as a thin line behind.
export function Sparkline({ track, revision, dark, width = 128, height = 30 }) {
  const canvas = useRef(null);
  useEffect(() => draw(canvas.current, track, width, height), [track, revision, dark]);
  const style = { width: `${width}px`, height: `${height}px` };
  return <canvas class="sparkline" ref={canvas} style={style} aria-hidden="true" />;
}
