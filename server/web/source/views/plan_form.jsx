// The form of a plan: the robot, the path as legs or drawn points, and the terms.
import { legKinds, newLeg } from '../drive_path.js';
import * as format from '../format.js';
import { Button, Choice } from '../widgets.jsx';
import { Field, NumberInput, fieldsOf } from './choosing.jsx';

function LegFields({ leg, number, set }) {
  return Object.entries(legKinds[leg.kind].fields).map(([key, field]) => (
    <label key={key} class="inline">
      <span class="hidden">{`Leg ${number}, ${field.label}`}</span>
      <NumberInput
        min={field.min}
        required
        title={field.label}
        value={leg[key]}
        onChange={(value) => set({ [key]: value })}
      />
      <span class="unit">{field.unit}</span>
    </label>
  ));
}

function LegTools({ number, count, move, remove }) {
  const button = (text, label, disabled, onClick) => (
    <Button class="plain" disabled={disabled} aria-label={label} onClick={onClick}>
      {text}
    </Button>
  );
  return (
    <span class="leg-tools">
      {button('↑', `Move leg ${number} up`, number === 1, () => move(-1))}
      {button('↓', `Move leg ${number} down`, number === count, () => move(1))}
      {button('×', `Remove leg ${number}`, count === 1, remove)}
    </span>
  );
}

function Legs({ legs, change, fault }) {
  const replace = (k, leg) => change(legs.map((old, at) => (at === k ? leg : old)));
  const move = (k, by) => {
    const next = [...legs];
    [next[k], next[k + by]] = [next[k + by], next[k]];
    change(next);
  };
  return (
    <fieldset class="field legs">
      <legend>Legs</legend>
      <ol>
        {legs.map((leg, k) => (
          <li key={k} class={fault === k ? 'faulty' : ''}>
            <select
              aria-label={`Kind of leg ${k + 1}`}
              value={leg.kind}
              onChange={(e) => replace(k, newLeg(e.currentTarget.value))}
            >
              {Object.entries(legKinds).map(([kind, { name }]) => (
                <option key={kind} value={kind}>
                  {name}
                </option>
              ))}
            </select>
            <span class="leg-fields">
              <LegFields leg={leg} number={k + 1} set={(part) => replace(k, { ...leg, ...part })} />
            </span>
            <LegTools
              number={k + 1}
              count={legs.length}
              move={(by) => move(k, by)}
              remove={() => change(legs.filter((_, at) => at !== k))}
            />
          </li>
        ))}
      </ol>
      <Button onClick={() => change([...legs, newLeg('straight')])}>Add a leg</Button>
    </fieldset>
  );
}

const length = (points) =>
  points.slice(1).reduce((sum, [x, y], k) => sum + Math.hypot(x - points[k][0], y - points[k][1]), 0);

const terms = [
  ['payload', 'Payload', 'kg', '0'],
  ['deadline', 'Deadline', 's', 'free'],
  ['value', 'Value of time', 'W', '0'],
  ['charge', 'Charge now', '%', 'live'],
];

function Terms({ given, change }) {
  return (
    <div class="terms">
      {terms.map(([key, label, unit, placeholder]) => (
        <Field key={key} label={label}>
          <span class="with-unit">
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
  );
}

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
      <Choice
        label="How to give the path"
        {...field.of('way')}
        options={{ legs: 'Enter legs', draw: 'Draw' }}
      />
      {given.way === 'legs' ? (
        <Legs legs={given.legs} change={(legs) => change({ legs })} fault={fault} />
      ) : (
        <p class="note">
          {given.points.length} points, {format.text(format.length(length(given.points)))}. Draw on the floor.
        </p>
      )}
      <Terms given={given} change={change} />
      <button type="submit" class="primary" disabled={given.robot === ''}>
        {busy ? 'Computing …' : 'Compute'}
      </button>
    </form>
  );
}
