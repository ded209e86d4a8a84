import { useState } from 'preact/hooks';
import { useLive } from '../live.js';
import { keepInAddress } from '../route.js';
import { Answer, Choice, Empty, useOptions, useTitleOf } from '../widgets.jsx';
import { Events, useEvents } from './events.jsx';
import { Requests } from './requests.jsx';

const step = 200;
const subjects = [
  ['robots', 'Robots and models'],
  ['requests', 'Requests'],
];

// Events of robots and their models, newest first.
function RobotEvents({ given }) {
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

export function Audit({ given }) {
  useTitleOf('Log');
  const [subject, setSubject] = useState(given.of === 'requests' ? 'requests' : 'robots');
  const choose = (value) => {
    setSubject(value);
    keepInAddress({ of: value === 'robots' ? '' : value });
  };
  return (
    <>
      <div class="heading">
        <h1>Log</h1>
        <span class="note">
          {subject === 'requests'
            ? 'changes, sign-ins and rejected requests'
            : 'adoptions of models, drifts, diagnoses, charges, undeclared payloads'}
        </span>
        <span class="spring" />
        <Choice label="Of" options={subjects} value={subject} onChange={choose} />
      </div>
      {subject === 'requests' ? <Requests /> : <RobotEvents given={given} />}
    </>
  );
}
