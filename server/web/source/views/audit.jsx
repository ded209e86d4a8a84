import { useChoices } from '../choices.js';
import { Button, Choice, Heading, useTitleOf } from '../widgets.jsx';
import { RobotField } from './choosing.jsx';
import { Events, useEvents } from './events.jsx';
import { Log, Requests } from './requests.jsx';

const step = 200;
const subjects = { '': 'Robots and models', requests: 'Requests' };

// Events of robots and their models, newest first.
function RobotEvents({ given: { robot }, change }) {
  const events = useEvents(robot, step, 5 * step);
  const fields = [
    <RobotField value={robot} onChange={(id) => change({ robot: id })} />,
    <Button onClick={events.reload}>Refresh</Button>,
  ];
  return (
    <Log
      of={events}
      fields={fields}
      what="the log"
      none="Nothing has happened yet"
      more="Adoptions, drifts and diagnoses are listed here."
      from={({ entries }) => entries}
    >
      {(list) => <Events events={list} />}
    </Log>
  );
}

export function Audit({ given: asked }) {
  useTitleOf('Log');
  const [given, change] = useChoices(asked);
  const subject = given.of === 'requests' ? 'requests' : '';
  return (
    <>
      <Heading
        title="Log"
        note={
          subject ? 'changes, sign-ins and rejected requests' : 'what happened to robots and their models'
        }
      >
        <span class="spring" />
        <Choice label="Of" options={subjects} value={subject} onChange={(of) => change({ of })} />
      </Heading>
      {subject ? <Requests /> : <RobotEvents given={given} change={change} />}
    </>
  );
}
