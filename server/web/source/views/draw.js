import { useRef, useState } from 'preact/hooks';
import { html } from '../html.js';
import { Canvas, draw_grid, draw_robot, draw_scale_bar, view_of } from '../floor.js';
import { palette } from '../theme.js';
import { digits } from '../format.js';

const snap_m = 0.25, reach_px = 12;
const snapped = (v) => Math.round(v / snap_m) * snap_m;

// A path drawn point by point. Pointer: press adds, drag moves. Keys: arrows move the cross, Enter adds there,
// Backspace takes the last away.
export function DrawPath({ points, change, height = 400 }) {
  const [across_m, set_across] = useState(16);
  const [cross, set_cross] = useState(null);
  const held = useRef(null), view = useRef(null);
  const at = (event) => {
    const box = event.currentTarget.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const near = ([px, py]) => points.findIndex(([x, y]) => {
    const [qx, qy] = view.current.to(x, y);
    return Math.hypot(px - qx, py - qy) < reach_px;
  });
  const floor_at = (p) => view.current.from(...p).map(snapped);
  const add = (point) => {
    const last = points[points.length - 1];
    if (!last || last[0] !== point[0] || last[1] !== point[1]) change([...points, point]);
  };
  const down = (event) => {
    const p = at(event), hit = near(p);
    event.currentTarget.setPointerCapture(event.pointerId);
    if (hit >= 0) held.current = hit;
    else {
      add(floor_at(p));
      held.current = points.length;
    }
  };
  const move = (event) => {
    if (held.current === null) return;
    const point = floor_at(at(event));
    const here = points[held.current];
    if (here && (here[0] !== point[0] || here[1] !== point[1])) change(points.map((old, k) => (k === held.current ? point : old)));
  };
  const up = () => {
    held.current = null;
  };
  const key = (event) => {
    const step = event.shiftKey ? 4 * snap_m : snap_m;
    const way = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] }[event.key];
    const from = cross ?? points[points.length - 1] ?? [0, 0];
    if (way) set_cross([from[0] + way[0], from[1] + way[1]]);
    else if (event.key === 'Enter') add(from);
    else if (event.key === 'Backspace' || event.key === 'Delete') change(points.slice(0, -1));
    else return;
    event.preventDefault();
  };
  const draw = (c, width, tall) => {
    const v = (view.current = view_of(width / across_m, 0, 0, width, tall)), p = palette();
    draw_grid(c, v);
    c.strokeStyle = c.fillStyle = p.accent;
    c.lineWidth = 3;
    c.lineJoin = 'round';
    c.beginPath();
    points.forEach(([x, y], k) => c[k === 0 ? 'moveTo' : 'lineTo'](...v.to(x, y)));
    c.stroke();
    points.forEach(([x, y], k) => {
      c.beginPath();
      c.arc(...v.to(x, y), 5, 0, 7);
      c.fillStyle = k === points.length - 1 ? p.accent : p.screen;
      c.fill();
      c.stroke();
    });
    if (points.length > 0) draw_robot(c, v, points[0][0], points[0][1], points.length > 1 ? Math.atan2(points[1][1] - points[0][1], points[1][0] - points[0][0]) : 0, p.ink);
    if (cross) {
      const [x, y] = v.to(...cross);
      c.strokeStyle = p.ink;
      c.lineWidth = 1;
      c.beginPath();
      c.moveTo(x - 12, y);
      c.lineTo(x + 12, y);
      c.moveTo(x, y - 12);
      c.lineTo(x, y + 12);
      c.stroke();
    }
    draw_scale_bar(c, v);
  };
  return html`<div class="draw">
    <${Canvas} draw=${draw} height=${height} changes=${[points, across_m, cross]} role="application" tabindex="0"
      label=${`Drawing of the path, ${points.length} points. Arrow keys move the cross, Enter adds a point, Backspace removes the last.${cross ? ` Cross at ${digits(cross[0], 3)}, ${digits(cross[1], 3)} metres.` : ''}`}
      onPointerDown=${down} onPointerMove=${move} onPointerUp=${up} onPointerCancel=${up} onKeyDown=${key} />
    <div class="tools"><button type="button" onClick=${() => change(points.slice(0, -1))} disabled=${points.length === 0}>Undo point</button>
      <button type="button" onClick=${() => change([])} disabled=${points.length === 0}>Clear</button>
      <button type="button" onClick=${() => set_across(across_m / 2)} disabled=${across_m <= 4} aria-label="Closer">+</button>
      <button type="button" onClick=${() => set_across(across_m * 2)} disabled=${across_m >= 256} aria-label="Wider">−</button>
      <span class="note">Press to add, drag to move; snaps to ${snap_m} m. Corners are turned in place.</span></div>
  </div>`;
}
