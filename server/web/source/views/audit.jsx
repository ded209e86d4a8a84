import { useState } from 'preact/hooks';
import { useLive } from '../live.js';
import { keepInAddress } from '../route.js';
import { Answer, Empty, useOptions, useTitleOf } from '../widgets.jsx';
import { Events, useEvents } from './events.jsx';

const step = 200;

// What happened to robots and their models, newest first.
export function Audit({ given }) {
  useTitleOf('Log');
  const live = useLive();
  const [robot, setRobot] = useState(given.robot ?? '');
  const [count, setCount] = useState(step);
  const options = useOptions([...live.robots.keys()].sort());
  const events = useEvents({ robotId: robot || undefined, count });
  const choose = (event) => {
    setRobot(event.currentTarget.value);
    keepInAddress({ robot: event.currentTarget.value });
  };
  return (
    <>
      <div class="heading">
        <h1>Log</h1>
        <span class="note">adoptions of models, drifts, diagnoses, charges, undeclared payloads</span>
      </div>
      <div class="filters">
        <label class="field">
          <span>Robot</span>
          <select value={robot} onChange={choose}>
            <option value="">all</option>
            {options}
          </select>
        </label>
        <button type="button" onClick={events.reload}>
          Refresh
        </button>
      </div>
      <Answer of={events} what="the log">
        {(list) =>
          list.length === 0 ? (
            <Empty title="Nothing has happened yet">Adoptions, drifts and diagnoses are listed here.</Empty>
          ) : (
            <>
              <Events events={list} />
              {!robot && list.length >= count && (
                <p class="fold">
                  <button type="button" onClick={() => setCount(count + 5 * step)}>
                    Show older entries
                  </button>
                </p>
              )}
            </>
          )
        }
      </Answer>
    </>
  );
}
