// The form of a plan: the robot, the path as legs or drawn points, and the terms.
import { useRef, useState } from 'preact/hooks';
import { legKinds, newLeg } from '../drive_path.js';
import { FloorView, arrows, drawDot, drawRobot, placeIn, strokeThrough, viewOf } from '../floor.jsx';
import * as format from '../format.js';
import { palette } from '../theme.js';
import { Button, Choice, Options } from '../widgets.jsx';
import { Field, NumberInput, fieldsOf } from './choosing.jsx';

const snapM = 0.25;
const reachPx = 12;
const snapped = (v) => Math.round(v / snapM) * snapM;

const tool = (text, disabled, onClick, more) => (
  <Button onClick={onClick} disabled={disabled} {...more}>
    {text}
  </Button>
);

// A path drawn point by point. Pointer: press adds, drag moves. Keys: arrows move the cross, Enter adds
// there, Backspace takes the last away.
export function DrawPath({ points, change }) {
  const [acrossM, setAcross] = useState(16);
  const [cross, setCross] = useState(null);
  const held = useRef(null);
  const view = useRef(null);
  const near = ([px, py]) =>
    points.findIndex(([x, y]) => {
      const [qx, qy] = view.current.to(x, y);
      return Math.hypot(px - qx, py - qy) < reachPx;
    });
  const floorAt = (p) => view.current.from(...p).map(snapped);
  const add = (point) => {
    const last = points[points.length - 1];
    if (!last || last[0] !== point[0] || last[1] !== point[1]) change([...points, point]);
  };
  const down = (event) => {
    const p = placeIn(event);
    const hit = near(p);
    event.currentTarget.setPointerCapture(event.pointerId);
    if (hit >= 0) held.current = hit;
    else {
      add(floorAt(p));
      held.current = points.length;
    }
  };
  const move = (event) => {
    if (held.current === null) return;
    const point = floorAt(placeIn(event));
    const here = points[held.current];
    if (here && (here[0] !== point[0] || here[1] !== point[1])) change(points.with(held.current, point));
  };
  const up = () => void (held.current = null);
  const key = (event) => {
    const step = event.shiftKey ? 4 * snapM : snapM;
    const way = arrows[event.key];
    const from = cross ?? points[points.length - 1] ?? [0, 0];
    if (way) setCross([from[0] + step * way[0], from[1] + step * way[1]]);
    else if (event.key === 'Enter') add(from);
    else if (event.key === 'Backspace' || event.key === 'Delete') change(points.slice(0, -1));
    else return;
    event.preventDefault();
  };
  const viewFor = (width, tall) => (view.current = viewOf(width / acrossM, 0, 0, width, tall));
  const draw = (c, v) => {
    const p = palette();
    c.lineJoin = 'round';
    const places = points.map(([x, y]) => v.to(x, y));
    strokeThrough(c, p.accent, 3, ...places.flat());
    places.forEach((place, k) => drawDot(c, place, 5, k === points.length - 1 ? p.accent : p.screen));
    const [[x0, y0] = [], [x1, y1] = [x0 + 1, y0]] = points;
    if (points.length > 0) drawRobot(c, v, x0, y0, Math.atan2(y1 - y0, x1 - x0), p.ink);
    if (cross) {
      const [x, y] = v.to(...cross);
      strokeThrough(c, p.ink, 1, x - 12, y, x + 12, y);
      strokeThrough(c, p.ink, 1, x, y - 12, x, y + 12);
    }
  };
  return (
    <div class="draw">
      <FloorView
        viewFor={viewFor}
        draw={draw}
        height={400}
        changes={[points, acrossM, cross]}
        role="application"
        tabindex="0"
        aria-label={`Drawing of the path, ${points.length} points. Arrow keys move the cross, Enter adds a point, Backspace removes the last.${cross ? ` Cross at ${format.digits(cross[0], 3)}, ${format.digits(cross[1], 3)} metres.` : ''}`}
        onPointerDown={down}
        onPointerMove={move}
        onPointerUp={up}
        onPointerCancel={up}
        onKeyDown={key}
      />
      <div class="row wrap tools">
        {tool('Undo point', points.length === 0, () => change(points.slice(0, -1)))}
        {tool('Clear', points.length === 0, () => change([]))}
        {tool('+', acrossM <= 4, () => setAcross(acrossM / 2), { 'aria-label': 'Closer' })}
        {tool('−', acrossM >= 256, () => setAcross(acrossM * 2), { 'aria-label': 'Wider' })}
        <span class="note">
          Click to add a point, drag to move it; points snap to {snapM} m. The robot turns in place at
          corners.
        </span>
      </div>
    </div>
  );
}

