// Colour scales for values on the floor. Both run monotonically in lightness (power) or outward from a
// neutral middle (gap), so they survive colour blindness and print.
import { isDark } from './theme.js';

const stops = {
  power: {
    light: ['#c8ccc4', '#e2b25c', '#d4682c', '#962630', '#480e34'],
    dark: ['#2c3a3e', '#684868', '#c45248', '#fa9838', '#ffeeaa'],
  },
  gap: {
    light: ['#14548c', '#78aac8', '#c4c4be', '#e28c64', '#ac2422'],
    dark: ['#46aaff', '#3c6a96', '#4e5454', '#b05c40', '#ff7854'],
  },
};

function table(of) {
  return Array.from({ length: 64 }, (_, k) => {
    const at = (k / 63) * (of.length - 1);
    const low = Math.min(Math.floor(at), of.length - 2);
    return `color-mix(in srgb, ${of[low + 1]} ${(100 * (at - low)).toFixed(1)}%, ${of[low]})`;
  });
}

// {low, high, colour_of(value), colours}: 'power' from 0 to the 98th percentile, 'gap' symmetric about 0.
export function scaleFor(kind, values) {
  const finite = values
    .filter(Number.isFinite)
    .map((v) => (kind === 'gap' ? Math.abs(v) : v))
    .sort((a, b) => a - b);
  const top = Math.max(finite.length > 0 ? finite[Math.floor(0.98 * (finite.length - 1))] : 1, 1e-3);
  const step = 10 ** Math.floor(Math.log10(top)) / 2;
  const high = Math.ceil(top / step) * step;
  const low = kind === 'gap' ? -high : 0;
  const colours = table(stops[kind][isDark() ? 'dark' : 'light']);
  return {
    low,
    high,
    colours,
    colourOf: (value) => colours[Math.max(0, Math.min(63, Math.round(((value - low) / (high - low)) * 63)))],
  };
}
