// Explanations of the page's terms: the text of glossary.md.
import glossary from '../glossary.md';
import { Heading, useTitleOf } from '../widgets.jsx';

const terms = [...glossary.matchAll(/^- \*\*(.+?)\*\*: (.+(?:\n {2}.+)*)$/gm)].map(([, term, text]) => [
  term,
  text.replaceAll(/\s+/g, ' '),
]);

const views = [
  ['#/fleet', 'Fleet', 'every robot now: power, charge, range, and how well its model fits'],
  ['#/missions', 'Missions', 'energy of each mission by term, and its minimum-energy drive'],
  ['#/trends', 'Trends', 'energy, consumption and ratio by day or week, and comparisons side by side'],
  ['#/map', 'Map', 'robots on the floor plan now, and missions replayed there'],
  [
    '#/floor',
    'Floor',
    'energy by place on the floor over weeks, and places where it departs from the models',
  ],
  ['#/plan', 'Plan', 'energy and time of a drive before it is driven, and whether the charge suffices'],
  ['#/gap', 'Gap', 'diagnoses: why measured energy departs from the model, and proposed corrections'],
  ['#/audit', 'Log', 'events of robots and their models'],
];

const recipes = [
  [
    'a robot is silent',
    'Check that it is on and in the network. If it sends, compare its channel name, clock and robot id with the Log, which names rejected messages.',
  ],
  [
    'its telemetry is contradicted',
    'Open the robot: the message names the channel and the probable unit or sign. Correct the sender. No model is estimated from these missions.',
  ],
  [
    'its charge is below the reserve',
    'Send it to a charger. Plan shows whether it can finish its tasks first.',
  ],
  [
    'it uses more energy than before',
    'Open Gap and start a diagnosis of its newest missions. The result names the cause and a drive or a check that confirms it.',
  ],
  [
    'a better model is proposed',
    'Open the robot and test the proposal on other missions. Adopt it if the error falls; an earlier version can be put in force again.',
  ],
  [
    'a battery, motor or wheel was replaced',
    'Edit the robot and enter the new values; the review names those that are implausible.',
  ],
];

const Terms = ({ of }) => (
  <dl class="glossary">
    {of.map(([term, text]) => (
      <div key={text}>
        <dt>{term}</dt>
        <dd>{text}</dd>
      </div>
    ))}
  </dl>
);

export function Help() {
  useTitleOf('Help');
  return (
    <>
      <Heading title="Help" />
      <Terms of={views.map(([to, name, text]) => [<a href={to}>{name}</a>, text])} />
      <h2>What to do when …</h2>
      <Terms of={recipes} />
      <h2>Keys</h2>
      <p>
        Tab reaches every control. In the charts of a mission the arrow keys move the cursor (with Shift in
        larger steps), + zooms in and − zooms out. In the drawing of a path the arrow keys move the cross,
        Enter adds a point and Backspace removes the last. On the map of Floor the arrow keys select a square.
      </p>
      <h2 id="glossary">Glossary</h2>
      <Terms of={terms} />
    </>
  );
}
