// Fields by which missions, trends and comparisons choose robots and times.
import { useEffect, useRef, useState } from 'preact/hooks';
import { useLive } from '../live.js';
import { Button, Options, useNarrow } from '../widgets.jsx';

// "2026-11-21T06:10" or "2026-11-21" in local time, as the inputs of the browser give it, to microseconds.
const dateOf = (local) => new Date(local.includes('T') ? local : `${local}T00:00`);
const utimeUs = (local) => (local ? dateOf(local).getTime() * 1000 : undefined);

// The end of that day or minute: `to` of the service is exclusive.
function endUs(local) {
  if (!local) return undefined;
  const end = dateOf(local);
  if (local.includes('T')) end.setSeconds(60, 0);
  else end.setDate(end.getDate() + 1);
  return end.getTime() * 1000;
}

// The period of the fields From and To as parameters of the service; it includes the day or minute of To.
export const timesOf = (from, to) => ({ from_utime_us: utimeUs(from), to_utime_us: endUs(to) });

// True if the period is empty.
export const misordered = (from, to) => Boolean(from && to) && utimeUs(from) >= endUs(to);

export const Misordered = () => (
  <p class="fault" role="alert">
    From must not be later than To.
  </p>
);

export const Field = ({ label, children }) => (
  <label class="field">
    <span>{label}</span>
    {children}
  </label>
);

// A choice of one of `options`: ids, or [id, name].
export const SelectField = ({ label, value, onChange, options }) => (
  <Field label={label}>
    <select value={value ?? ''} onChange={(event) => onChange(event.currentTarget.value)}>
      <Options of={options} />
    </select>
  </Field>
);

export const TextField = ({ label, value, onChange, ...more }) => (
  <Field label={label}>
    <input type="text" value={value ?? ''} onInput={(e) => onChange(e.currentTarget.value)} {...more} />
  </Field>
);

// An input that gives its value when complete (onChange); until then typed text survives drawing the view.
export function TypedInput({ value = '', ...more }) {
  const [text, setText] = useState(value);
  useEffect(() => setText(value), [value]);
  return <input {...more} value={text} onInput={(event) => setText(event.currentTarget.value)} />;
}

// A number, undefined without one. Typed text stays while it is that number: "0.0" becomes "0.05".
export function NumberInput({ value, onChange, ...more }) {
  const [typed, setTyped] = useState('');
  const numberOf = (text) => (text === '' ? undefined : Number(text));
  const take = ({ currentTarget: input }) => {
    setTyped(input.value);
    onChange(numberOf(input.value));
  };
  const text = numberOf(typed) === value ? typed : String(value ?? '');
  return <input type="number" step="any" {...more} value={text} onInput={take} />;
}

// A day, or with `minutes` a time, as year, month and day; the browser's own field has its language's order.
export function DayField({ label, value = '', onChange, minutes }) {
  const picker = useRef(null);
  const pattern = minutes ? '\\d{4}-\\d\\d-\\d\\d \\d\\d:\\d\\d' : '\\d{4}-\\d\\d-\\d\\d';
  const take = ({ currentTarget: input }) => {
    if (input.reportValidity()) onChange(input.value.replace(' ', 'T'));
  };
  return (
    <div class="field">
      <span>{label}</span>
      <span class="row with-unit">
        <TypedInput
          type="text"
          style={{ width: '160px' }}
          aria-label={label}
          placeholder={minutes ? 'YYYY-MM-DD hh:mm' : 'YYYY-MM-DD'}
          pattern={pattern}
          value={value.replace('T', ' ')}
          onChange={take}
        />
        <Button aria-label={`Choose ${label}`} onClick={() => picker.current.showPicker()}>
          ▾
        </Button>
        <input
          ref={picker}
          style={{ width: 0, padding: 0, border: 0, marginLeft: '-6px' }}
          type={minutes ? 'datetime-local' : 'date'}
          tabindex="-1"
          aria-hidden="true"
          value={value}
          onChange={take}
        />
      </span>
    </div>
  );
}

// Fields that change the parameters `given` by `change({key: value})`. `of(key, now)`: the props of one.
export function fieldsOf(given, change) {
  const of = (key, value = given[key]) => ({ value, onChange: (next) => change({ [key]: next }) });
  return {
    of,
    day: (label, key, more) => <DayField label={label} {...of(key)} {...more} />,
    select: (label, key, options) => <SelectField label={label} options={options} {...of(key)} />,
    text: (label, key, more) => <TextField label={label} {...of(key)} {...more} />,
  };
}

// The attributes of a field with the name of a map or a level.
export const placeName = { maxlength: 47, pattern: '[A-Za-z0-9._\\-]+' };

// The fields of a view, folded on a narrow screen.
export function Filters({ label, children }) {
  const form = (
    <form class="wrap filters" aria-label={label} onSubmit={(event) => event.preventDefault()}>
      {children}
    </form>
  );
  return useNarrow() ? (
    <details class="model">
      <summary>{label}</summary>
      {form}
    </details>
  ) : (
    form
  );
}

// A choice of some of `options` [id, name], as ids between commas; each chosen one is a button that drops it.
export function Several({ label, one, value, onChange, options, none }) {
  const chosen = value ? value.split(',') : [];
  const names = new Map(options);
  const left = options.filter(([id]) => !chosen.includes(id));
  const add = (event) => {
    onChange([...chosen, event.currentTarget.value].join(','));
    event.currentTarget.value = '';
  };
  return (
    <div class="field">
      <span>{label}</span>
      <span class="row wrap with-unit">
        {chosen.map((id) => (
          <button
            key={id}
            type="button"
            class="chip"
            aria-label={`Remove ${names.get(id) ?? id}`}
            onClick={() => onChange(chosen.filter((other) => other !== id).join(','))}
          >
            {names.get(id) ?? id} ×
          </button>
        ))}
        <select aria-label={one} value="" onChange={add}>
          <option value="">{chosen.length === 0 ? none : 'and …'}</option>
          <Options of={left} />
        </select>
      </span>
    </div>
  );
}

export const SomeRobots = ({ ids, ...more }) => (
  <Several label="Robots" one="Robot" options={ids.map((id) => [id, id])} {...more} />
);

const useIds = () => [...useLive().robots.keys()].sort();
export const RobotsField = (more) => <SomeRobots ids={useIds()} {...more} />;
export const RobotField = (more) => (
  <SelectField label="Robot" options={[['', 'all'], ...useIds()]} {...more} />
);