// One of the legs: `change(leg)`, `move(by)`, `remove()`.
function Leg({ leg, number, count, faulty, change, move, remove }) {
  const plain = (label) => ({ class: 'plain', 'aria-label': label });
  return (
    <li class={faulty ? 'row wrap faulty' : 'row wrap'}>
      <select
        style={{ width: '132px' }}
        aria-label={`Kind of leg ${number}`}
        value={leg.kind}
        onChange={(e) => change(newLeg(e.currentTarget.value))}
      >
        <Options of={Object.entries(legKinds).map(([kind, { name }]) => [kind, name])} />
      </select>
      <span class="leg-fields">
        {Object.entries(legKinds[leg.kind].fields).map(([key, field]) => (
          <label key={key} class="row" style={{ display: 'inline-flex', gap: '4px', marginRight: '4px' }}>
            <span class="hidden">{`Leg ${number}, ${field.label}`}</span>
            <NumberInput
              style={{ width: '62px' }}
              min={field.min}
              required
              title={field.label}
              value={leg[key]}
              onChange={(value) => change({ ...leg, [key]: value })}
            />
            <span class="unit">{field.unit}</span>
          </label>
        ))}
      </span>
      <span class="row leg-tools" style={{ marginLeft: 'auto' }}>
        {tool('↑', number === 1, () => move(-1), plain(`Move leg ${number} up`))}
        {tool('↓', number === count, () => move(1), plain(`Move leg ${number} down`))}
        {tool('×', count === 1, remove, plain(`Remove leg ${number}`))}
      </span>
    </li>
  );
}

function Legs({ legs, change, fault }) {
  const move = (k, by) => {
    const next = [...legs];
    [next[k], next[k + by]] = [next[k + by], next[k]];
    change(next);
  };
  return (
    <fieldset class="field legs" style={{ minWidth: 0 }}>
      <legend>Legs</legend>
      <ol style={{ margin: '4px 0 10px', borderTop: '1px solid var(--line)' }}>
        {legs.map((leg, k) => (
          <Leg
            leg={leg}
            number={k + 1}
            count={legs.length}
            faulty={fault === k}
            change={(next) => change(legs.with(k, next))}
            move={(by) => move(k, by)}
            remove={() => change(legs.toSpliced(k, 1))}
          />
        ))}
      </ol>
      <Button onClick={() => change([...legs, newLeg('straight')])}>Add a leg</Button>
    </fieldset>
  );
}

const length = (points) =>
  points.slice(1).reduce((sum, [x, y], k) => sum + Math.hypot(x - points[k][0], y - points[k][1]), 0);

const ways = { legs: 'Enter legs', draw: 'Draw' };
const terms = [
  ['payload', 'Payload', 'kg', '0'],
  ['deadline', 'Deadline', 's', 'free'],
  ['value', 'Value of time', 'W', '0'],
  ['charge', 'Charge now', '%', 'live'],
];

// `given`: {robot, way, legs, points, payload, deadline, value, charge}.
export function PlanForm({ given, robots, change, busy, fault, onCompute }) {
  const field = fieldsOf(given, change);
  const submit = (event) => {
    event.preventDefault();
    onCompute();
  };
  return (
    <form class="plan-form" onSubmit={submit}>
      {field.select('Robot', 'robot', robots)}
      <Choice label="How to give the path" {...field.of('way')} options={ways} />
      {given.way === 'legs' ? (
        <Legs legs={given.legs} change={(legs) => change({ legs })} fault={fault} />
      ) : (
        <p class="note">
          {given.points.length} points, {format.text(format.length(length(given.points)))}. Draw on the floor.
        </p>
      )}
      <div class="terms">
        {terms.map(([key, label, unit, placeholder]) => (
          <Field key={key} label={label}>
            <span class="row with-unit">
              <input
                type="number"
                step="any"
                min="0"
                max={unit === '%' ? 100 : undefined}
                placeholder={placeholder}
                value={given[key]}
                onInput={(e) => change({ [key]: e.currentTarget.value })}
              />
              <span class="unit">{unit}</span>
            </span>
          </Field>
        ))}
      </div>
      <button type="submit" class="primary" disabled={given.robot === ''}>
        {busy ? 'Computing …' : 'Compute'}
      </button>
    </form>
  );
}
