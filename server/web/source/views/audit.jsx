import { useState } from 'preact/hooks';
import { useLive } from '../live.js';
import { keepInAddress } from '../route.js';
import { Choice, List, useTitleOf } from '../widgets.jsx';
import { SelectField } from './choosing.jsx';
import { Events, useEvents } from './events.jsx';
import { Older, Requests } from './requests.jsx';

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
  const ids = [...live.robots.keys()].sort();
  const events = useEvents({ robotId: robot || undefined, count });
  const choose = (id) => {
    setRobot(id);
    keepInAddress({ robot: id });
  };
  return (
    <>
      <div class="filters">
        <SelectField label="Robot" value={robot} onChange={choose} options={[['', 'all'], ...ids]} />
        <button type="button" onClick={events.reload}>
          Refresh
        </button>
      </div>
      <List
        of={events}
        what="the log"
        none="Nothing has happened yet"
        more="Adoptions, drifts and diagnoses are listed here."
        from={({ entries }) => entries}
      >
        {(list) => <Events events={list} />}
      </List>
      {events.value?.next && <Older onClick={() => setCount(count + 5 * step)} />}
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
            : 'what happened to robots and their models'}
        </span>
        <span class="spring" />
        <Choice label="Of" options={subjects} value={subject} onChange={choose} />
      </div>
      {subject === 'requests' ? <Requests /> : <RobotEvents given={given} />}
    </>
  );
}
