import { useState } from 'preact/hooks';
import { keepInAddress } from './route.js';

// The parameters of a view in its address, and a function that changes some of them; an empty value removes a
// parameter.
export function useChoices(asked) {
  const [given, setGiven] = useState(asked);
  const change = (part) => {
    const next = Object.fromEntries(Object.entries({ ...given, ...part }).filter(([, value]) => value));
    setGiven(next);
    keepInAddress(next);
  };
  return [given, change];
}
