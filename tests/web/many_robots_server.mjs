// Replaces the daemon with any number of live robots, to measure the cost of the page alone. Serves the page
// under the daemon's content security policy, the fleet, and a state of every robot each second.
import { createServer } from 'node:http';
import { readFile } from 'node:fs/promises';
import { gzipSync } from 'node:zlib';
import path from 'node:path';

const policy =
  "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; font-src 'self'; " +
  "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
const types = {
  '.html': 'text/html; charset=utf-8',
  '.js': 'text/javascript; charset=utf-8',
  '.css': 'text/css; charset=utf-8',
  '.svg': 'image/svg+xml',
};

function stateOf(k, nowMs) {
  const t = nowMs / 1000 + k;
  const power = 40 + 30 * Math.sin(t / 7) + (k % 11);
  const id = `amr-${String(k + 1).padStart(3, '0')}`;
  return {
    robot_id: id,
    has_model: true,
    model_version: 1 + (k % 3),
    live: true,
    silent_s: 0.02,
    utime_us: Math.round(nowMs * 1000),
    measured_power_w: power,
    modelled_power_w: power * 0.97 + 0.5,
    speed_m_s: 0.7 + 0.3 * Math.sin(t / 5),
    yaw_rate_rad_s: 0.1 * Math.cos(t / 3),
    pose: [5 * Math.cos(t / 20), 5 * Math.sin(t / 20), t / 20],
    payload_kg: k % 40,
    battery_voltage_v: 25.4,
    battery_current_a: power / 25.4,
    state_of_charge: 0.1 + (0.85 * ((k * 37) % 100)) / 100,
    state_of_charge_sd: 0.04,
    charge: {
      source: 'voltage_and_current',
      time_to_charged_s: k % 5 === 0 ? 3840 : null,
      time_to_charged_sd_s: k % 5 === 0 ? 120 : null,
    },
    charging:
      k % 5 === 0
        ? {
            phase: 'constant_current',
            since_utime_us: Math.round((nowMs - 60_000) * 1000),
            charged_ah: 0.4,
            charged_j: 36_000,
          }
        : null,
    range_m: 900 + 31 * k,
    range_quantiles_m: { p05: 0.8 * (900 + 31 * k), p50: 900 + 31 * k, p95: 1.3 * (900 + 31 * k) },
    run_time_s: 3000 + 97 * k,
    run_time_quantiles_s: { p05: 2000, p50: 3000 + 97 * k, p95: 60_000 },
    winding_temperature_c: [31.2, 30.8],
    mission:
      k % 5 === 0
        ? null
        : {
            id: k + 1,
            mission_id: `${id}-m${k % 90}`,
            start_utime_us: Math.round((nowMs - 60_000) * 1000),
            energy: {
              battery_j: 2000 + k + (t % 60),
              measured_j: 2000 + k,
              measured_s: 60,
              measured_motor_j: [700, 690],
              motor_measured_s: 60,
              modelled_j: 1980 + k,
              modelled_motor_j: [690, 680],
              unexplained_j: 20,
              drawn_j: 2100,
              returned_j: 100,
              charge_ah: 0.02,
              distance_m: 42,
              turned_rad: 3,
              duration_s: 60,
            },
          },
    samples: 3000,
    faults: k % 29 === 0 ? { late: 3 } : {},
    contradictions: [],
  };
}

// Returns {url, close()}. Sends a state of each of `robots` robots per second, spread over the second.
export async function serveManyRobots(pageDirectory, robots) {
  const streams = new Set();
  let event = 0;
  const server = createServer(async (request, response) => {
    const url = new URL(request.url, 'http://here');
    const send = (bytes, type, more = {}) => {
      response.writeHead(200, { 'content-type': type, 'content-encoding': 'gzip', ...more });
      response.end(gzipSync(bytes));
    };
    if (url.pathname === '/v1/robots') {
      const now = Date.now();
      send(
        JSON.stringify({ robots: Array.from({ length: robots }, (_, k) => stateOf(k, now)) }),
        'application/json',
      );
    } else if (url.pathname === '/v1/cluster') {
      send(JSON.stringify({ name: null, node: null, nodes: [], leases: [] }), 'application/json');
    } else if (url.pathname === '/v1/attention') {
      const counts = { fault: 0, warning: 0, notice: 0 };
      send(JSON.stringify({ attention: [], counts }), 'application/json');
    } else if (url.pathname === '/v1/mission-totals') {
      send(JSON.stringify({ missions: 0, wh_per_km: null, energy: { battery_j: null } }), 'application/json');
    } else if (url.pathname === '/v1/tariff') {
      send(JSON.stringify({ price_per_kwh: null, currency: 'EUR', co2_g_per_kwh: null }), 'application/json');
    } else if (url.pathname === '/v1/recent-values') {
      send(JSON.stringify({ window_s: 90, robots: [], next_cursor: null }), 'application/json');
    } else if (url.pathname === '/v1/events') {
      response.writeHead(200, { 'content-type': 'text/event-stream', 'cache-control': 'no-cache' });
      streams.add(response);
      request.on('close', () => streams.delete(response));
    } else {
      const name = url.pathname === '/' ? 'index.html' : path.basename(url.pathname);
      const type = types[path.extname(name)];
      const bytes = type && (await readFile(path.join(pageDirectory, name)).catch(() => null));
      if (!bytes) {
        response.writeHead(404).end();
        return;
      }
      send(bytes, type, { 'content-security-policy': policy });
    }
  });
  const parts = 20;
  let part = 0;
  const timer = setInterval(() => {
    const now = Date.now();
    let text = '';
    for (let k = part; k < robots; k += parts)
      text += `event: state\nid: here-${++event}\ndata: ${JSON.stringify(stateOf(k, now))}\n\n`;
    for (const stream of streams) stream.write(text);
    part = (part + 1) % parts;
  }, 1000 / parts);
  await new Promise((ready) => server.listen(0, '127.0.0.1', ready));
  return {
    url: `http://127.0.0.1:${server.address().port}`,
    told: () => event,
    close: () => {
      clearInterval(timer);
      for (const stream of streams) stream.end();
      server.closeAllConnections();
      return new Promise((done) => server.close(done));
    },
  };
}
