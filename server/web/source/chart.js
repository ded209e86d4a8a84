// uPlot in a component: follows its container's width and the theme.
import uPlot from 'uplot';
import { useEffect, useLayoutEffect, useRef } from 'preact/hooks';
import { html } from './html.js';
import { palette, useTheme } from './theme.js';
import { clock, fixed } from './format.js';

const narrow = '"Liberation Sans Narrow", "Arial Narrow", "Helvetica Neue", Arial, sans-serif';

export function axis(label, more = {}) {
  const p = palette();
  const line = { stroke: p.graticule, width: 1 };
  return {
    label: label || undefined, labelFont: `13px ${narrow}`, font: `13px ${narrow}`, stroke: p.muted, labelSize: label === '' ? 0 : 20, labelGap: 2, size: 50, gap: 4,
    grid: line, ticks: { ...line, size: 4 }, border: { show: true, stroke: p.line, width: 1 },
    values: (_, splits, index, space, step) => splits.map((v) => (v === null ? '' : fixed(v, Math.max(0, Math.ceil(-Math.log10(step) - 1e-9 + (String(step).match(/[1-9]/g)?.length ?? 1) - 1))))),
    ...more,
  };
}

const minute = 60, hours = 3600, day = 86_400;
export const clock_steps = [1, 2, 5, 10, 15, 30, ...[1, 2, 5, 10, 15, 30].map((m) => m * minute), ...[1, 2, 3, 6, 12].map((h) => h * hours), ...[1, 2, 7, 14, 28, 91, 182, 364, 728, 1820].map((d) => d * day)];

// Local times, with the day where it changes.
export const clock_axis = { incrs: clock_steps, splits: clock_splits, values: clock_values };

function clock_splits(_, index, low, high, step) {
  const offset = new Date(low * 1000).getTimezoneOffset() * minute, splits = [];
  for (let at = Math.ceil((low - offset) / step) * step + offset; at <= high; at += step) splits.push(at);
  return splits;
}

function clock_values(_, splits, index, space, step) {
  let day = '';
  return splits.map((second) => {
    const d = new Date(second * 1000), today = `${d.getMonth() + 1}-${String(d.getDate()).padStart(2, '0')}`, hour = clock(second * 1e6).slice(0, step < 60 ? 8 : 5);
    const text = today === day ? hour : `${hour}\n${d.getFullYear()}-${today.padStart(5, '0')}`;
    day = today;
    return text;
  });
}

// `make()` gives uPlot's options without width and height; called again when `changes` or the theme do.
export function Chart({ make, data, height = 220, label, changes = [], onReady }) {
  const place = useRef(null), plot = useRef(null), latest = useRef(data);
  const dark = useTheme();
  latest.current = data;
  useLayoutEffect(() => {
    const width = () => Math.max(200, Math.floor(place.current.clientWidth));
    const u = new uPlot({ legend: { show: false }, ...make(), width: width(), height }, latest.current, place.current);
    plot.current = u;
    onReady?.(u);
    const observer = new ResizeObserver(() => {
      if (width() !== u.width) u.setSize({ width: width(), height });
    });
    observer.observe(place.current);
    return () => {
      observer.disconnect();
      plot.current = null;
      u.destroy();
    };
  }, [dark, height, ...changes]);
  useEffect(() => {
    if (plot.current !== null && plot.current.data !== data) plot.current.setData(data);
  }, [data]);
  return html`<div class="chart" role="img" aria-label=${label} ref=${place}></div>`;
}

export function with_alpha(colour, share) {
  return `color-mix(in srgb, ${colour} ${share * 100}%, transparent)`;
}

export const cursor_of = (group) => ({
  sync: { key: group }, points: { size: 7, width: 1.5 }, drag: { x: true, y: false, dist: 6 }, focus: { prox: -1 },
});
