// The layers of the map above the plan.
import { drawRobot, drawText, pathThrough } from '../floor.jsx';
import { palette } from '../theme.js';

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

export function drawCharger(c, view, { x_m: x, y_m: y }) {
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
