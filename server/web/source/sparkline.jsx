const spanUs = 90e6;
const pauseUs = 5e6; // longer ones are left empty

// The last minute and a half of a robot's power: measured as a trace, modelled as a thin line behind.
export function Sparkline({ track, width = 128, height = 30 }) {
  const rows = track.last();
  const known = rows.flatMap(([, ...powers]) => powers).filter(Number.isFinite);
  const [low, high] = [Math.min(0, ...known), Math.max(1, ...known)];
  const end = rows.at(-1)?.[0];
  const x = (us) => (width - 2 - ((end - us) / spanUs) * width).toFixed(1);
  const y = (value) => (height - 2 - ((value - low) / (high - low)) * (height - 5)).toFixed(1);
  const lineOf = (column) => {
    let before = -Infinity;
    const step = ([us, ...powers]) => {
      const begins = us - before > pauseUs;
      before = us;
      return `${begins ? 'M' : 'L'}${x(us)} ${y(powers[column])}`;
    };
    return rows
      .filter(([, ...powers]) => Number.isFinite(powers[column]))
      .map(step)
      .join('');
  };
  const graticule = Array.from({ length: width / 32 }, (_, k) => `M${width - 0.5 - 32 * k} 0V${height}`);
  return (
    <svg class="sparkline" width={width} height={height} aria-hidden="true">
      <path d={`M0 ${Math.round(y(0)) + 0.5}H${width}${graticule.join('')}`} />
      <path class="modelled" d={lineOf(1)} />
      <path class="measured" d={lineOf(0)} />
    </svg>
  );
}
