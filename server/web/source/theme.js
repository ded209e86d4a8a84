import { keptChoice } from './choice.js';

const systemDark = matchMedia('(prefers-color-scheme: dark)');
const choice = keptChoice('theme', ['light', 'dark'], () => (systemDark.matches ? 'dark' : 'light'));
let colours = null;

function show(theme) {
  document.documentElement.dataset.theme = theme;
  colours = null;
}

export const isDark = () => choice.get() === 'dark';
export const toggleTheme = () => choice.set(isDark() ? 'light' : 'dark');
export const useTheme = () => choice.use() === 'dark';

const names = ['ink', 'muted', 'line', 'graticule', 'screen', 'page'];
names.push('measured', 'modelled', 'gap', 'good', 'bad', 'accent');

// Colours of the style sheet, for drawing on a canvas.
export function palette() {
  if (colours === null) {
    const style = getComputedStyle(document.documentElement);
    colours = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  }
  return colours;
}

choice.listen(show); // before any component's, so that they find the new colours
systemDark.addEventListener('change', choice.tell);
show(choice.get());
