// Legs as the form keeps them, to the path that the service takes and to points for a first look.
const degree = Math.PI / 180;

export const leg_kinds = {
  straight: { name: 'Straight', fields: { length: { label: 'length', unit: 'm', min: 0.01, start: 5 } } },
  turn: { name: 'Turn in place', fields: { angle: { label: 'angle, left positive', unit: '°', start: 90 } } },
  arc: { name: 'Arc', fields: { radius: { label: 'radius', unit: 'm', min: 0.01, start: 2 }, angle: { label: 'angle, left positive', unit: '°', start: 90 } } },
  dwell: { name: 'Dwell', fields: { duration: { label: 'time', unit: 's', min: 0, start: 10 } } },
  payload: { name: 'Payload from here', fields: { mass: { label: 'payload', unit: 'kg', min: 0, start: 10 } } },
};

export function new_leg(kind) {
  return { kind, ...Object.fromEntries(Object.entries(leg_kinds[kind].fields).map(([key, field]) => [key, field.start])) };
}

export function segment_of(leg) {
  switch (leg.kind) {
    case 'turn': return { kind: 'turn', angle_rad: leg.angle * degree };
    case 'arc': return { kind: 'arc', radius_m: leg.radius, angle_rad: leg.angle * degree };
    case 'dwell': return { kind: 'dwell', duration_s: leg.duration };
    case 'payload': return { kind: 'payload', payload_kg: leg.mass };
    default: return { kind: 'straight', length_m: leg.length };
  }
}

export function path_of_points(points) {
  const [[x_m, y_m], second] = points;
  return {
    start_pose: { x_m, y_m, heading_rad: Math.atan2(second[1] - y_m, second[0] - x_m) },
    path: [{ kind: 'polyline', points: points.slice(1).map(([x, y]) => ({ x_m: x, y_m: y })) }],
  };
}

export function points_of_legs(legs) {
  let [x, y, heading] = [0, 0, 0];
  const points = [[x, y]];
  for (const leg of legs) {
    if (leg.kind === 'straight') {
      x += leg.length * Math.cos(heading);
      y += leg.length * Math.sin(heading);
      points.push([x, y]);
    } else if (leg.kind === 'turn') {
      heading += leg.angle * degree;
    } else if (leg.kind === 'arc') {
      const side = leg.angle < 0 ? -1 : 1, steps = Math.max(2, Math.ceil(Math.abs(leg.angle) / 5));
      const cx = x - side * leg.radius * Math.sin(heading), cy = y + side * leg.radius * Math.cos(heading);
      for (let k = 1; k <= steps; ++k) {
        const h = heading + (leg.angle * degree * k) / steps;
        points.push([cx + side * leg.radius * Math.sin(h), cy - side * leg.radius * Math.cos(h)]);
      }
      heading += leg.angle * degree;
      [x, y] = points[points.length - 1];
    }
  }
  return points;
}
