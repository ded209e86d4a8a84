// The ratios of robots of one kind side by side.
import { useState } from 'preact/hooks';
import { Bars } from '../bars.jsx';
import * as format from '../format.js';
import { robotLink } from '../route.js';
import { Button, Empty } from '../widgets.jsx';

// This robot, the outlying robots and those with the largest departures, in the order of the service.
const mostSiblings = 12;
function chosenOf(siblings, id) {
  const off = (s) =>
    s.robot_id === id ? Infinity : (s.stands_out ? 1 : 0) + Math.min(0.9, Math.abs(s.ratio - 1));
  const kept = new Set([...siblings].sort((a, b) => off(b) - off(a)).slice(0, mostSiblings));
  return siblings.filter((s) => kept.has(s));
}

export function Siblings({ siblings, id }) {
  const [whole, setWhole] = useState(false);
  const here = siblings.some((s) => s.robot_id === id);
  if (siblings.length <= (here ? 1 : 0))
    return <Empty title="No other robot of this kind has missions yet" />;
  const off = Math.max(
    0.02,
    ...siblings
      .flatMap((s) => [Math.abs(s.ci[0] - 1), Math.abs(s.ci[1] - 1)])
      .filter((v) => Number.isFinite(v)),
  );
  const at = (v) => `${50 + 50 * Math.max(-1, Math.min(1, (v - 1) / off))}%`;
  const some = whole || siblings.length <= mostSiblings ? siblings : chosenOf(siblings, id);
  return (
    <>
      <Bars
        class="siblings"
        head={['Robot', 'Interval', 'Ratio']}
        rows={some.map((s) => ({
          key: s.robot_id,
          class: s.robot_id === id ? 'this' : '',
          name: [
            s.robot_id === id ? <b>{id}</b> : <a href={robotLink(s.robot_id)}>{s.robot_id}</a>,
            s.stands_out && [' ', <span class="flag">stands out</span>],
          ],
          bar: (
            <svg width="100%" height="16" aria-hidden="true">
              <line x1="50%" x2="50%" y1="0" y2="16" class="one" />
              <line x1={at(s.ci[0])} x2={at(s.ci[1])} y1="8" y2="8" class="whisker" />
              <circle cx={at(s.ratio)} cy="8" r="4" class={s.stands_out ? 'out' : ''} />
            </svg>
          ),
          of: format.fixed(s.ratio, 3),
        }))}
      />
      <p class="note foot">
        Median of measured over modelled energy of each robot's newest missions, with its 95 % interval; the
        line is 1.{!here && ` ${id} has too few missions with its model in force.`}
      </p>
      {siblings.length > mostSiblings && (
        <Button aria-expanded={String(whole)} onClick={() => setWhole(!whole)}>
          {whole ? 'Show fewer' : `Show all ${siblings.length}`}
        </Button>
      )}
    </>
  );
}
