// What the map shows above the plan.
import { drawRobot } from '../floor.jsx';
import { palette } from '../theme.js';

const font = '12px "Liberation Sans", "Helvetica Neue", Arial, sans-serif';

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

export function drawText(c, text, x, y, colour) {
  c.font = font;
  c.textAlign = 'left';
  c.textBaseline = 'middle';
  c.lineWidth = 3;
  c.strokeStyle = palette().screen;
  c.strokeText(text, x, y);
  c.fillStyle = colour;
  c.fillText(text, x, y);
}

export function drawNamed(c, view, [x, y, heading], text, colour) {
  drawRobot(c, view, x, y, heading ?? 0, colour);
  const [px, py] = view.to(x, y);
  c.font = font;
  const wide = c.measureText(text).width;
  drawText(c, text, px + 13 + wide > view.width ? px - 13 - wide : px + 13, py - 11, colour);
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
  c.beginPath();
  [
    [1, -6],
    [-4, 1],
    [-0.5, 1],
    [-1, 6],
    [4, -1],
    [0.5, -1],
  ].forEach(([dx, dy], k) => c[k === 0 ? 'moveTo' : 'lineTo'](px + dx, py + dy));
  c.fill();
}

export function drawZones(c, view, zones) {
  const p = palette();
  zones.forEach((zone, k) => {
    const [left, top] = view.to(zone.x_min_m, zone.y_max_m);
    const [right, bottom] = view.to(zone.x_max_m, zone.y_min_m);
    c.save();
    c.globalAlpha = 0.14;
    c.fillStyle = p.gap;
    c.fillRect(left, top, right - left, bottom - top);
    c.restore();
    c.strokeStyle = p.gap;
    c.lineWidth = 1.5;
    c.strokeRect(left, top, right - left, bottom - top);
    const more = `${zone.departure > 0 ? '+' : ''}${Math.round(100 * zone.departure)} %`;
    drawText(c, `Zone ${k + 1}, ${more}`, left + 4, top - 9, p.gap);
  });
}
