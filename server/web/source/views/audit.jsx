import { useState } from 'preact/hooks';
import { useChoices } from '../choices.js';
import { Choice, List, useTitleOf } from '../widgets.jsx';
import { RobotField } from './choosing.jsx';
import { Events, useEvents } from './events.jsx';
import { Older, Requests } from './requests.jsx';

const step = 200;
const subjects = [
  ['', 'Robots and models'],
  ['requests', 'Requests'],
];

// Events of robots and their models, newest first.
function RobotEvents({ given: { robot }, change }) {
  const [count, setCount] = useState(step);
  const events = useEvents({ robotId: robot, count });
  return (
    <>
      <div class="filters">
        <RobotField value={robot} onChange={(id) => change({ robot: id })} />
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

export function Audit({ given: asked }) {
  useTitleOf('Log');
  const [given, change] = useChoices(asked);
  const subject = given.of === 'requests' ? 'requests' : '';
  return (
    <>
      <div class="heading">
        <h1>Log</h1>
        <span class="note">
          {subject ? 'changes, sign-ins and rejected requests' : 'what happened to robots and their models'}
        </span>
        <span class="spring" />
        <Choice label="Of" options={subjects} value={subject} onChange={(of) => change({ of })} />
      </div>
      {subject ? <Requests /> : <RobotEvents given={given} change={change} />}
    </>
  );
}
