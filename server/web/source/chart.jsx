// uPlot in a component: loaded when first drawn, follows its container's width and the theme.
import { useEffect, useLayoutEffect, useRef } from 'preact/hooks';
import { once, useRead } from './api.js';
import { energyUnit } from './energy.js';
import { palette, useTheme } from './theme.js';
import { date, fixed, two } from './format.js';

const narrow = '"Liberation Sans Narrow", "Arial Narrow", "Helvetica Neue", Arial, sans-serif';

// Decimals that a step between ticks needs.
function decimals(step) {
  const figures = String(step).match(/[1-9]/g)?.length ?? 1;
  return Math.max(0, Math.ceil(-Math.log10(step) - 1e-9 + figures - 1));
}

export function axis(label, more = {}) {
  const p = palette();
  const line = { stroke: p.graticule, width: 1 };
  return {
    label: label || undefined,
    labelFont: `13px ${narrow}`,
    font: `13px ${narrow}`,
    stroke: p.muted,
    labelSize: label === '' ? 0 : 20,
    labelGap: 2,
    size: 50,
    gap: 4,
    grid: line,
    ticks: { ...line, size: 4 },
    border: { show: true, stroke: p.line, width: 1 },
    values: (_, splits, _index, _space, step) =>
      splits.map((v) => (v === null ? '' : fixed(v, decimals(step)))),
    ...more,
  };
}

const minute = 60;
const hours = 3600;
const day = 86_400;
const clockSteps = [
  [1, [1, 2, 5, 10, 15, 30]],
  [minute, [1, 2, 5, 10, 15, 30]],
  [hours, [1, 2, 3, 6, 12]],
  [day, [1, 2, 7, 14, 28, 91, 182, 364, 728, 1820]],
].flatMap(([unit, counts]) => counts.map((k) => k * unit));

// Seconds since the start: 1:30, 1:02:05.
const runClock = (_, splits) =>
  splits.map((s) => {
    if (s === null) return '';
    const sign = s < 0 ? '−' : '';
    const t = Math.abs(s);
    const hours = t < 3600 ? '' : `${Math.floor(t / 3600)}:`;
    const minutes = t < 3600 ? Math.floor(t / 60) : two((t % 3600) / 60);
    return `${sign}${hours}${minutes}:${two(t % 60)}`;
  });

export const runAxis = (label) => axis(label, { size: 28, incrs: clockSteps, values: runClock });

// Local times, with the day where it changes, of a scale of times.
const dayChange = '\n{YYYY}-{MM}-{DD}';
const clockFormat = (step, text) => [step, text, dayChange, null, dayChange, null, null, null, 1];
export const clockAxis = {
  size: 42,
  space: 90,
  values: [
    [day, '{YYYY}-{MM}-{DD}', null, null, null, null, null, null, 1],
    clockFormat(minute, '{HH}:{mm}'),
    clockFormat(1, '{HH}:{mm}:{ss}'),
  ],
};

const datePx = 84; // of one label

// The first and the last day and, as far as there is room, days evenly before the last.
function dateSplits(u, _, low, high, step) {
  const days = u.data[0];
  const [first, last] = [days[0], days[days.length - 1]];
  const room = (datePx / (u.bbox.width / devicePixelRatio)) * (high - low);
  const splits = [];
  const at = new Date(last * 1000);
  for (const day = Math.max(1, Math.round(step / 86_400)); at / 1000 - first >= room;) {
    splits.unshift(at / 1000);
    at.setDate(at.getDate() - day);
  }
  return [first, ...splits];
}

// Periods of so many days that begin at a local midnight.
export const dateAxis = (days) => ({
  incrs: clockSteps.filter((step) => step >= days * day),
  splits: dateSplits,
  values: (_, splits) => splits.map((second) => date(second * 1e6)),
  space: datePx,
});

// A scale of times over the data, and at each end `more(s between the first and the last)`; uPlot draws a
// single time at the beginning of many days.
export const timesWith = (more) => ({
  range: ({ data: [times] }, low, high) => {
    const [first, last] = times.length > 1 ? [low, high] : [times[0], times[0]];
    return [first - more(last - first), last + more(last - first)];
  },
});

// Sorted times with another one in every gap longer than `longest`, over which no line is drawn.
export const withGaps = (times, longest) =>
  times.flatMap((t, k) => (k > 0 && t - times[k - 1] > longest ? [(t + times[k - 1]) / 2, t] : [t]));

// The last of sorted times at or before `at`, as an index; 0 without one.
export const lastAt = (times, at) =>
  Math.max(
    0,
    times.findLastIndex((time) => time <= at),
  );

let uPlot = null;

export const loadCharts = () => once('charts', async () => (uPlot = (await import('uplot')).default));

// Paths of a series drawn as bars of a width along x, each from `start` beside its x; for use in `make`.
export const bars = (width, start) => {
  const x0 = { unit: 1, values: ({ data: [x] }) => x.map((at) => at + start) };
  return uPlot.paths.bars({ disp: { x0, size: { unit: 1, values: () => [width] } } });
};

// A series without marks of its points.
export const line = (stroke, width = 1.5, more) => ({ stroke, width, points: { show: false }, ...more });

// A series of marks without a line.
export const dots = (stroke, size, width) => {
  const points = { show: true, size, width, stroke, fill: stroke };
  return { stroke: 'transparent', paths: () => null, points };
};

// Without other options: seconds along x, and no zoom.
const usual = {
  legend: { show: false },
  scales: { x: { time: false } },
  cursor: { drag: { x: false, y: false } },
};

// `make(palette)` gives uPlot's options without width and height; called again when `changes`, the theme or
// the unit of energy do.
export function Chart({ make, data, height = 220, label, changes = [] }) {
  const place = useRef(null);
  const plot = useRef(null);
  const dark = useTheme();
  const loading = useRead(loadCharts, uPlot ? null : 'charts');
  const ready = uPlot !== null;
  useLayoutEffect(() => {
    if (!ready) return undefined;
    const width = () => Math.max(200, Math.floor(place.current.clientWidth));
    const options = { ...usual, ...make(palette()), width: width(), height };
    const u = new uPlot(options, data, place.current);
    plot.current = u;
    const observer = new ResizeObserver(() => {
      if (width() !== u.width) u.setSize({ width: width(), height });
    });
    observer.observe(place.current);
    return () => {
      observer.disconnect();
      plot.current = null;
      u.destroy();
    };
  }, [ready, dark, height, energyUnit(), ...changes]);
  useEffect(() => {
    if (plot.current !== null && plot.current.data !== data) plot.current.setData(data);
  }, [data]);
  return (
    <div class="chart" role="img" aria-label={label} ref={place} style={{ minHeight: `${height}px` }}>
      {loading.error && 'The chart could not be loaded.'}
    </div>
  );
}

export const withAlpha = (colour, share) => `color-mix(in srgb, ${colour} ${share * 100}%, transparent)`;
