// Legs as the form keeps them, to the path that the service takes and to points for a first look.
const degree = Math.PI / 180;
const angle = { label: 'angle, left positive', unit: '°', start: 90 };

// The fields of a leg have the service's names, except for its angle in degrees.
export const legKinds = {
  straight: { name: 'Straight', fields: { length_m: { label: 'length', unit: 'm', min: 0.01, start: 5 } } },
  turn: { name: 'Turn in place', fields: { angle } },
  arc: { name: 'Arc', fields: { radius_m: { label: 'radius', unit: 'm', min: 0.01, start: 2 }, angle } },
  dwell: { name: 'Dwell', fields: { duration_s: { label: 'time', unit: 's', min: 0, start: 10 } } },
  payload: {
    name: 'Payload from here',
    fields: { payload_kg: { label: 'payload', unit: 'kg', min: 0, start: 10 } },
  },
};

export function newLeg(kind) {
  const fields = Object.entries(legKinds[kind].fields).map(([key, { start }]) => [key, start]);
  return { kind, ...Object.fromEntries(fields) };
}

export const segmentOf = ({ angle, ...leg }) =>
  angle === undefined ? leg : { ...leg, angle_rad: angle * degree };

export function pathOfPoints(points) {
  const [[x, y], second] = points;
  return {
    start_pose: { x_m: x, y_m: y, heading_rad: Math.atan2(second[1] - y, second[0] - x) },
    path: [{ kind: 'polyline', points: points.slice(1).map(([px, py]) => ({ x_m: px, y_m: py })) }],
  };
}

export function pointsOfLegs(legs) {
  let [x, y, heading] = [0, 0, 0];
  const points = [[x, y]];
  for (const leg of legs) {
    if (leg.kind === 'straight') {
      x += leg.length_m * Math.cos(heading);
      y += leg.length_m * Math.sin(heading);
      points.push([x, y]);
    } else if (leg.kind === 'turn') {
      heading += leg.angle * degree;
    } else if (leg.kind === 'arc') {
      const side = leg.angle < 0 ? -1 : 1;
      const steps = Math.max(2, Math.ceil(Math.abs(leg.angle) / 5));
      const cx = x - side * leg.radius_m * Math.sin(heading);
      const cy = y + side * leg.radius_m * Math.cos(heading);
      for (let k = 1; k <= steps; ++k) {
        const h = heading + (leg.angle * degree * k) / steps;
        points.push([cx + side * leg.radius_m * Math.sin(h), cy - side * leg.radius_m * Math.cos(h)]);
      }
      heading += leg.angle * degree;
      [x, y] = points[points.length - 1];
    }
  }
  return points;
}

// Legs and points as the address keeps them: "straight:6,turn:90,arc:2:90" and "-5:-2,2:2.5".
export const legsText = (legs) => legs.map((leg) => Object.values(leg).join(':')).join(',');

export function legsFrom(text) {
  const legs = (text ?? '').split(',').map((part) => {
    const [kind, ...values] = part.split(':');
    const fields = Object.keys(legKinds[kind]?.fields ?? {});
    return { kind, ...Object.fromEntries(fields.map((key, k) => [key, Number(values[k])])) };
  });
  return legs.every((leg) => leg.kind in legKinds && Object.values(leg).every((v) => !Number.isNaN(v)))
    ? legs
    : null;
}

export const pointsText = (points) => points.map((point) => point.join(':')).join(',');

export function pointsFrom(text) {
  const points = (text ?? '').split(',').map((part) => part.split(':').map(Number));
  return points.every((point) => point.length === 2 && point.every(Number.isFinite)) ? points : null;
}
