// Energies as people read them: watt hours, or joules where the reader chose so. Values come in joules.
import { keptChoice } from './choice.js';
import { digits, fixed, known } from './format.js';

const units = {
  Wh: [
    ['Wh', 3600],
    ['kWh', 3.6e6],
  ],
  J: [
    ['J', 1],
    ['kJ', 1e3],
    ['MJ', 1e6],
  ],
};
const choice = keptChoice('energy_unit', ['Wh', 'J'], () => 'Wh');
const none = { n: '–', u: '' };

export const energyUnit = choice.get;
export const useEnergyUnit = choice.use;
export const toggleEnergyUnit = () => choice.set(choice.get() === 'Wh' ? 'J' : 'Wh');

// {u, joule, places}: one unit and number of decimals for all of `values`, by the greatest of them.
export function energyScale(values, significant = 4) {
  const largest = values.reduce((most, v) => (known(v) ? Math.max(most, Math.abs(v)) : most), 0);
  const sizes = units[choice.get()];
  const [u, joule] = sizes.findLast(([, size]) => largest >= 0.9995 * size) ?? sizes[0];
  const magnitude = largest > 0 ? Math.floor(Math.log10(largest / joule)) : 0;
  return { u, joule, places: Math.max(0, Math.min(4, significant - 1 - magnitude)) };
}

export function energyIn(scale, value) {
  return known(value) ? { n: fixed(value / scale.joule, scale.places), u: scale.u } : none;
}

// One energy by itself.
export function energy(value, significant = 3) {
  if (!known(value)) return none;
  const { u, joule } = energyScale([value]);
  const size = Math.abs(value / joule);
  return { n: size === 0 || size >= 1e-3 ? digits(value / joule, significant) : fixed(value / joule, 4), u };
}

// Consumption from joules a metre.
export function consumption(joulePerMetre) {
  if (!known(joulePerMetre)) return none;
  return choice.get() === 'Wh'
    ? { n: fixed(joulePerMetre / 3.6, 1), u: 'Wh/km' }
    : { n: fixed(joulePerMetre, 1), u: 'J/m' };
}

// The part of a full battery that a charge is, where the capacity is known.
export function chargeShare(chargeAh, model) {
  const capacityAh = model?.battery?.capacity_ah;
  return known(chargeAh) && known(capacityAh) && capacityAh > 0 ? chargeAh / capacityAh : null;
}
