// Fields by which missions, trends and comparisons choose robots and times.
import { useLive } from '../live.js';
import { useOptions } from '../widgets.jsx';

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

// Minutes that local time is ahead of UTC.
export const offsetMin = () => -new Date().getTimezoneOffset();

export const robotsOf = (given) => (given.robot ? given.robot.split(',') : []);

export const Field = ({ label, children }) => (
  <label class="field">
    <span>{label}</span>
    {children}
  </label>
);

export const dayField = (label, value, onChange) => (
  <Field label={label}>
    <input type="date" value={value ?? ''} onChange={(event) => onChange(event.currentTarget.value)} />
  </Field>
);

// A choice of robots, as their ids between commas; each chosen one is a button that leaves it out again.
export function RobotsField({ value, onChange, none }) {
  const live = useLive();
  const chosen = robotsOf({ robot: value });
  const others = [...live.robots.keys()].filter((id) => !chosen.includes(id)).sort();
  const options = useOptions(others);
  const add = (event) => {
    onChange([...chosen, event.currentTarget.value].join(','));
    event.currentTarget.value = '';
  };
  return (
    <div class="field">
      <span>Robots</span>
      <span class="chips">
        {chosen.map((id) => (
          <button
            key={id}
            type="button"
            class="chip"
            aria-label={`Leave out ${id}`}
            onClick={() => onChange(chosen.filter((one) => one !== id).join(','))}
          >
            {id} ×
          </button>
        ))}
        <select aria-label="Robot" value="" onChange={add}>
          <option value="">{chosen.length === 0 ? none : 'and …'}</option>
          {options}
        </select>
      </span>
    </div>
  );
}
