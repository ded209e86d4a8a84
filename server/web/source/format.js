// Numbers for display: few digits, a unit, and a dash for missing values.

const thin = '\u2009';
const dash = '–';
const minus = '−';
export const none = { n: dash, u: '' }; // a quantity that is not known

function group(text) {
  const [whole, part] = text.split('.');
  const grouped = whole.length > 4 ? whole.replace(/\B(?=(\d{3})+(?!\d))/g, thin) : whole;
  return part === undefined ? grouped : `${grouped}.${part}`;
}

export const known = (value) => typeof value === 'number' && Number.isFinite(value);

// `places` digits after the point.
export function fixed(value, places = 0) {
  if (!known(value)) return dash;
  const text = Math.abs(value).toFixed(places);
  return (value < 0 && Number(text) !== 0 ? minus : '') + group(text);
}

// Decimals that show `count` significant digits.
const placesOf = (value, count = 2) =>
  Math.max(0, Math.min(6, count - 1 - Math.floor(Math.log10(Math.abs(value)))));

// About `digits` significant digits, whole numbers never rounded away from the point.
export function digits(value, count = 3) {
  if (!known(value)) return dash;
  return value === 0 ? '0' : fixed(value, placesOf(value, count));
}

export function signed(text) {
  const zero = /^0(\.0+)?(?![\d.])/; // "0", "0.0 %", not "0.02"
  return text === dash || text.startsWith(minus) || zero.test(text) ? text : `+${text}`;
}

// Quantities are {n, u}: the number and the unit, prefixed so that the number stays short.

export const withSign = ({ n, u }) => ({ n: signed(n), u });

export function power(watt) {
  if (!known(watt)) return none;
  const size = Math.abs(watt);
  if (size >= 9995) return { n: digits(watt / 1e3), u: 'kW' };
  return { n: fixed(watt, size < 100 ? 1 : 0), u: 'W' };
}

export function length(metre) {
  if (!known(metre)) return none;
  const size = Math.abs(metre);
  if (size >= 9995) return { n: digits(metre / 1e3), u: 'km' };
  return { n: size < 1 ? fixed(metre, 2) : digits(metre), u: 'm' }; // odometry is not accurate to a millimetre
}

// For columns of distances of the size of kilometres; shorter ones in whole metres.
export function kilometres(metre) {
  if (known(metre) && Math.abs(metre) < 999.5) return { n: fixed(metre), u: 'm' };
  return known(metre) ? { n: fixed(metre / 1000, metre < 99_500 ? 1 : 0), u: 'km' } : none;
}

// A band of lengths in the unit of its far end: 2.4–35 km, 0–920 m.
export function lengthBand(low, high) {
  if (!known(low) || !known(high)) return '';
  const [per, u] = high >= 9995 ? [1000, 'km'] : [1, 'm'];
  const end = high >= 999_500 ? 'over 1000' : digits(high / per, 2);
  return `${digits(low / per, 2)}–${end}\u00a0${u}`;
}

// A band of durations, in hours if they are long: 8.7–26 h.
export const spanBand = (low, high) =>
  low < 3600 ? `${about(low)} – ${about(high)}` : `${digits(low / 3600, 2)}–${digits(high / 3600, 2)}\u00a0h`;

// Both ends of a range, with decimals according to its width.
export function range(low, high) {
  const wide = Math.abs(high - low);
  const places = wide > 0 ? placesOf(wide) : 3;
  return `${fixed(low, places)} to ${fixed(high, places)}`;
}

// "0.54 ± 0.04": two significant digits of the deviation, and the same decimals of the value.
export function withDeviation(value, deviation) {
  if (!known(deviation) || deviation <= 0) return digits(value);
  const places = placesOf(deviation);
  return `${fixed(value, places)} ± ${fixed(deviation, places)}`;
}

// A value with the decimals of one with this deviation.
export const likeDeviation = (value, deviation) =>
  known(deviation) && deviation > 0 ? fixed(value, placesOf(deviation)) : digits(value);

export const percent = (share, places = 0) =>
  known(share) ? { n: fixed(share * 100, places), u: '%' } : none;

export const unit = (value, u, places) =>
  known(value) ? { n: places === undefined ? digits(value) : fixed(value, places), u } : none;

export const text = (quantity) => (quantity.u === '' ? quantity.n : `${quantity.n}\u00a0${quantity.u}`);

export const share = (value, places = 0) => text(percent(value, places));

// The whole part in two digits.
export const two = (value) => String(Math.floor(value)).padStart(2, '0');

// A duration: 8.4 s, 3 min 20 s, 5 h 07 min, 12 d.
export function span(second) {
  if (!known(second)) return dash;
  const s = Math.abs(second);
  const sign = second < 0 ? minus : '';
  if (s < 60) return `${sign}${s < 9.95 ? s.toFixed(1) : s.toFixed(0)}\u00a0s`;
  if (s < 3600) return `${sign}${Math.floor(s / 60)}\u00a0min ${two(s % 60)}\u00a0s`;
  if (s < 172_800) return `${sign}${Math.floor(s / 3600)}\u00a0h ${two((s % 3600) / 60)}\u00a0min`;
  return `${sign}${Math.round(s / 86_400)}\u00a0d`;
}

// A forecast duration: to the minute, from a minute on.
export function about(second) {
  if (known(second) && second < 60) return `${fixed(second)}\u00a0s`;
  if (!known(second) || second >= 172_800) return span(second);
  const minutes = Math.round(second / 60);
  if (minutes < 60) return `${minutes}\u00a0min`;
  return `${Math.floor(minutes / 60)}\u00a0h ${two(minutes % 60)}\u00a0min`;
}

const local = new Intl.DateTimeFormat('sv', { dateStyle: 'short', timeStyle: 'medium' });
export const time = (utimeUs) => (known(utimeUs) ? local.format(utimeUs / 1000) : dash);
export const date = (utimeUs) => time(utimeUs).slice(0, 10);
export const minute = (utimeUs) => time(utimeUs).slice(0, 16);
export const clock = (utimeUs) => time(utimeUs).slice(-8);

// "1 robot", "3 robots".
export const count = (n, noun, several = `${noun}s`) => `${fixed(n)} ${n === 1 ? noun : several}`;

export const words = (name) => name.replace(/^com_/, 'centre_of_mass_').replaceAll('_', ' ');

// "name: value; …" of an object's members that are not null.
export const members = (object) =>
  Object.entries(object)
    .filter(([, value]) => value !== null)
    .map(([key, value]) => `${words(key)}: ${typeof value === 'object' ? JSON.stringify(value) : value}`)
    .join('; ');

export const degrees = (rad) => (rad * 180) / Math.PI;
