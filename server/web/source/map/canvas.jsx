// The canvas of the map: plan, grid and scale, and what `draw(context, view)` adds.
import { FloorView, fit } from '../floor.jsx';
import { useNarrow } from '../widgets.jsx';
import { drawCharger } from './drawing.js';
import { cornersOf, drawPlan } from './plan.js';

// `points`: [x m, y m] that are to be seen, where there is no plan. `onPick(x m, y m, m in 12 px)`.
export function MapCanvas({ level, image, points, draw, changes, label, onPick }) {
  const narrow = useNarrow();
  const height = narrow ? 420 : Math.max(420, Math.min(820, innerHeight - 330));
  const viewFor = (width, tall) =>
    fit(image ? cornersOf(level, image) : points, width, tall, image ? 8 : 34, 4);
  const paint = (c, view) => {
    level?.chargers.forEach((charger) => drawCharger(c, view, charger));
    draw(c, view);
  };
  return (
    <FloorView
      viewFor={viewFor}
      draw={paint}
      under={image ? (c, view) => drawPlan(c, view, level, image) : undefined}
      height={height}
      label={label}
      changes={[image, level, height, ...changes]}
      onPlace={(x, y, view) => onPick?.(x, y, 12 / view.scale)}
    />
  );
}
