// Legs as the form keeps them, to the path that the service takes and to points for a first look.
const degree = Math.PI / 180;

export const legKinds = {
  straight: { name: 'Straight', fields: { length: { label: 'length', unit: 'm', min: 0.01, start: 5 } } },
  turn: { name: 'Turn in place', fields: { angle: { label: 'angle, left positive', unit: '°', start: 90 } } },
  arc: {
    name: 'Arc',
    fields: {
      radius: { label: 'radius', unit: 'm', min: 0.01, start: 2 },
      angle: { label: 'angle, left positive', unit: '°', start: 90 },
    },
  },
  dwell: { name: 'Dwell', fields: { duration: { label: 'time', unit: 's', min: 0, start: 10 } } },
  payload: {
    name: 'Payload from here',
    fields: { mass: { label: 'payload', unit: 'kg', min: 0, start: 10 } },
  },
};

export function newLeg(kind) {
  return {
    kind,
    ...Object.fromEntries(Object.entries(legKinds[kind].fields).map(([key, field]) => [key, field.start])),
  };
}

const names = { length: 'length_m', radius: 'radius_m', duration: 'duration_s', mass: 'payload_kg' };

export const segmentOf = ({ kind, angle, ...fields }) => ({
  kind,
  ...(angle !== undefined && { angle_rad: angle * degree }),
  ...Object.fromEntries(Object.entries(fields).map(([key, value]) => [names[key], value])),
});

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
      x += leg.length * Math.cos(heading);
      y += leg.length * Math.sin(heading);
      points.push([x, y]);
    } else if (leg.kind === 'turn') {
      heading += leg.angle * degree;
    } else if (leg.kind === 'arc') {
      const side = leg.angle < 0 ? -1 : 1;
      const steps = Math.max(2, Math.ceil(Math.abs(leg.angle) / 5));
      const cx = x - side * leg.radius * Math.sin(heading);
      const cy = y + side * leg.radius * Math.cos(heading);
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

// Legs and points as the address keeps them: "straight:6,turn:90,arc:2:90" and "-5:-2,2:2.5".
export const legsText = (legs) =>
  legs
    .map((leg) => [leg.kind, ...Object.keys(legKinds[leg.kind].fields).map((key) => leg[key])].join(':'))
    .join(',');

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
