// Energies in the chosen unit, watt hours or joules. Values are in joules.
import { keptChoice } from './choice.js';
import { digits, fixed, known, none } from './format.js';

const units = { Wh: { Wh: 3600, kWh: 3.6e6 }, J: { J: 1, kJ: 1e3, MJ: 1e6 } };
const choice = keptChoice('energy_unit', ['Wh', 'J'], () => 'Wh');

export const { get: energyUnit, use: useEnergyUnit } = choice;
export const toggleEnergyUnit = () => choice.set(choice.get() === 'Wh' ? 'J' : 'Wh');

const decimals = (value, significant) =>
  Math.max(0, Math.min(4, significant - 1 - (value > 0 ? Math.floor(Math.log10(value)) : 0)));

// {u, joule, places}: one unit and number of decimals for all of `values`: the unit by the greatest, the
// decimals so that the middle one has `significant` digits.
export function energyScale(values, significant = 3) {
  const sizes = values.filter((v) => known(v) && v !== 0).map(Math.abs);
  sizes.sort((a, b) => a - b);
  const [middle = 0, largest = 0] = [sizes[sizes.length >> 1], sizes[sizes.length - 1]];
  const all = Object.entries(units[choice.get()]);
  const [u, joule] = all.findLast(([, size]) => largest >= 0.9995 * size) ?? all[0];
  return { u, joule, places: decimals(middle / joule, significant) };
}

export const energyIn = (scale, value) =>
  known(value) ? { n: fixed(value / scale.joule, scale.places), u: scale.u } : none;

// A single energy.
export function energy(value, significant = 3) {
  if (!known(value)) return none;
  const { u, joule } = energyScale([value]);
  const size = Math.abs(value / joule);
  return {
    n: size < 5e-5 ? '0' : size < 1e-3 ? fixed(value / joule, 4) : digits(value / joule, significant),
    u,
  };
}

export function consumption(joulePerMetre) {
  if (!known(joulePerMetre)) return none;
  return choice.get() === 'Wh'
    ? { n: fixed(joulePerMetre / 3.6, 1), u: 'Wh/km' }
    : { n: fixed(joulePerMetre, 1), u: 'J/m' };
}

// Joules a metre of totals or a mission, from Wh/km.
export const perMetre = ({ wh_per_km: value }) => (value === null ? null : 3.6 * value);

// A charge as a share of the full battery; null without a capacity.
export function chargeShare(chargeAh, model) {
  const capacityAh = model?.battery?.capacity_ah;
  return known(chargeAh) && known(capacityAh) && capacityAh > 0 ? chargeAh / capacityAh : null;
}
