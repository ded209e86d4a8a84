// Upload and removal of a level's plan.
import { useState } from 'preact/hooks';
import { del, putFile, query } from '../api.js';
import { ConfirmButton } from '../dialog.jsx';
import { Button, Failure, Panel } from '../widgets.jsx';
import { Field, fieldsOf } from './choosing.jsx';
import { planPath } from './map_canvas.jsx';

const numbers = [
  ['resolution_m', 'Side of a pixel', 'm'],
  ['origin_x_m', 'Lower left corner, x', 'm'],
  ['origin_y_m', 'Lower left corner, y', 'm'],
  ['origin_yaw_rad', 'Rotation', 'rad'],
];

// The fields of a map.yaml of ROS.
function fromMapYaml(text) {
  const resolution = /^resolution:\s*([-+.\deE]+)/m.exec(text)?.[1];
  const origin =
    /^origin:\s*\[([^\]]+)\]/m
      .exec(text)?.[1]
      .split(',')
      .map((part) => part.trim()) ?? [];
  const found = {
    resolution_m: resolution,
    origin_x_m: origin[0],
    origin_y_m: origin[1],
    origin_yaw_rad: origin[2],
  };
  return Object.fromEntries(
    Object.entries(found).filter(([, value]) => Number.isFinite(Number(value ?? NaN))),
  );
}

export function FloorPlanForm({ place, level, onChange }) {
  const [given, setGiven] = useState({
    ...place,
    ...level,
    chargers: level?.chargers.map(({ x_m: x, y_m: y }) => `${x},${y}`).join(';') ?? '',
  });
  const [file, setFile] = useState(null);
  const [error, setError] = useState(null);
  const set = (part) => setGiven((before) => ({ ...before, ...part }));
  const send = async (event) => {
    event.preventDefault();
    const values = Object.fromEntries(
      [...numbers.map(([key]) => key), 'chargers'].map((key) => [key, given[key]]),
    );
    try {
      // Without another image the stored one is kept.
      await putFile(planPath(given) + query(values), file ?? (await (await fetch(planPath(level))).blob()));
      setError(null);
      onChange(given);
    } catch (failure) {
      setError(failure);
    }
  };
  const { text } = fieldsOf(given, set);
  const name = { required: true, maxlength: 47, pattern: '[A-Za-z0-9._\\-]+' };
  return (
    <details class="model">
      <summary>{level ? 'Replace or remove the floor plan' : 'Add a floor plan'}</summary>
      <Panel title="Floor plan">
        <form class="filters" onSubmit={send}>
          {text('Map', 'map', name)}
          {text('Level', 'level', name)}
          <Field label="Image, PNG or SVG, at most 4 MB">
            <input
              type="file"
              required={!level}
              accept="image/png,image/svg+xml"
              onChange={(e) => setFile(e.currentTarget.files[0])}
            />
          </Field>
          <Field label="map.yaml of ROS, for the values below">
            <input
              type="file"
              accept=".yaml,.yml"
              onChange={async (e) => set(fromMapYaml((await e.currentTarget.files[0]?.text()) ?? ''))}
            />
          </Field>
          {numbers.map(([key, label, unit]) =>
            text(`${label}, ${unit}`, key, {
              key,
              inputmode: 'decimal',
              required: key === 'resolution_m',
              class: 'short',
            }),
          )}
          {text('Chargers, x,y;x,y in m', 'chargers', { placeholder: 'none' })}
          <Button type="submit" class="primary" needs="admin">
            Store
          </Button>
          {level && (
            <ConfirmButton
              label="Remove"
              title={`Remove the plan of ${level.map}, ${level.level}?`}
              needs="admin"
              onConfirm={() => del(planPath(level)).then(() => onChange({}), setError)}
            >
              <p>Robots on this level are shown without a plan.</p>
            </ConfirmButton>
          )}
        </form>
        {error && <Failure error={error} />}
      </Panel>
    </details>
  );
}
