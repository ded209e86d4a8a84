// Explanations of the page's terms: the text of glossary.md.
import { useEffect, useState } from 'preact/hooks';
import { getText } from '../api.js';
import { useTitleOf } from '../widgets.jsx';

const entriesOf = (glossary) =>
  [...glossary.matchAll(/^- \*\*(.+?)\*\*: (.+(?:\n {2}.+)*)$/gm)].map(([, term, text]) => ({
    term,
    text: text.replaceAll(/\s+/g, ' ').replaceAll('`', ''),
  }));

const views = [
  ['#/fleet', 'Fleet', 'every robot now: power, charge, range, and how well its model fits'],
  ['#/missions', 'Missions', 'energy of each mission by term, and its minimum-energy drive'],
  ['#/trends', 'Trends', 'energy, consumption and ratio by day or week, and comparisons side by side'],
  [
    '#/floor',
    'Floor',
    'energy by place on the floor over weeks, and places where it departs from the models',
  ],
  ['#/plan', 'Plan', 'energy and time of a drive before it is driven, and whether the charge suffices'],
  ['#/gap', 'Gap', 'diagnoses: why measured energy departs from the model, and proposed corrections'],
  ['#/audit', 'Log', 'events of robots and their models'],
];

export function Help() {
  useTitleOf('Help');
  const [entries, setEntries] = useState([]);
  useEffect(() => {
    getText('glossary.txt', 'text/plain').then(
      ({ text }) => setEntries(entriesOf(text)),
      () => {},
    );
  }, []);
  return (
    <>
      <div class="heading">
        <h1>Help</h1>
      </div>
      <dl class="glossary short">
        {views.map(([to, name, text]) => (
          <div key={to}>
            <dt>
              <a href={to}>{name}</a>
            </dt>
            <dd>{text}</dd>
          </div>
        ))}
      </dl>
      <h2>Keys</h2>
      <p>
        Every control is reached with Tab. In the charts of a mission the arrow keys move the cursor (with
        Shift in larger steps), + zooms in and − zooms out. In the drawing of a path the arrow keys move the
        cross, Enter adds a point and Backspace removes the last. On the map of the floor the arrow keys go
        from square to square.
      </p>
      <h2 id="glossary">Glossary</h2>
      <dl class="glossary">
        {entries.map(({ term, text }) => (
          <div key={term}>
            <dt>{term}</dt>
            <dd>{text}</dd>
          </div>
        ))}
      </dl>
    </>
  );
}
