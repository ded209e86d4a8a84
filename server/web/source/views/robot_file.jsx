// Adding, editing and removing a robot: its file from the disk, from another robot, or by a form that is made
// from the service's schema of robot files, and reviewed by the service as it changes.
import { useMemo, useState } from 'preact/hooks';
import { del, delayed, get, idPath, post, put, query, useGet, useRead } from '../api.js';
import { ConfirmButton } from '../dialog.jsx';
import * as format from '../format.js';
import { reloadFleet, useLive, useModelled } from '../live.js';
import { forgetModel } from '../models.js';
import { robotLink } from '../route.js';
import { refusalFor } from '../session.js';
import { Answer, Button, Failure, Heading, Panel, Readouts, useTitleOf } from '../widgets.jsx';
import { Changes, changesOf, unitOf } from './changes.jsx';
import { Field, NumberInput, SelectField, fieldsOf, placeName } from './choosing.jsx';

const reviewMs = 300;

function named(key) {
  const [name, unit] = unitOf(key);
  return { label: name[0].toUpperCase() + name.slice(1), unit };
}

// The groups of the form: fields that are a number, a pair of numbers or a text. Others are kept as they are.
function groupsOf(document) {
  const resolved = (schema) =>
    schema.$ref ? { ...document.components.schemas[schema.$ref.split('/').at(-1)], ...schema } : schema;
  const isField = ({ type, maxItems, items }) =>
    ['number', 'string'].includes(type) || (type === 'array' && maxItems === 2 && items.type === 'number');
  const fieldsOf = (of, path) =>
    Object.entries(of.properties)
      .map(([key, schema]) => ({
        ...resolved(schema),
        ...named(key),
        pointer: `${path}/${key}`,
        required: of.required.includes(key),
      }))
      .filter(isField);
  const robot = document.components.schemas.robot;
  const groups = Object.entries(robot.properties)
    .map(([key, schema]) => ({ key, ...resolved(schema) }))
    .filter(({ properties }) => properties);
  return [
    { title: 'Robot', fields: fieldsOf(robot, '') },
    ...groups.map((of) => ({
      key: of.key,
      title: named(of.key).label,
      note: of.description.replaceAll('\u0060', ''),
      fields: fieldsOf(of, `/${of.key}`),
    })),
  ];
}

const emptyOf = (groups) => Object.fromEntries(groups.filter(({ key }) => key).map(({ key }) => [key, {}]));

const keysOf = (pointer) => pointer.slice(1).split('/');
const valueAt = (file, pointer) => keysOf(pointer).reduce((of, key) => of?.[key], file);

// The file with another value there; without the member for undefined.
function changed(file, [key, ...rest], value) {
  const next = { ...file };
  if (rest.length > 0) next[key] = changed(file[key] ?? {}, rest, value);
  else if (value === undefined) delete next[key];
  else next[key] = value;
  return next;
}

const Bounded = ({ of, label, ...more }) => (
  <NumberInput
    min={of.minimum ?? of.exclusiveMinimum}
    max={of.maximum ?? of.exclusiveMaximum}
    aria-label={label}
    placeholder={of.default === undefined ? '' : String(of.default)}
    {...more}
  />
);

function Input({ of, value, fixed, onChange }) {
  if (of.type === 'string')
    return (
      <input
        type="text"
        aria-label={of.label}
        pattern={of.pattern}
        value={value ?? ''}
        readOnly={fixed}
        onInput={(e) => onChange(e.currentTarget.value || undefined)}
      />
    );
  if (of.type === 'number') return <Bounded of={of} label={of.label} value={value} onChange={onChange} />;
  const pair = Array.isArray(value) ? value : [];
  const set = (side, v) => {
    const next = [pair[0] ?? null, pair[1] ?? null].with(side, v ?? null);
    onChange(next.some((one) => one !== null) ? next : undefined);
  };
  return ['right', 'left'].map((name, side) => (
    <Bounded
      key={name}
      of={of.items}
      label={`${of.label}, ${name}`}
      value={pair[side] ?? undefined}
      onChange={(v) => set(side, v)}
    />
  ));
}

