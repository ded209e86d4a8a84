import { useState } from 'preact/hooks';
import { keepInAddress } from './route.js';

// What a view was asked for by its address, and a function that changes parts of it there too; an empty value
// takes its part away.
export function useChoices(asked) {
  const [given, setGiven] = useState(asked);
  const change = (part) => {
    const next = Object.fromEntries(Object.entries({ ...given, ...part }).filter(([, value]) => value));
    setGiven(next);
    keepInAddress(next);
  };
  return [given, change];
}
