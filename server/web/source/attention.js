// The robots that need attention, from the service.
import { useEffect, useState } from 'preact/hooks';
import { get } from './api.js';

const renewMs = 10_000;

// Map from robot to {severity, reasons}; the service itself is under ''. Empty until it is read.
export function useAttention() {
  const [entries, setEntries] = useState(new Map());
  useEffect(() => {
    const abort = new AbortController();
    const read = () =>
      get('/v1/attention', abort.signal).then(
        ({ attention }) => setEntries(new Map(attention.map((entry) => [entry.robot_id ?? '', entry]))),
        () => {}, // the live view reports that the service is gone
      );
    const first = setTimeout(read, 300); // after the first view is drawn
    const timer = setInterval(read, renewMs);
    return () => {
      abort.abort();
      clearTimeout(first);
      clearInterval(timer);
    };
  }, []);
  return entries;
}