function FileField({ of, file, fixed, finding, onChange }) {
  const value = valueAt(file, of.pointer);
  const take = (next) => onChange(changed(file, keysOf(of.pointer), next));
  return (
    <div class="field">
      <span title={of.description}>
        {of.label}
        {of.type === 'array' && ', right and left'}
        {!of.required && ' (optional)'}
      </span>
      <span class="row with-unit">
        <Input of={of} value={value} fixed={fixed} onChange={take} />
        <span class="unit">{of.unit}</span>
      </span>
      {finding && value !== undefined && (
        <span class={finding.fault ? 'below fault' : 'below'}>{finding.says}</span>
      )}
    </div>
  );
}

// The service's review of the file; null until it is read.
function useReview(file) {
  const read = (signal) => post('/v1/robot-checks', file, signal);
  return useRead(delayed(read, reviewMs), !refusalFor('plan') && JSON.stringify(file)).value;
}

function Review({ of, file }) {
  const missing = of.findings.filter((f) => f.fault && valueAt(file, f.field) === undefined);
  const others = of.findings.filter((f) => !missing.includes(f));
  const hours = format.known(of.standing_h) ? format.about(3600 * of.standing_h) : '–';
  const nameOf = (key) => unitOf(key)[0];
  return (
    <>
      <Readouts
        rows={[
          ['Top speed of the motors', format.unit(of.top_speed_m_s, 'm/s')],
          ['Greatest acceleration', format.unit(of.acceleration_m_s2, 'm/s²')],
          ['Full battery', format.unit(of.energy_wh, 'Wh')],
          ['Run time at rest', hours],
        ]}
      />
      {missing.length > 0 && (
        <p class="note foot">
          {format.count(missing.length, 'value is', 'values are')} missing:{' '}
          {missing
            .slice(0, 6)
            .map((f) => keysOf(f.field).map(nameOf).join(' '))
            .join(', ')}
          {missing.length > 6 && ' …'}
        </p>
      )}
      <ul class="reasons">
        {others.map((f) => (
          <li key={f.field + f.says} class={f.fault ? 'fault' : ''}>
            <code>{keysOf(f.field).join('.')}</code> {f.says}
          </li>
        ))}
      </ul>
      {of.findings.length === 0 && <p class="note foot">No value is implausible.</p>}
    </>
  );
}

// Where the file comes from: the disk, or another robot.
function Sources({ onFile, onError }) {
  const robots = [['', 'choose …'], ...useModelled()];
  const read = async (event) => {
    const [chosen] = event.currentTarget.files;
    try {
      if (chosen) onFile(JSON.parse(await chosen.text()));
    } catch {
      onError({ title: 'Not a robot file', message: `${chosen.name} is not JSON.` });
    }
  };
  const copy = (id) =>
    get(`/v1/robots/${idPath(id)}`).then(
      ({ model }) => onFile({ ...model, robot_id: undefined, effects: undefined }),
      onError,
    );
  return (
    <div class="wrap filters">
      <Field label="Load a robot file">
        <input type="file" accept=".json,application/json" onChange={read} />
      </Field>
      <SelectField label="Copy the values of a robot" value="" onChange={copy} options={robots} />
    </div>
  );
}

function Place({ id, onError }) {
  const maps = useGet('/v1/maps');
  const here = maps.value?.robots.find((robot) => robot.robot_id === id);
  const [place, setPlace] = useState({});
  const [saved, setSaved] = useState(false);
  if (!here) return null;
  const now = { map: here.map, level: here.level, ...place };
  const orNull = ({ map, level }) => ({ map: map || null, level: level || null });
  const save = () => put(`/v1/robots/${idPath(id)}/place`, orNull(now)).then(() => setSaved(true), onError);
  const { text } = fieldsOf(now, (part) => {
    setSaved(false);
    setPlace({ ...place, ...part });
  });
  return (
    <Panel title="Map and level">
      <div class="wrap filters">
        {text('Map', 'map', placeName)}
        {text('Level', 'level', placeName)}
        <Button needs="operate" onClick={save}>
          {saved ? 'Set' : 'Set map and level'}
        </Button>
      </div>
      <p class="note">
        {here.reported
          ? 'The robot reports these by the covariates map and level, which override the settings.'
          : 'The covariates map and level of the robot override these settings.'}
      </p>
    </Panel>
  );
}

// After the robot is stored or removed: to that view.
function leave(id, hash) {
  forgetModel(id);
  reloadFleet();
  location.hash = hash;
}

