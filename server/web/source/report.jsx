// The report of a diagnosis as one file: the view of the page with the diagnosis inside.
import { render } from 'preact';
import './style.css';
import './views/views.css';
import * as format from './format.js';
import { Heading, TextPanel, useTitleOf } from './widgets.jsx';
import { Result } from './views/diagnosis.jsx';
import { effectName } from './views/jobs.jsx';

const { result, origin, robot } = JSON.parse(document.getElementById('data').textContent);
const titles = {
  mission_energies: `Why robot ${result.robot_id}'s energy differs from its model`,
  comparison: `What changes for robot ${result.robot_id} between groups of missions`,
};
const title = titles[result.kind] ?? `Why robot ${result.robot_id}'s power differs from its model`;

const Offer = ({ of: { refusal, effects } }) =>
  refusal === null ? (
    <p>These effects may be adopted in the robot file: {effects.map((e) => effectName(e.id)).join(', ')}.</p>
  ) : (
    <p class="failure">
      <b>Not to be adopted:</b> {refusal}.
    </p>
  );

const [right, left] = robot.motor.friction_torque_nm;
const originLines = [
  `Read from: ${origin.sources.join(', ')}.`,
  `Model: ${origin.model}: wheel radius ${format.digits(robot.kinematics.wheel_radius_m)} m, half track ${format.digits(robot.kinematics.half_track_m)} m, friction torque ${format.digits(right)} and ${format.digits(left)} N m (right, left), idle power ${format.digits(robot.idle_power_w)} W.`,
  `Report made${origin.made_at && ` ${origin.made_at} UTC`} by ${origin.software}.`,
];

function Report() {
  useTitleOf(title);
  return (
    <main>
      <Heading title={title} />
      <Result result={result}>{result.adoption?.effects.length > 0 && <Offer of={result.adoption} />}</Result>
      <TextPanel title="Origin of the data" of={originLines} />
    </main>
  );
}

render(<Report />, document.getElementById('app'));
