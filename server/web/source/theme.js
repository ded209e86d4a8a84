import { useEffect, useState } from 'preact/hooks';

const key = 'joulecast.theme';
const system_dark = matchMedia('(prefers-color-scheme: dark)');
const listeners = new Set();
let colours = null;

function stored() {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;  // storage may be forbidden; the system's choice then holds
  }
}

function show(choice) {
  const dark = choice ? choice === 'dark' : system_dark.matches;
  document.documentElement.dataset.theme = dark ? 'dark' : 'light';
  colours = null;
  for (const listener of listeners) listener(dark);
}

export function is_dark() {
  return document.documentElement.dataset.theme === 'dark';
}

export function toggle_theme() {
  const choice = is_dark() ? 'light' : 'dark';
  try {
    localStorage.setItem(key, choice);
  } catch {
    // shown for this visit only
  }
  show(choice);
}

// A component that uses it is drawn again when the theme changes.
export function useTheme() {
  const [dark, set_dark] = useState(is_dark());
  useEffect(() => {
    listeners.add(set_dark);
    return () => listeners.delete(set_dark);
  }, []);
  return dark;
}

// Colours of the style sheet, for what is drawn on a canvas.
export function palette() {
  if (colours === null) {
    const style = getComputedStyle(document.documentElement);
    const names = ['ink', 'muted', 'line', 'graticule', 'screen', 'page', 'measured', 'modelled', 'gap', 'good', 'bad', 'accent'];
    colours = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  }
  return colours;
}

system_dark.addEventListener('change', () => show(stored()));
show(stored());