function Remove({ id, onError }) {
  const remove = ({ history }) =>
    del(`/v1/robots/${idPath(id)}${query({ history })}`).then(() => leave(id, '#/fleet'), onError);
  return (
    <ConfirmButton
      label="Remove this robot"
      action="Remove"
      title={`Remove ${id}?`}
      needs="admin"
      onConfirm={remove}
    >
      <p>Its mission ends, and its energy is no longer modelled. Later telemetry is only counted.</p>
      <Field label="Its missions and models">
        <select name="history">
          <option value="keep">are kept</option>
          <option value="purge">are deleted, which cannot be undone</option>
        </select>
      </Field>
    </ConfirmButton>
  );
}

// `stored`: the robot's detail; undefined for a new one.
function Form({ groups, id, stored, begun }) {
  const [file, setFile] = useState(stored?.model ?? { ...emptyOf(groups), ...begun });
  const [error, setError] = useState(null);
  const review = useReview(file);
  const findings = new Map((review?.findings ?? []).toReversed().map((f) => [f.field, f]));
  const take = (next) => {
    setError(null);
    setFile(id ? { ...next, robot_id: id } : next);
  };
  const name = file.robot_id ?? '';
  const known = useLive().robots.get(name)?.state.has_model;
  const changes = changesOf(file, stored?.model);
  const doubts = review?.findings.length ?? 0;
  const faulty = review === null || review.findings.some((f) => f.fault);
  const barred =
    refusalFor('admin') ??
    (faulty ? 'Values are missing or invalid.' : undefined) ??
    (!stored && known ? `There is a robot ${name} already.` : undefined) ??
    (stored && changes.length === 0 ? 'Nothing has changed.' : undefined);
  const save = () =>
    put(`/v1/robots/${idPath(name)}`, file).then(() => leave(name, robotLink(name)), setError);
  return (
    <>
      <Sources onFile={take} onError={setError} />
      {error && <Failure error={error} />}
      <div class="columns">
        <div>
          {groups.map(({ title, note, fields }) => (
            <Panel key={title} title={title}>
              {note && <p class="note">{note}</p>}
              <div class="terms file-fields">
                {fields.map((of) => (
                  <FileField
                    key={of.pointer}
                    of={of}
                    file={file}
                    fixed={of.pointer === '/robot_id' && Boolean(id)}
                    finding={findings.get(of.pointer)}
                    onChange={setFile}
                  />
                ))}
              </div>
            </Panel>
          ))}
        </div>
        <div style={{ position: 'sticky', top: '60px' }}>
          <Panel title="Review">
            {review && <Review of={review} file={file} />}
            <p class="row wrap tools">
              <ConfirmButton
                class="primary"
                label={stored ? 'Save' : 'Add this robot'}
                title={stored ? `Change the model of ${name}?` : `Add ${name}?`}
                refusal={barred}
                onConfirm={save}
              >
                {stored ? (
                  <>
                    <p>
                      A new version replaces version {stored.model_version}. Planning uses it at once, the
                      meter from the next mission on.
                    </p>
                    <Changes of={changes} />
                  </>
                ) : (
                  <p>Its energy is modelled from its next mission on.</p>
                )}
                {doubts > 0 && (
                  <p class="fault">
                    {format.count(doubts, 'value is', 'values are')} implausible; see the review.
                  </p>
                )}
              </ConfirmButton>
              {stored && <Remove id={id} onError={setError} />}
            </p>
            {barred && <p class="note">{barred}</p>}
          </Panel>
          {id && <Place id={id} onError={setError} />}
        </div>
      </div>
    </>
  );
}

export function RobotFile({ id, given }) {
  useTitleOf(id ? `Edit ${id}` : 'Add a robot');
  const schema = useGet('/openapi.json');
  const stored = useGet(id && `/v1/robots/${idPath(id)}`);
  const groups = useMemo(() => schema.value && groupsOf(schema.value), [schema.value]);
  return (
    <>
      <Heading
        title={id ? `Edit ${id}` : 'Add a robot'}
        crumbs={<a href={id ? robotLink(id) : '#/fleet'}>{id ?? 'Fleet'}</a>}
      />
      <Answer of={schema} what="the form">
        {() =>
          id ? (
            <Answer of={stored} what="the robot file">
              {(detail) => <Form groups={groups} id={id} stored={detail} />}
            </Answer>
          ) : (
            <Form groups={groups} id={given.robot} begun={given.robot ? { robot_id: given.robot } : {}} />
          )
        }
      </Answer>
    </>
  );
}
