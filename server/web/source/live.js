// The live fleet: the list once, then the event stream. Events change the map immediately; components are
// notified at most once per animation frame and five times per second, for any number of robots.
import { get, onUnauthorized, query, useSource } from './api.js';

const powerSamples = 90;
const pathSamples = 600;
const leastMsBetweenDraws = 200;
const silenceBeforeCheckMs = 20_000;

class Track {
  constructor(length) {
    this.length = length;
    this.rows = [];
  }
  push(row) {
    this.rows.push(row);
    if (this.rows.length > 2 * this.length) this.rows.splice(0, this.rows.length - this.length);
  }
  // Adds rows from another source, ordered by their first column.
  join(rows) {
    const all = new Map([...rows, ...this.rows].map((row) => [row[0], row]));
    this.rows = [...all.values()].sort((a, b) => a[0] - b[0]);
  }
  last() {
    return this.rows.length > this.length ? this.rows.slice(-this.length) : this.rows;
  }
}

const robots = new Map();
const state = {
  link: 'connecting',
  sinceMs: Date.now(),
  loaded: false,
  loads: 0,
  error: null,
  robots,
  revision: 0,
};
const changes = new EventTarget();
let source = null;
let drawnMs = 0;
let scheduled = false;
let loading = false;
let heardMs = 0;
let retryMs = 1000;

function tell() {
  scheduled = false;
  drawnMs = performance.now();
  state.revision += 1;
  changes.dispatchEvent(new Event('change'));
}

function changed() {
  if (scheduled) return;
  scheduled = true;
  const wait = leastMsBetweenDraws - (performance.now() - drawnMs);
  if (wait > 0) setTimeout(() => requestAnimationFrame(tell), wait);
  else requestAnimationFrame(tell);
}

function take(next) {
  let entry = robots.get(next.robot_id);
  if (entry === undefined) {
    entry = { id: next.robot_id, revision: 0, power: new Track(powerSamples), path: new Track(pathSamples) };
    robots.set(next.robot_id, entry);
  }
  next.heardUs = next.silent_s === null ? null : (Date.now() - 1000 * next.silent_s) * 1000;
  const fresh = entry.state === undefined || entry.state.utime_us !== next.utime_us;
  entry.state = next;
  entry.revision += 1;
  if (fresh && next.utime_us !== null) {
    entry.power.push([next.utime_us, next.measured_power_w ?? NaN, next.modelled_power_w ?? NaN]);
    const [x, y] = next.pose;
    if (x !== null && y !== null)
      entry.path.push([next.utime_us, x, y, next.measured_power_w ?? next.modelled_power_w ?? NaN]);
  }
}

// The last values of each displayed robot are requested once from the service, which keeps them.
const wanted = new Set();
const mostWanted = 100; // in one request

async function fill() {
  const ids = [...wanted].slice(0, mostWanted);
  ids.forEach((id) => wanted.delete(id));
  if (wanted.size > 0) setTimeout(fill, 50);
  try {
    const answer = await get(`/v1/recent-values${query({ robot_id: ids.join(), digits: 7 })}`);
    for (const of of answer.robots) {
      const entry = robots.get(of.robot_id);
      if (!entry) continue;
      const rows = (...columns) => of.utime_us.map((us, k) => [us, ...columns.map((c) => c[k] ?? NaN)]);
      const drawn = of.measured_power_w.map((w, k) => w ?? of.modelled_power_w[k]);
      entry.power.join(rows(of.measured_power_w, of.modelled_power_w));
      entry.path.join(rows(of.x_m, of.y_m, drawn));
      entry.revision += 1;
    }
    changed();
  } catch {
    // The charts then fill with new telemetry.
  }
}

export function showRecent(entries) {
  for (const entry of entries) {
    if (entry.filled) continue;
    entry.filled = true;
    if (wanted.size === 0) setTimeout(fill, 50);
    wanted.add(entry.id);
  }
}

function link(name) {
  if (state.link === name) return;
  state.link = name;
  state.sinceMs = Date.now();
  changed();
}

export async function reloadFleet() {
  loading = true;
  try {
    const { robots: list } = await get('/v1/robots');
    const present = new Set(list.map((robot) => robot.robot_id));
    for (const id of robots.keys()) if (!present.has(id)) robots.delete(id);
    for (const robot of list) take(robot);
    for (const entry of robots.values()) entry.filled = false;
    state.loaded = true;
    state.loads += 1;
    state.error = null;
  } catch (error) {
    state.error = error;
  }
  loading = false;
  requestAnimationFrame(tell); // at once: the view was empty or out of date
}

function connect() {
  if (state.link === 'refused') return;
  source = new EventSource('/v1/events');
  for (const kind of ['open', 'state', 'mission'])
    source.addEventListener(kind, () => void (heardMs = performance.now()));
  source.addEventListener('open', () => {
    if (state.link === 'offline' || (!state.loaded && !loading)) reloadFleet();
    retryMs = 1000;
    link('live');
  });
  source.addEventListener('state', (event) => {
    take(JSON.parse(event.data));
    changed();
  });
  source.addEventListener('reset', reloadFleet);
  source.addEventListener('error', () => {
    if (state.link === 'refused') return;
    link('offline');
    if (source.readyState === EventSource.CLOSED) again(); // otherwise the browser reconnects
  });
}

function again() {
  source.close();
  get('/version').catch(() => {}); // distinguishes a rejected request from a lost connection
  setTimeout(connect, retryMs);
  retryMs = Math.min(2 * retryMs, 15_000);
}

// A dead stream cannot be distinguished from a silent fleet, so the connection is tested.
async function check() {
  if (state.link !== 'live' || performance.now() - heardMs < silenceBeforeCheckMs) return;
  heardMs = performance.now();
  try {
    await get('/healthz');
  } catch {
    link('offline');
    again();
  }
}

// Closes the stream; the sign-in loads the page again.
function refused() {
  source.close();
  link('refused');
}

export function startLive() {
  onUnauthorized(refused);
  reloadFleet();
  connect();
  setInterval(check, 5000);
}

export function useLive() {
  useSource(() => state.revision, changes);
  return state;
}

// The ids of the robots that have a model, in order.
export const useModelled = () =>
  [...useLive().robots.values()]
    .filter(({ state }) => state.has_model)
    .map(({ id }) => id)
    .sort();
