// Price and emissions of energy, as the service's settings have them.
import { getOnce, useRead } from './api.js';
import { digits, fixed, known } from './format.js';

const none = { price_per_kwh: null, co2_g_per_kwh: null };
const joulePerKwh = 3.6e6;

export const worthNames = Object.entries({ cost: 'Cost', co2: 'Emissions' });

export const useTariff = () => useRead(() => getOnce('/v1/tariff'), 'tariff').value ?? none;

// Cost and emissions of an energy: {cost, co2}, quantities; null where the setting is not set.
export function worthOf({ price_per_kwh: price, currency, co2_g_per_kwh: co2 }, joule) {
  const kwh = joule / joulePerKwh;
  const cost = kwh * price;
  const gram = kwh * co2;
  const mass = gram >= 999.5 ? { n: digits(gram / 1000), u: 'kg CO₂' } : { n: digits(gram), u: 'g CO₂' };
  const has = (factor) => known(factor) && known(joule);
  return {
    cost: has(price) ? { n: cost < 1 ? digits(cost, 2) : fixed(cost, 2), u: currency } : null,
    co2: has(co2) ? mass : null,
  };
}

// The same as texts.
export const worthTexts = (tariff, joule) =>
  Object.values(worthOf(tariff, joule))
    .filter(Boolean)
    .map(({ n, u }) => `${n}\u00a0${u}`);
