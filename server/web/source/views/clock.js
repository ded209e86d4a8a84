// Ticks of an axis of seconds since the start: 1:30, 1:02:05.
export const runClock = (_, splits) =>
  splits.map((s) => {
    if (s === null) return '';
    const sign = s < 0 ? '−' : '';
    const t = Math.abs(s);
    const two = (v) => String(Math.floor(v)).padStart(2, '0');
    const hours = t < 3600 ? '' : `${Math.floor(t / 3600)}:`;
    const minutes = t < 3600 ? Math.floor(t / 60) : two((t % 3600) / 60);
    return `${sign}${hours}${minutes}:${two(t % 60)}`;
  });
