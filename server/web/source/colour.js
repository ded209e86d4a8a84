// Colour scales for values on the floor. Both run monotonically in lightness (power) or outward from a
// neutral middle (gap), so they survive colour blindness and print.
import { isDark } from './theme.js';

const powerStops = {
  light: [
    [200, 206, 196],
    [226, 178, 92],
    [212, 104, 44],
    [150, 38, 48],
    [72, 14, 52],
  ],
  dark: [
    [44, 58, 62],
    [104, 72, 104],
    [196, 82, 72],
    [250, 152, 56],
    [255, 238, 170],
  ],
};
const gapStops = {
  light: [
    [20, 84, 140],
    [120, 170, 200],
    [196, 196, 190],
    [226, 140, 100],
    [172, 36, 34],
  ],
  dark: [
    [70, 170, 255],
    [60, 106, 150],
    [78, 84, 84],
    [176, 92, 64],
    [255, 120, 84],
  ],
};

function table(stops) {
  const colours = [];
  for (let k = 0; k < 64; ++k) {
    const at = (k / 63) * (stops.length - 1);
    const low = Math.min(Math.floor(at), stops.length - 2);
    const part = at - low;
    const mix = stops[low].map((c, channel) => Math.round(c + (stops[low + 1][channel] - c) * part));
    colours.push(`rgb(${mix.join(' ')})`);
  }
  return colours;
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
  const colours = table((kind === 'gap' ? gapStops : powerStops)[isDark() ? 'dark' : 'light']);
  return {
    low,
    high,
    colours,
    colourOf: (value) => colours[Math.max(0, Math.min(63, Math.round(((value - low) / (high - low)) * 63)))],
  };
}
