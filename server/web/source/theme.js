import { keptChoice } from './choice.js';

const systemDark = matchMedia('(prefers-color-scheme: dark)');
const choice = keptChoice('theme', ['light', 'dark'], () => (systemDark.matches ? 'dark' : 'light'));
const { style } = document.documentElement;
let colours = null;

function show() {
  style.colorScheme = choice.get();
  colours = null;
}

export const isDark = () => choice.get() === 'dark';
export const toggleTheme = () => choice.set(isDark() ? 'light' : 'dark');
export const useTheme = () => choice.use() === 'dark';

const names = ['ink', 'muted', 'line', 'graticule', 'screen', 'page'];
names.push('measured', 'modelled', 'gap', 'good', 'bad', 'accent');

function colourOf(name) {
  style.color = `var(--${name})`;
  const { color } = getComputedStyle(document.documentElement);
  style.color = '';
  return color;
}

// Colours of the style sheet, for drawing on a canvas.
export const palette = () => (colours ??= Object.fromEntries(names.map((name) => [name, colourOf(name)])));

choice.listen(show); // before any component's, so that they find the new colours
systemDark.addEventListener('change', choice.tell);
show();
