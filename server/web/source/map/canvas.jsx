// The canvas of the map: plan, grid and scale, and what `draw(context, view)` adds.
import { useRef } from 'preact/hooks';
import { Canvas, drawGrid, drawScaleBar, fit } from '../floor.jsx';
import { useNarrow } from '../widgets.jsx';
import { drawCharger } from './drawing.js';
import { cornersOf, drawPlan } from './plan.js';

// `points`: [x m, y m] that are to be seen, where there is no plan. `onPick(x m, y m, m in 12 px)`.
export function MapCanvas({ level, image, points, draw, changes, label, onPick }) {
  const view = useRef(null);
  const narrow = useNarrow();
  const height = narrow ? 420 : Math.max(420, Math.min(820, innerHeight - 330));
  const paint = (c, width, tall) => {
    const v = (view.current = fit(image ? cornersOf(level, image) : points, width, tall, image ? 8 : 34, 4));
    if (image) drawPlan(c, v, level, image);
    else drawGrid(c, v);
    level?.chargers.forEach((charger) => drawCharger(c, v, charger));
    draw(c, v);
    drawScaleBar(c, v);
  };
  const pick = (event) => {
    const box = event.currentTarget.getBoundingClientRect();
    const at = view.current.from(event.clientX - box.left, event.clientY - box.top);
    onPick?.(...at, 12 / view.current.scale);
  };
  return (
    <div class="floor-box">
      <Canvas
        draw={paint}
        height={height}
        label={label}
        changes={[image, level, height, ...changes]}
        onClick={pick}
      />
    </div>
  );
}
