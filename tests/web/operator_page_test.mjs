// The operator page in headless Chromium against a running daemon with live robots.
// node operator_page_test.mjs --daemon joulecastd --client joulecast --page server/web --out directory
//   [--chromium /usr/bin/chromium] [--only PATTERN] [--every-size]
// Writes screenshots, figures.json and checks.txt, the result of each check, to --out. Exits with 1 if a
// check fails.
import { appendFile, mkdir, readFile, rm, writeFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import path from 'node:path';
import { parseArgs } from 'node:util';
import { crc32, deflateSync, gzipSync } from 'node:zlib';
import { chromium } from 'playwright-core';
import { freePort, run, startUntil, stop } from './daemon.mjs';
import { serveManyRobots } from './many_robots_server.mjs';

const { values: given } = parseArgs({
  options: {
    daemon: { type: 'string' },
    client: { type: 'string' },
    page: { type: 'string' },
    out: { type: 'string' },
    chromium: { type: 'string', default: '/usr/bin/chromium' },
    only: { type: 'string', default: '' },
    'every-size': { type: 'boolean', default: false },
  },
});
for (const name of ['daemon', 'client', 'page', 'out']) {
  if (given[name] === undefined) throw new Error(`--${name} is missing`);
}
const axe = await readFile(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
const sizes = {
  phone: { width: 360, height: 740 },
  wide_phone: { width: 390, height: 844 },
  tablet: { width: 768, height: 1024 },
  landscape_tablet: { width: 1024, height: 768 },
  small_laptop: { width: 1280, height: 800 },
  laptop: { width: 1440, height: 900 },
  wall: { width: 2560, height: 1440 },
};
// The themes in which each view is opened at a size. By default each view is opened at the four most
// different sizes, two in each theme; with --every-size at all sizes.
const themes = given['every-size']
  ? Object.fromEntries(
      Object.keys(sizes).map((size) => [
        size,
        ['landscape_tablet', 'small_laptop'].includes(size) ? ['light'] : ['light', 'dark'],
      ]),
    )
  : { phone: ['dark'], tablet: ['light'], laptop: ['light'], wall: ['dark'] };
const firstLoadLimitBytes = 26_000;
const figures = {};
const checks = path.join(given.out, 'checks.txt');
const failures = [];
let passed = 0;

async function check(name, body) {
  if (!new RegExp(given.only).test(name)) return;
  const began = Date.now();
  try {
    await body();
    passed += 1;
    await appendFile(checks, `ok    ${name} (${Date.now() - began} ms)\n`);
  } catch (error) {
    const report = `FAIL  ${name}\n      ${String(error.stack).split('\n').slice(0, 6).join('\n      ')}`;
    failures.push(report);
    await appendFile(checks, `${report}\n`);
    console.log(report);
  }
}
function expect(holds, what) {
  if (!holds) throw new Error(what);
}
function equal(got, wanted, what) {
  expect(got === wanted, `${what}: got ${JSON.stringify(got)}, wanted ${JSON.stringify(wanted)}`);
}
async function until(what, ask, seconds = 20) {
  const end = Date.now() + seconds * 1000;
  for (;;) {
    const value = await ask();
    if (value) return value;
    if (Date.now() > end) throw new Error(`waited ${seconds} s for ${what}`);
    await new Promise((wait) => setTimeout(wait, 100));
  }
}
// Sorted times [ms] of fresh pages at `url` until `there` is true: at least five, and up to twenty while the
// minimum is over `limitMs`. Other load only adds time, so the minimum is the time of the page and the
// service.
async function openingsMs(url, there, limitMs = Infinity) {
  const times = [];
  while (times.length < 5 || (Math.min(...times) >= limitMs && times.length < 20)) {
    const fresh = await openPage();
    await fresh.goto(url, { waitUntil: 'commit' });
    times.push(
      await fresh.evaluate(
        (source) =>
          new Promise((shown, notShown) => {
            const holds = new Function(`return ${source}`)();
            const look = () => requestAnimationFrame(holds() ? () => shown(performance.now()) : look);
            look();
            setTimeout(() => notShown(new Error(`not shown within 30 s: ${source}`)), 30_000);
          }),
        String(there),
      ),
    );
    await close(fresh);
  }
  return times.sort((a, b) => a - b).map(Math.round);
}
const missionIsShown = () =>
  document.querySelectorAll('.uplot canvas').length >= 2 &&
  document.querySelector('.waterfall tr.battery') &&
  document.querySelector('canvas.floor');
const fleetIsShown = () => document.querySelector('.fleet tbody tr .sparkline');
const fleetOf500IsShown = () =>
  document.querySelector('.fleet tbody tr .sparkline') && document.body.textContent.includes('of 500');
const missionsAreShown = () => document.querySelectorAll('.missions tbody tr').length > 3;
const fiftyMissionsAreShown = () => document.querySelectorAll('.missions tbody tr').length === 50;
// Maximum ratio of the opening times of a large and a small page in the same run. A ratio does not depend
// on the machine, and a page that reads or draws everything takes tens of times as long.
const openingRatioLimit = 4;
async function opensLike(what, url, there, small) {
  const large = await openingsMs(url, there, openingRatioLimit * small[0]);
  const ratio = large[0] / small[0];
  figures[`${what}_ms`] = large;
  figures[`${what}_ratio`] = Number(ratio.toFixed(2));
  expect(ratio < openingRatioLimit, `${what}: ${large} ms, small page: ${small} ms`);
}
// A quantity of energy in joules: "1.372 Wh" is 4939.2.
const unitsJ = { kWh: 3.6e6, Wh: 3600, MJ: 1e6, kJ: 1000, J: 1 };
const joulesOf = (text) => number(text) * unitsJ[/(kWh|Wh|MJ|kJ|J)/.exec(text)[0]];
const number = (text) => Number(text.replace('−', '-').replace(/[^\d.\-+e]/g, ''));

await rm(given.out, { recursive: true, force: true });
await mkdir(path.join(given.out, 'screenshots'), { recursive: true });

const port = await freePort();
const base = `http://127.0.0.1:${port}`;
const lcmUrl = `udpm://239.255.76.67:${await freePort()}?ttl=0`;
const store = path.join(given.out, 'history.db');
const get = async (at) => (await fetch(base + at)).json();

// One hour at 50 Hz, metered into the history that the daemon then serves.
const hourRobot = path.join(given.out, 'hour-robot.json');
const daemonArgs = [
  '--store-path',
  store,
  '--http-port',
  String(port),
  '--http-web-directory',
  given.page,
  '--lcm-url',
  lcmUrl,
];
const ready = (child) =>
  child.exitCode === null &&
  fetch(`${base}/readyz`).then(
    (r) => r.ok,
    () => false,
  );
let daemon = await startUntil(given.daemon, daemonArgs, ready);
const fleet = await startUntil(
  given.client,
  [
    'simulate',
    '--robots',
    '4',
    '--seed',
    '3',
    '--server',
    base,
    '--mission-duration',
    '14',
    '--lcm-url',
    lcmUrl,
  ],
  async () => (await get('/v1/robots')).robots.filter((robot) => robot.live).length === 4,
);
await writeFile(
  hourRobot,
  JSON.stringify({ ...(await get('/v1/robots/amr-01')).model, robot_id: 'hour-01' }),
);
await stop(daemon);
// A virtual robot of that file, recorded as fast as possible: {log, file} for its replay into the history.
async function recorded(robotId, more) {
  const log = path.join(given.out, `${robotId}.lcmlog`);
  const file = path.join(given.out, `${robotId}.json`);
  const robot = JSON.parse(await readFile(hourRobot, 'utf8'));
  await writeFile(file, JSON.stringify({ ...robot, robot_id: robotId }));
  const one = ['--robot', file, '--robots', '1', '--log', log, '--speed', '0', '--quiet'];
  await run(given.client, ['simulate', ...one, ...more]);
  return { log, file };
}
// For the diagnosis: a robot with more friction than in its file, and one with a wheel out of round.
const effects = ['--seed', '12', '--missions', '8', '--effect'];
const hourLong = ['--seed', '11', '--missions', '1', '--mission-duration', '3600', '--duration', '4200'];
const recordings = await Promise.all([
  recorded('hour-01', hourLong),
  recorded('worn-01', [...effects, 'coulomb_friction=0.6', '--covariates', '1']),
  recorded('oval-01', [...effects, 'x_oval_wheel=4']),
]);
for (const { log, file } of recordings) {
  await run(given.client, ['replay', log, '--into', store, '--robot', file]);
  await rm(log);
}
daemon = await startUntil(given.daemon, daemonArgs, ready);

const browser = await chromium.launch({
  executablePath: given.chromium,
  args: [
    '--headless',
    '--no-sandbox',
    '--disable-gpu',
    '--disable-quic',
    '--no-first-run',
    '--disable-background-networking',
    '--disable-component-update',
    '--disable-sync',
  ],
});
const faults = [];
let faultsWanted = false;
async function openPage(options = {}) {
  const context = await browser.newContext({
    viewport: sizes.laptop,
    colorScheme: 'light',
    acceptDownloads: true,
    ...options,
  });
  const page = await context.newPage();
  page.setDefaultTimeout(30_000);
  page.on(
    'console',
    (message) =>
      ['error', 'warning'].includes(message.type()) &&
      !faultsWanted &&
      faults.push(`${message.text()} ${message.location().url} ${new Date().toISOString()}`),
  );
  page.on('pageerror', (error) => faults.push(error.stack));
  return page;
}
// Requests of the page that are on their way to a handler of the test are no longer wanted.
async function close(page) {
  await page.unrouteAll({ behavior: 'ignoreErrors' });
  await page.context().close();
}
// Presses a button with a confirmation dialog, and confirms.
async function adopt(page, label, action = label) {
  await page.getByRole('button', { name: label, exact: true }).first().click();
  await page.getByRole('dialog').getByRole('button', { name: action, exact: true }).click();
}
const go = (page, hash) => page.goto(`${base}/${hash}`);
// Waits until the view has read and drawn what it shows.
async function settled(shown) {
  await shown.locator('main h1, main .empty').first().waitFor({ state: 'attached' });
  await shown.waitForLoadState('load');
  await until('an end of loading', async () => (await shown.locator('.loading').count()) === 0);
  const requests = () => performance.getEntriesByType('resource').length;
  let before = -1;
  await until('an end of requests', async () => {
    const now = await shown.evaluate(requests);
    const quiet = now === before;
    before = now;
    return quiet;
  });
}
// Opens a diagnosis from another view and waits for that view, as two successive changes of the address are
// one.
async function openAnew(page, diagnosis) {
  await go(page, '#/gap');
  await page.getByRole('heading', { name: 'Gap between robot and model' }).waitFor();
  await go(page, `#/gap/${diagnosis}`);
}

const finished = await until(
  'four missions that ended',
  async () => {
    const { missions } = await get('/v1/missions?limit=200');
    const ended = missions.filter(
      (m) =>
        m.state === 'finished' &&
        !['worn-01', 'oval-01'].includes(m.robot_id) &&
        m.gap_s === 0 &&
        m.energy.duration_s < 600,
    );
    return ended.length >= 4 ? ended : null;
  },
  90,
);
const mission = finished[0];
const robot = mission.robot_id;
const hour = (await get('/v1/missions?limit=200')).missions.reduce((a, b) =>
  a.energy.duration_s > b.energy.duration_s ? a : b,
);
const page = await openPage();

await check('the fleet is live', async () => {
  await go(page, '#/fleet');
  await page.waitForSelector('.fleet tbody th a');
  equal(await page.locator('.fleet tbody tr:not(.spacer)').count(), 7, 'rows of robots');
  for (const id of ['hour-01', 'oval-01', 'worn-01']) {
    const last = await page.locator('.fleet tbody tr', { hasText: id }).locator('td.health').textContent();
    expect(last.startsWith('silent since'), `telemetry of ${id} before the restart: ${last}`);
  }
  const row = page.locator('.fleet tbody tr', { hasText: robot });
  const before = await row.locator('td.power .number').textContent();
  await until('another power', async () => (await row.locator('td.power .number').textContent()) !== before);
  await page.getByText('Live', { exact: true }).first().waitFor();
});

await check('charts of live values are filled on opening', async () => {
  const windowS = 90;
  const kept = () => get(`/v1/recent-values?robot_id=${robot}`);
  // Enough values that a page which waits for live ones would not have them yet.
  await until('half a minute of values', async () => (await kept()).robots[0].utime_us.length > 30, 60);
  // Share of the width over which the measured power is drawn, in its colour.
  const filled = (chart) => {
    const trace = chart.querySelector('.measured');
    const measured = getComputedStyle(document.querySelector('.mark path')).stroke;
    if (getComputedStyle(trace).stroke !== measured) return 0;
    let drawn = 0;
    let at = 0;
    for (const [, kind, x] of (trace.getAttribute('d') ?? '').matchAll(/([ML])(-?[\d.]+) -?[\d.]+/g)) {
      if (kind === 'L') drawn += Math.min(Number(x), chart.clientWidth) - Math.max(at, 0);
      at = Number(x);
    }
    return drawn / chart.clientWidth;
  };
  for (const [hash, trace] of [
    ['#/fleet', `.fleet tbody tr:has-text("${robot}") .sparkline`],
    [`#/robots/${robot}`, '.readouts .sparkline'],
  ]) {
    const fresh = await openPage();
    await go(fresh, hash);
    await fresh.locator(trace).first().waitFor();
    const began = Date.now();
    const available = Math.min(windowS, (await kept()).robots[0].utime_us.length) / windowS;
    const shown = () => fresh.locator(trace).first().evaluate(filled);
    await until(`a filled chart at ${hash}`, async () => (await shown()) > 0.6 * available, 5);
    expect(Date.now() - began < 5000, `${hash} was filled after ${Date.now() - began} ms`);
    await close(fresh);
  }
});

await check('robots without telemetry are collapsed, removed ones absent', async () => {
  const rows = page.locator('.fleet tbody tr:not(.spacer)');
  const spare = { ...JSON.parse(await readFile(hourRobot, 'utf8')), robot_id: 'spare-01' };
  const change = (method, suffix, body) =>
    fetch(`${base}/v1/robots/spare-01${suffix}`, {
      method,
      headers: { 'Content-Type': 'application/json' },
      body,
    });
  equal((await change('PUT', '', JSON.stringify(spare))).status, 200, 'the status of PUT');
  await page.reload();
  await page.getByRole('button', { name: 'Show 1 robot without telemetry' }).click();
  await until('rows of all robots', async () => (await rows.count()) === 8);
  await page.getByRole('button', { name: 'Hide 1 robot without telemetry' }).click();
  await until('rows of robots that were heard', async () => (await rows.count()) === 7);
  faultsWanted = true; // the page may be reading what is removed
  equal((await change('DELETE', '?history=purge')).status, 200, 'the status of DELETE');
  await page.reload();
  await page.waitForSelector('.fleet tbody th a');
  faultsWanted = false;
  equal(await rows.count(), 7, 'rows after the removal');
  equal(await page.getByText('without telemetry').count(), 0, 'folds after the removal');
});

await check('the fleet is searched, filtered and sorted', async () => {
  const names = () => page.locator('.fleet tbody th a').allTextContents();
  await page.getByPlaceholder('Find a robot or mission').fill(robot);
  await until('one row', async () => (await page.locator('.fleet tbody tr:not(.spacer)').count()) === 1);
  await page.getByPlaceholder('Find a robot or mission').fill('');
  await page.getByRole('button', { name: 'Silent' }).click();
  await until(
    'the robots that are silent',
    async () => JSON.stringify((await names()).sort()) === '["hour-01","oval-01","worn-01"]',
  );
  await page.getByRole('button', { name: /Charge below/ }).click();
  await page.getByText('No robot matches').waitFor();
  await page.getByRole('button', { name: 'All', exact: true }).click();
  await until('all rows', async () => (await names()).length === 7);
  await page.getByRole('button', { name: 'Robot', exact: true }).click();
  const rising = ['hour-01', 'oval-01', 'worn-01'];
  await until(
    'the order of names',
    async () => (await names()).filter((name) => rising.includes(name)).join() === rising.join(),
  );
  await page.getByRole('button', { name: 'Robot', exact: true }).click();
  await until(
    'the other order',
    async () =>
      (await names()).filter((name) => rising.includes(name)).join() === [...rising].reverse().join(),
  );
  equal(await page.locator('th.robot[aria-sort]').getAttribute('aria-sort'), 'descending', 'aria-sort');
});

await check('robots at rest, silent or restarted are marked', async () => {
  const fresh = await openPage();
  await fresh.route('**/v1/events', (route) =>
    route.fulfill({ contentType: 'text/event-stream', body: 'retry: 600000\n\n' }),
  );
  const heard = {
    live: true,
    silent_s: 0.1,
    has_model: true,
    speed_m_s: 0.7,
    measured_power_w: 61,
    mission: null,
    faults: {},
  };
  const reason = {
    kind: 'contradicted',
    severity: 'fault',
    message: 'battery_current is reversed.',
    action: 'Correct battery_current where the robot publishes it.',
  };
  await fresh.route('**/v1/attention', (route) =>
    route.fulfill({
      json: { attention: [{ robot_id: 'negated', severity: 'fault', reasons: [reason] }] },
    }),
  );
  const states = [
    { ...heard, robot_id: 'restarted', faults: { restart: 1, gap: 1, outside_mission: 40 } },
    {
      ...heard,
      robot_id: 'lossy',
      faults: { missing: 3, restart: 1, bad_event: 1 },
      fault_notes: { bad_event: 'mission b ends' },
    },
    {
      ...heard,
      robot_id: 'negated',
      contradictions: [
        { kind: 'sign', id: 'x', channel: 'battery_current', says: 'It is -1.', untrue: true },
      ],
    },
    { ...heard, robot_id: 'quiet', live: false, silent_s: 7200 },
    { ...heard, robot_id: 'standing', speed_m_s: 0, measured_power_w: 20 },
  ];
  await fresh.route('**/v1/robots', async (route) => {
    const { robots } = await (await route.fetch()).json();
    await route.fulfill({ json: { robots: states.map((own) => ({ ...robots[0], ...own })) } });
  });
  faultsWanted = true; // the stream ends immediately
  await go(fresh, '#/fleet');
  await fresh.locator('.fleet tbody th a').first().waitFor();
  const cells = async (robot) =>
    (await fresh.locator('.fleet tbody tr', { hasText: robot }).locator('td').allTextContents()).map((text) =>
      text.trim(),
    );
  equal((await cells('restarted'))[0], 'live', 'after a restart');
  const lossy = (await cells('lossy'))[0];
  expect(lossy.includes('3 missing, 1 bad event: mission b ends'), `lost samples: ${lossy}`);
  const negated = fresh.locator('.fleet tbody tr', { hasText: 'negated' });
  await negated.getByText('battery_current is reversed.', { exact: true }).waitFor(); // from the list
  await until(
    'what needs attention first',
    async () => (await fresh.locator('.fleet tbody th a').first().textContent()) === 'negated',
  );
  equal(await fresh.title(), '(1) Fleet · joulecast', 'the title');
  equal(
    await fresh.locator('.readout', { hasText: 'Need attention' }).locator('dd').textContent(),
    '11 fault',
    'how many',
  );
  const whole = await fresh.getByTitle(`${reason.message} ${reason.action}`).textContent();
  equal(whole, reason.message, 'the reason');
  const quiet = await cells('quiet');
  expect(/^silent since (\d\d:\d\d|\d{4}-\d\d-\d\d)$/.test(quiet[0]), `silence: ${quiet[0]}`);
  equal([quiet[1], quiet[6], quiet[8]].join(' '), '– – –', 'power, speed and mission of a silent robot');
  const standing = await cells('standing');
  expect(standing[6].startsWith('0.00') && standing[8] === 'idle', `a standing robot: ${standing}`);
  await fresh.getByRole('button', { name: 'Need attention', exact: true }).click();
  await until('that robot alone', async () => (await fresh.locator('.fleet tbody th a').count()) === 1);
  await close(fresh);
  faultsWanted = false;
});

await check('the keyboard opens a robot and returns', async () => {
  await go(page, '#/fleet');
  const link = page.locator('.fleet tbody th a').first();
  await link.waitFor();
  const name = await link.textContent();
  for (let k = 0; k < 40 && !(await link.evaluate((a) => a === document.activeElement)); ++k)
    await page.keyboard.press('Tab');
  expect(await link.evaluate((a) => a === document.activeElement), 'Tab does not reach the first robot');
  await page.keyboard.press('Enter');
  await page.getByRole('heading', { level: 1, name }).waitFor();
  equal(await page.evaluate(() => document.activeElement.id), 'main', 'focus after a change of view');
  await page.goBack();
  await page.locator('.fleet').waitFor();
});

await check('a robot shows history, versions and position', async () => {
  await go(page, `#/robots/${robot}`);
  await page.getByText('Version 1').waitFor();
  await page.locator('.screen .uplot').first().waitFor();
  expect((await page.locator('.missions tbody tr').count()) > 0, 'recent missions');
  await page.getByText('Parameters in force').click();
  await page.getByText('idle_power_w').waitFor();
});

await check('missions are filtered and summed by address', async () => {
  await go(page, '#/missions');
  await page.locator('.missions tbody tr').first().waitFor();
  await page.getByRole('combobox', { name: 'Robot', exact: true }).selectOption(robot);
  await until('only that robot', async () =>
    (await page.locator('.missions tbody td:nth-child(2)').allTextContents()).every((t) => t === robot),
  );
  await page.getByRole('combobox', { name: 'State', exact: true }).selectOption('finished');
  expect(
    page.url().includes(`robot=${robot}`) && page.url().includes('state=finished'),
    `address ${page.url()}`,
  );
  const totals = await get(`/v1/mission-totals?robot_id=${robot}&state=finished`);
  await until(
    'the totals',
    async () => number(await page.locator('.readouts dd .number').first().textContent()) >= totals.missions,
  );
  await page.getByLabel('Payload, kg, from').fill('100000');
  await page.keyboard.press('Enter');
  await page.getByText('No mission matches').waitFor();
  await page.getByRole('button', { name: 'Clear' }).click();
  await page.locator('.missions tbody tr').first().waitFor();
});

for (const kind of ['CSV', 'JSON']) {
  await check(`filtered missions are exported as ${kind}`, async () => {
    await go(page, `#/missions?robot=${robot}&state=finished`);
    await page.locator('.missions tbody tr').first().waitFor();
    const button = page.getByRole('button', { name: `Export ${kind}` });
    await until('the button', () => button.isEnabled());
    const [download] = await Promise.all([page.waitForEvent('download'), button.click()]);
    const text = await readFile(await download.path(), 'utf8');
    const { missions } = await get(`/v1/missions?robot_id=${robot}&state=finished&limit=1000`);
    let rows;
    if (kind === 'JSON') rows = JSON.parse(text).map((m) => [m.id, m.energy.battery_j]);
    else {
      const [head, ...lines] = text
        .trim()
        .split('\r\n')
        .map((line) => line.split(','));
      rows = lines.map((line) => [Number(line[head.indexOf('id')]), Number(line[head.indexOf('battery_j')])]);
    }
    expect(rows.length > 0 && rows.length <= missions.length, `${rows.length} rows of ${missions.length}`);
    const energies = new Map(missions.map((m) => [m.id, m.energy.battery_j]));
    for (const [id, joule] of rows) equal(joule, energies.get(id), `battery_j of mission ${id}`);
  });
}

await check('the fleet shows model errors and keeps filters in the address', async () => {
  await go(page, '#/fleet?show=silent&sort=ratio&down=1');
  await until(
    'the silent robots by their ratio',
    async () =>
      (await page.locator('.fleet tbody th a').allTextContents()).join() === 'worn-01,oval-01,hour-01',
  );
  const { siblings } = await get('/v1/robots/worn-01/gap-history?limit=1');
  const worn = siblings.find((one) => one.robot_id === 'worn-01');
  const cell = page.locator('.fleet tbody tr', { hasText: 'worn-01' }).locator('.ratio');
  equal(await cell.textContent(), worn.ratio.toFixed(3), 'the ratio');
  await page.getByRole('button', { name: 'All', exact: true }).click();
  expect(!page.url().includes('show='), page.url());
});

await check('the unit of energy is chosen and kept', async () => {
  await go(page, '#/missions?robot=worn-01');
  const cells = page.locator('.missions tbody tr').first().locator('td.figure');
  const shown = () => cells.nth(3).textContent();
  await page.locator('.missions tbody tr').first().waitFor();
  const { missions } = await get('/v1/missions?robot_id=worn-01&limit=50');
  const near = (text) => Math.abs(joulesOf(text) / missions[0].energy.battery_j - 1) < 0.005;
  expect(
    (await shown()).includes('Wh') && near(await shown()),
    `${await shown()} against ${missions[0].energy.battery_j} J`,
  );
  const units = new Set(
    await page.locator('.missions tbody tr td.figure:nth-child(8) .unit').allTextContents(),
  );
  equal(units.size, 1, 'units of the column');
  const share = async () => number(await cells.nth(4).textContent());
  const capacity = (await get('/v1/robots/worn-01')).model.battery.capacity_ah;
  await until(
    'the part of the charge',
    async () => Math.abs((await share()) - (100 * missions[0].energy.charge_ah) / capacity) < 0.006,
  );
  await page.getByRole('button', { name: /show energy in joules/ }).click();
  await until('joules', async () => (await shown()).includes('J') && near(await shown()));
  await page.reload();
  await page.locator('.missions tbody tr').first().waitFor();
  expect((await shown()).includes('kJ'), await shown());
  await page.getByRole('button', { name: /show energy in watt hours/ }).click();
});

await check('missions are sorted by column and found by name', async () => {
  await go(page, '#/missions?robot=worn-01');
  await page.getByRole('button', { name: 'Ratio', exact: true }).click();
  const ratios = async () => (await page.locator('.missions tbody .ratio').allTextContents()).map(number);
  await until('falling ratios', async () => {
    const shown = await ratios();
    return shown.length === 8 && shown.every((ratio, k) => k === 0 || ratio <= shown[k - 1]);
  });
  expect(page.url().includes('sort=ratio'), page.url());
  await page.getByRole('button', { name: 'Ratio', exact: true }).click();
  await until('rising ratios', async () =>
    (await ratios()).every((ratio, k, all) => k === 0 || ratio >= all[k - 1]),
  );
  await page.getByLabel('Name contains').fill('-M3');
  await until(
    'one mission',
    async () => (await page.locator('.missions tbody th').allTextContents()).join() === 'worn-01-s12-m3',
  );
  await page.getByText('1 of 1 loaded').waitFor();
});

await check('missions are filtered by ratio and sorted by keyboard', async () => {
  const { missions } = await get('/v1/missions?robot_id=worn-01&sort=ratio&order=desc&limit=50&digits=17');
  const least = missions[2].ratio;
  await go(page, `#/missions?robot=worn-01&ratio_min=${least}`);
  await until('three missions', async () => (await page.locator('.missions tbody tr').count()) === 3);
  await page.getByRole('button', { name: 'Energy', exact: true }).focus();
  await page.keyboard.press('Enter');
  await page.locator('.missions th[aria-sort=descending]', { hasText: 'Energy' }).waitFor();
  const some = missions.slice(0, 3).sort((one, other) => other.energy.battery_j - one.energy.battery_j);
  await until(
    'falling energies',
    async () =>
      (await page.locator('.missions tbody th').allTextContents()).join() ===
      some.map((m) => m.mission_id).join(),
  );
  await page.getByRole('combobox', { name: 'Robot', exact: true }).selectOption(robot);
  await page.getByRole('button', { name: 'Remove worn-01' }).click();
  await until('the other robot alone', () => page.url().includes(`robot=${robot}&`));
});

await check('sums by robot and day are those of missions', async () => {
  const both = 'robot_id=worn-01,oval-01&state=finished';
  const { missions } = await get(`/v1/missions?${both}&limit=1000`);
  const expected = new Map();
  for (const m of missions) {
    const day = new Date(m.start_utime_us / 1000).toISOString().slice(0, 10);
    const key = `${m.robot_id} ${day}T00:00:00Z`;
    const [count, joule] = expected.get(key) ?? [0, 0];
    expected.set(key, [count + 1, joule + m.energy.battery_j]);
  }
  const { groups } = await get(`/v1/mission-totals?${both}&group_by=robot,day`);
  equal(groups.length, expected.size, 'groups');
  for (const g of groups) {
    const [count, joule] = expected.get(`${g.robots} ${g.from}`) ?? [];
    equal(g.missions, count, `missions of ${g.robots} on ${g.from}`);
    expect(Math.abs(g.energy.battery_j / joule - 1) < 1e-6, `${g.energy.battery_j} J, not ${joule} J`);
  }
});

await check('trends sum missions by day and week', async () => {
  const { missions } = await get('/v1/missions?robot_id=worn-01&limit=50');
  const day = new Date(Math.min(...missions.map((m) => m.start_utime_us)) / 1000 - 86_400_000);
  const from = day.toISOString().slice(0, 10);
  const rows = page.locator('.trends tbody tr');
  for (const by of ['day', 'week']) {
    await go(page, `#/trends?robot=worn-01&from=${from}&by=${by}`);
    await rows.first().waitFor();
    const counts = (await page.locator('.trends tbody td:nth-child(2)').allTextContents()).map(number);
    equal(
      counts.reduce((a, b) => a + b),
      missions.length,
      `missions by ${by}`,
    );
    const energies = (await page.locator('.trends tbody td:nth-child(3)').allTextContents()).map(joulesOf);
    const sum = missions.reduce((total, m) => total + m.energy.battery_j, 0);
    expect(Math.abs(energies.reduce((a, b) => a + b) / sum - 1) < 0.01, `${energies} against ${sum} J`);
    equal(await page.locator('.charts .uplot').count(), 3, 'charts');
  }
  await page.getByRole('combobox', { name: 'Robot', exact: true }).selectOption('oval-01');
  await page.locator('.trend-key', { hasText: 'oval-01' }).waitFor();
  const button = page.getByRole('button', { name: 'Export CSV' });
  const [download] = await Promise.all([page.waitForEvent('download'), button.click()]);
  const [head, ...lines] = (await readFile(await download.path(), 'utf8')).trim().split('\r\n');
  expect(head.startsWith('robots,from,to,missions,') && lines.length > 0, head);
});

// A time in the format of browser fields: "2026-11-21T06:10".
function localMinute(utimeUs) {
  const at = new Date(utimeUs / 1000);
  const two = (value) => String(value).padStart(2, '0');
  const day = `${at.getFullYear()}-${two(at.getMonth() + 1)}-${two(at.getDate())}`;
  return `${day}T${two(at.getHours())}:${two(at.getMinutes())}`;
}
await check('To is inclusive and From is not later', async () => {
  const { missions } = await get('/v1/missions?robot_id=worn-01&limit=50');
  const minute = localMinute(missions[0].start_utime_us);
  const day = minute.slice(0, 10);
  const ofDay = missions.filter((m) => localMinute(m.start_utime_us).startsWith(day)).length;
  await go(page, `#/trends?robot=worn-01&from=${day}&to=${day}`);
  await page.locator('.trends tbody tr').first().waitFor();
  equal(number(await page.locator('.trends tbody td').first().textContent()), ofDay, 'missions of the day');
  await go(page, `#/trends?robot=worn-01,oval-01&from=${day}&to=${day}`);
  const compared = page.locator('.compare tbody tr').first().locator('td').first();
  equal(number(await compared.textContent()), ofDay, 'missions compared');
  const mapped = page.waitForResponse((r) => r.url().includes('/v1/floor-map') && r.ok());
  await go(page, `#/floor?robot=worn-01&from=${day}&to=${day}`);
  equal((await (await mapped).json()).missions, ofDay, 'missions on the floor');
  await go(page, `#/missions?robot=worn-01&from=${minute}&to=${minute}`);
  await page.getByRole('link', { name: missions[0].mission_id, exact: true }).waitFor();
  await go(page, `#/trends?robot=worn-01&to=${day}`);
  await page.locator('.trends tbody tr').first().waitFor();
  const requests = [];
  const note = (request) => requests.push(request.url());
  page.on('request', note);
  for (const [view, unit, which = ''] of [
    ['trends', ''],
    ['trends', '', '2'],
    ['floor', ''],
    ['missions', 'T10:00'],
  ]) {
    requests.length = 0;
    await go(page, `#/${view}?from${which}=2026-01-02${unit}&to${which}=2026-01-01${unit}`);
    await page.getByText('From must not be later than To.').waitFor();
    const reversed = requests.filter((url) => {
      const { searchParams: of } = new URL(url);
      return Number(of.get('from_utime_us')) > Number(of.get('to_utime_us'));
    });
    equal(reversed.join(), '', `requests of ${view}`);
  }
  page.off('request', note);
});

await check('the floor shows energy and gap by square', async () => {
  const response = page.waitForResponse((r) => r.url().includes('/v1/floor-map') && r.ok());
  await go(page, '#/floor?from=2020-01-01&cell=2&robot=worn-01&show=energy');
  const map = await (await response).json();
  const { missions } = await get('/v1/missions?robot_id=worn-01&limit=50');
  equal(map.missions, missions.length, 'missions');
  equal(map.missions_read, missions.length, 'missions read');
  const sum = missions.reduce((total, m) => total + m.energy.battery_j, 0);
  expect(Math.abs(map.energy_j / sum - 1) < 0.02, `${map.energy_j} J on the map, ${sum} J of missions`);
  const distance = missions.reduce((total, m) => total + m.energy.distance_m, 0);
  expect(Math.abs(map.distance_m / distance - 1) < 0.03, `${map.distance_m} m, ${distance} m of missions`);
  const figures = await page.locator('.readouts').first().textContent();
  expect(figures.includes((map.energy_j / map.distance_m / 3.6).toFixed(1)), figures);
  expect(figures.includes(`${map.ratio.toFixed(3)}while driving`), `ratio without rest: ${figures}`);
  const canvas = page.getByRole('application', { name: /^Map of the floor: consumption/ });
  await canvas.focus();
  await page.keyboard.press('ArrowRight');
  const strip = page.locator('.floor-strip');
  await strip.waitFor();
  const [first, one] = [await strip.textContent(), map.cells[0]];
  expect(
    first.includes(`${one.missions}`) && first.includes(one.ratio.toFixed(3)),
    `${first} of ${JSON.stringify(one)}`,
  );
  await page.keyboard.press('ArrowLeft');
  await until('another square', async () => (await strip.textContent()) !== first);
  await page.getByRole('button', { name: 'Gap', exact: true }).click();
  await page.getByRole('application', { name: /^Map of the floor: departure/ }).waitFor();
  await page.locator('.legend').getByText('departure from the models').waitFor();
  expect(page.url().includes('show=gap'), page.url());
  await page.getByText(/squares with the greatest excess energy/).waitFor();
  const excess = (c) => (c.departure === null ? -Infinity : c.measured_j * (1 - 1 / (1 + c.departure)));
  const most = map.cells.reduce((best, c) => (excess(c) > excess(best) ? c : best));
  const cells = await page.locator('.squares tbody tr').first().locator('td').allTextContents();
  expect(Math.abs(joulesOf(cells[0]) / excess(most) - 1) < 0.05, `${cells} against ${excess(most)} J`);
  expect(Math.abs(joulesOf(cells[2]) / most.energy_j - 1) < 0.05, `${cells} against ${most.energy_j} J`);
  await go(page, '#/floor?from=2020-01-01&cell=2&robot=worn-01');
  await page.getByRole('application', { name: /^Map of the floor: departure/ }).waitFor();
  const button = page.getByRole('button', { name: 'Export CSV' });
  const [download] = await Promise.all([page.waitForEvent('download'), button.click()]);
  const lines = (await readFile(await download.path(), 'utf8')).trim().split('\r\n');
  equal(lines.length - 1, map.cells_total, 'squares of the CSV');
});

await check('exceptional floor zones are numbered, listed and found', async () => {
  const path = '**/v1/floor-map?*';
  await page.route(path, async (route) => {
    const map = await (await route.fetch()).json();
    const [one] = map.cells;
    Object.assign(one, { departure: 0.31, departure_ci: [0.22, 0.4], stands_out: true });
    map.zones = [
      {
        x_min_m: one.x_m,
        y_min_m: one.y_m,
        x_max_m: one.x_m + map.cell_m,
        y_max_m: one.y_m + map.cell_m,
        cells: 1,
        covered_s: one.covered_s,
        distance_m: one.distance_m,
        departure: 0.31,
        excess_j: 1800,
      },
    ];
    await route.fulfill({ json: map });
  });
  await go(page, '#/floor?from=2020-01-01&cell=2&show=gap');
  const row = page.locator('.zones tbody tr');
  await row.getByText('+31').waitFor();
  expect((await row.textContent()).includes('+0.50'), await row.textContent());
  await row.getByRole('button', { name: 'Zone 1' }).click();
  const strip = page.locator('.floor-strip');
  await strip.getByText('+31 % (+22 % to +40 %)'.replaceAll(' %', '\u00a0%')).waitFor();
  await page.unroute(path);
});

// tests/openapi checks the form of the answer with a running cluster.
const clusterExample = JSON.parse(
  await readFile(path.join(given.page, '../../schemas/examples/getCluster.answer.json'), 'utf8'),
);
const inCluster = (more = {}) => {
  const [first, second] = clusterExample.leases;
  return {
    ...clusterExample,
    leases: [
      { ...first, robot_id: robot, stored_utime_us: (Date.now() - 60_000) * 1000 },
      { ...second, node: null },
    ],
    nodes: [clusterExample.nodes[0], { ...clusterExample.nodes[1], alive: false, lease_left_s: -3 }],
    ...more,
  };
};
await check('only a daemon in a cluster shows it', async () => {
  await go(page, '#/fleet');
  await page.locator('.fleet tbody th a').first().waitFor();
  await page.waitForTimeout(300);
  equal(await page.getByRole('link', { name: 'Cluster' }).count(), 0, 'links to a cluster of a daemon alone');
  await go(page, '#/cluster');
  await page.getByText('This daemon is in no cluster').waitFor();
  const fresh = await openPage();
  let answer = inCluster();
  await fresh.route('**/v1/cluster', (route) => route.fulfill({ json: answer }));
  await go(fresh, '#/fleet');
  await fresh.getByRole('link', { name: 'Cluster' }).click();
  await fresh.getByRole('heading', { level: 1, name: 'Cluster site' }).waitFor();
  const gone = await fresh.locator('.cluster tbody tr', { hasText: 'berta' }).textContent();
  expect(gone.includes('gone') && gone.includes('lapsed'), gone);
  expect(
    (await fresh.locator('.cluster tbody tr', { hasText: 'anna' }).textContent()).includes('this daemon'),
    'which daemon answers',
  );
  equal(
    (await fresh.locator('.readouts').first().locator('dd').allTextContents()).slice(0, 3).join('; '),
    '1of 2; 1of 2; 1',
    'daemons alive, robots kept, takeovers',
  );
  await fresh.locator('.leases tbody tr', { hasText: 'tug' }).getByText('none').waitFor();
  const state = async () => (await get(`/v1/robots/${robot}/state`)).mission !== null;
  await until('a running mission', state, 60);
  const lag = () => fresh.locator('.leases tbody tr', { hasText: robot }).locator('td').nth(2).textContent();
  await until('a lag of a minute', async () => /min|5\d/.test(await lag()), 30);
  answer = inCluster({ error: 'connection refused' });
  await fresh.getByText('anna does not reach the database').waitFor();
  await close(fresh);
});

await check('trends offer the robots with missions', async () => {
  const { groups } = await get('/v1/mission-totals?group_by=robot');
  const driven = groups.map((group) => group.robots[0]);
  await go(page, '#/trends');
  const offered = page.getByRole('combobox', { name: 'Robot', exact: true }).locator('option');
  await until('robots', async () => (await offered.count()) > driven.length);
  const [none, ...ids] = await offered.allTextContents();
  equal(none, 'the fleet', 'the default');
  expect(
    driven.every((id) => ids.includes(id)),
    `offered ${ids}, driven ${driven}`,
  );
  const counts = new Map(groups.map((group) => [group.robots[0], group.missions]));
  const most = Math.max(...counts.values());
  expect(counts.get(ids[0]) >= most - 1, `${ids[0]} with ${counts.get(ids[0])} of ${most} missions`);
});

await check('robots, periods and missions are compared', async () => {
  const figures = async (row) => {
    const cells = page
      .locator('.compare tbody tr', {
        has: page.getByText(row, { exact: true }),
      })
      .locator('td');
    await cells.first().waitFor();
    return cells.allTextContents();
  };
  await go(page, '#/trends?robot=worn-01,oval-01&from=2020-01-01');
  await page.getByRole('columnheader', { name: 'oval-01' }).last().waitFor();
  const sides = [];
  for (const [k, id] of ['worn-01', 'oval-01'].entries()) {
    const totals = await get(`/v1/mission-totals?robot_id=${id}`);
    sides.push(totals);
    equal(number((await figures('Missions'))[k]), totals.missions, `missions of ${id}`);
    expect(
      Math.abs(joulesOf((await figures('Energy'))[k]) / totals.energy.battery_j - 1) < 0.01,
      `${await figures('Energy')}`,
    );
  }
  equal((await figures('Missions'))[2], '', 'no change of a count');
  const [one, other] = sides.map((t) => t.ledger.terms_j.friction_internal / t.energy.distance_m / 3.6);
  const friction = await figures('of which friction in motors and gears');
  expect(Math.abs(number(friction[2]) - (other - one)) < 0.11, `${friction} of ${one} and ${other} Wh/km`);
  const { missions } = await get('/v1/missions?robot_id=worn-01&sort=ratio&limit=50');
  const [first, last] = [missions[0], missions.at(-1)];
  await go(page, `#/trends?of=missions&missions=${first.id},${last.id}`);
  const ratios = await figures('Ratio');
  equal(`${ratios[0]} ${ratios[1]}`, `${first.ratio.toFixed(3)} ${last.ratio.toFixed(3)}`, 'ratios');
  await page.getByRole('button', { name: 'Periods and robots' }).click();
  await page.getByRole('columnheader', { name: 'Compared period' }).waitFor();
  const at = missions.map((m) => m.start_utime_us);
  const day = localMinute(Math.min(...at)).slice(0, 10);
  const sums = missions.filter((m) => localMinute(m.start_utime_us).startsWith(day)).length;
  await go(page, `#/trends?robot=worn-01&from=2020-01-01&to=2020-01-02&from2=${day}&to2=${day}`);
  await until('the compared period', async () => number((await figures('Missions'))[1]) === sums);
  equal(number((await figures('Missions'))[0]), 0, 'missions of the first period');
});

await check('a proposed model shows its changes and needs confirmation', async () => {
  await go(page, '#/robots/worn-01');
  const panel = page.locator('.panel', {
    has: page.getByRole('heading', { name: 'A better model is proposed' }),
  });
  await panel.getByText('friction_torque_right_nm').first().waitFor();
  const { proposals } = await get('/v1/robots/worn-01/proposals');
  const first = proposals[0].detail.parameters.find((one) => one.name === 'friction_torque_right_nm');
  expect(
    (await panel.textContent()).includes(`${first.in_force.toPrecision(3)} N m → ${first.value.toFixed(3)}`),
    await panel.textContent(),
  );
  let requests = 0;
  await page.route('**/v1/robots/worn-01/models', (route) => {
    requests += 1;
    return route.fulfill({
      status: 409,
      json: { status: 409, title: 'Conflict', detail: 'rejected by the test' },
    });
  });
  await panel.getByRole('button', { name: 'Adopt', exact: true }).click();
  await page.getByRole('dialog').getByText('in place of version 1').waitFor();
  await page.getByRole('dialog').getByRole('button', { name: 'Cancel' }).click();
  equal(requests, 0, 'requests after Cancel');
  faultsWanted = true;
  const request = page.waitForRequest('**/v1/robots/worn-01/models');
  await panel.getByRole('button', { name: 'Adopt', exact: true }).click();
  await page.getByRole('dialog').locator('button:focus').waitFor();
  await page.keyboard.press('Enter'); // the dialog's first button has the focus
  const body = (await request).postDataJSON();
  equal(`${body.proposal_id} ${body.expected_version}`, `${proposals[0].id} 1`, 'the requested change');
  await page.getByText('rejected by the test').waitFor();
  faultsWanted = false;
  await page.unroute('**/v1/robots/worn-01/models');
  await page.route('**/v1/robots/worn-01/proposals?*', (route) =>
    route.fulfill({
      json: {
        robot_id: 'worn-01',
        proposals: [{ ...proposals[0], state: 'superseded', closed_reason: 'made for version 7' }],
      },
    }),
  );
  await page.reload();
  await page.getByText('1 closed proposal').click();
  await page.getByText('made for version 7').waitFor();
  await page.unroute('**/v1/robots/worn-01/proposals?*');
});

await check('payloads and contradictions are shown with the mission', async () => {
  const { missions } = await get('/v1/missions?robot_id=worn-01&limit=1');
  const payload = { verdict: 'undeclared', declared_kg: 0, undeclared_kg: 12.3, undeclared_sd_kg: 1.1 };
  const says = 'wheel_velocity looks given in rpm.';
  const contradictions = [{ kind: 'unit', channel: 'wheel_velocity', says }];
  const loaded = { ...missions[0], contradictions, findings: { ...missions[0].findings, payload } };
  await page.route('**/v1/missions?*', (route) =>
    route.fulfill({ json: { missions: [loaded], next_cursor: null } }),
  );
  await go(page, '#/missions?robot=worn-01&state=finished');
  await page.getByText('+12 kg payload').waitFor();
  await page.unroute('**/v1/missions?*');
  await page.route(`**/v1/missions/${loaded.id}`, (route) => route.fulfill({ json: loaded }));
  await go(page, `#/missions/${loaded.id}`);
  await page.getByText('12.3 ± 1.1').waitFor();
  await page.getByRole('alert').getByText(says).waitFor();
  await page.getByText('Not compared').waitFor();
  await page.unroute(`**/v1/missions/${loaded.id}`);
});

await check('a mission shows every sample of its motors', async () => {
  await go(page, `#/missions/${mission.id}`);
  await page.getByRole('button', { name: 'Show samples' }).click();
  const { utime_us: times } = await get(`/v1/missions/${mission.id}/telemetry?limit=20000`);
  await page.getByText(`${times.length} samples as received`).waitFor();
  await page.getByRole('button', { name: 'Current', exact: true }).click();
  await page.getByRole('img', { name: /^motor current/ }).waitFor();
});

await check('the ledger of a mission is complete', async () => {
  await go(page, `#/missions/${mission.id}`);
  await page.locator('.waterfall tr.battery').waitFor();
  const { ledger } = await get(`/v1/missions/${mission.id}/ledger`);
  const [sum, battery] = (await page.locator('.closing b').allTextContents()).map(joulesOf);
  const near = (value) => Math.abs(value / ledger.battery_j - 1) < 1e-4;
  expect(near(sum) && near(battery), `${sum}, ${battery} against ${ledger.battery_j}`);
  await page.getByText('They agree').waitFor();
  const bars = await page
    .locator('.waterfall rect.account')
    .evaluateAll((all) =>
      all.map((r) => [
        parseFloat(r.getAttribute('x')),
        parseFloat(r.getAttribute('width')),
        r.getAttribute('class'),
      ]),
    );
  const odd = bars.findIndex(([, , name]) => name.includes('unexplained'));
  const end = ([x, w]) => x + w;
  const [model, unexplained, total] = [bars[odd - 1], bars[odd], bars[bars.length - 1]];
  const reached = ledger.terms_j.unexplained < 0 ? unexplained[0] : end(unexplained);
  expect(Math.abs(reached - end(total)) < 0.2, 'unexplained does not end where the battery does');
  expect(
    Math.abs((ledger.terms_j.unexplained < 0 ? end(unexplained) : unexplained[0]) - end(model)) < 0.2,
    'unexplained does not start where the model ends',
  );
});

await check('a mission is compared with the minimum-energy drive', async () => {
  await page.locator('.bars tr').nth(2).waitFor();
  const shown = await page.locator('.bars tr').nth(2).locator('.figure').textContent();
  const leastJ = joulesOf(shown);
  // The minimum includes the mission itself, except for the blur of its trace's spans.
  expect(
    leastJ > 0 && leastJ < 1.03 * mission.energy.modelled_j,
    `least ${shown}, modelled ${mission.energy.modelled_j} J`,
  );
});

await check('the comparison includes payload changes during a mission', async () => {
  let carried = [];
  for (const m of (await get('/v1/missions?robot_id=worn-01&limit=50')).missions) {
    const payloads = new Set((await get(`/v1/missions/${m.id}/telemetry?limit=100000`)).payload_kg);
    if (payloads.size < 2) continue;
    const request = page.waitForRequest((r) => r.url().includes('/profile?model_version='));
    await go(page, `#/missions/${m.id}`);
    const { path: legs, payload_kg: atStart } = (await request).postDataJSON();
    carried = [atStart, ...legs.filter((leg) => leg.kind === 'payload').map((leg) => leg.payload_kg)];
    expect(
      carried.every((kg) => payloads.has(kg)),
      `carried ${carried}, payloads ${[...payloads]}`,
    );
    if (carried.length > 1) break;
  }
  expect(carried.length > 1, 'no mission changed its payload between legs');
  await page.getByText('payload as the robot reported it on the way').waitFor();
  await go(page, `#/missions/${mission.id}`);
  await page.locator('.bars tr').nth(2).waitFor();
});

await check('a payload that was not reported is assumed from the start', async () => {
  const payloads = '**/telemetry?from_utime_us=*&limit=1';
  await page.route(payloads, (route) => route.fulfill({ json: { payload_kg: [null] } }));
  await go(page, '#/missions');
  await page.getByRole('table').first().waitFor();
  await go(page, `#/missions/${mission.id}`);
  await page.getByText(/payload at the start, .+ on all legs: later changes are unknown/).waitFor();
  await page.unroute(payloads);
});

await check('the trace is read at the cursor and zoomed', async () => {
  const plot = page.locator('.uplot .u-over').first();
  const box = await plot.boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await until('a reading', async () => (await page.locator('.strip dd').nth(1).textContent()).includes('W'));
  await page.mouse.move(box.x + box.width * 0.3, box.y + 40);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.6, box.y + 60, { steps: 6 });
  await page.mouse.up();
  await page.getByRole('button', { name: 'Whole mission' }).click();
  await page.getByRole('group', { name: 'Power and speed over time' }).focus();
  await page.keyboard.press('Home');
  for (let k = 0; k < 3; ++k) await page.keyboard.press('Shift+ArrowRight');
  const time = () => page.locator('.strip dd').first().textContent();
  const before = await time();
  await page.keyboard.press('ArrowRight');
  await until('the next reading', async () => (await time()) !== before);
  await page.keyboard.press('+');
  await page.getByRole('button', { name: 'Whole mission' }).waitFor();
  await page.keyboard.press('Escape');
  await page.getByRole('button', { name: 'Whole mission' }).waitFor({ state: 'detached' });
  await page.getByRole('button', { name: 'Gap', exact: true }).click();
  await page.getByText('measured − modelled').waitFor();
});

await check('a plan shows the computed result', async () => {
  const response = page.waitForResponse(
    (r) => r.url().endsWith(`/v1/robots/${robot}/profile`) && r.request().method() === 'POST',
  );
  await go(page, `#/plan?robot=${robot}`);
  const answer = await (await response).json();
  await page.getByText('Least energy', { exact: true }).first().waitFor();
  const shown = await page.locator('.plan-result .readout.accent dd').textContent();
  const joule = joulesOf(shown);
  expect(
    Math.abs(joule - answer.energy_j) <= 0.006 * answer.energy_j,
    `${shown} against ${answer.energy_j} J`,
  );
  expect(answer.pareto.length > 2, 'a front');
});

await check('a plan is marked as outdated and compared within limits', async () => {
  await go(page, `#/plan?robot=${robot}&path=straight:7,turn:90,straight:3`);
  await page.getByText('Least energy', { exact: true }).first().waitFor();
  equal(await page.getByLabel('Leg 1, length').inputValue(), '7', 'the leg of the address');
  const { model } = await get(`/v1/robots/${robot}`);
  const text = await page.locator('.bars tr').nth(1).textContent();
  expect(/the plan saves|costs|not possible within the limits/.test(text), text);
  // At its own pace the trapezoid would exceed the speed limit.
  const response = page.waitForResponse((r) => r.url().endsWith('/profile'));
  await page.getByLabel('Leg 1, length').fill('8');
  await page.getByText('Out of date.').waitFor();
  expect(page.url().includes('straight:8') || page.url().includes('straight%3A8'), page.url());
  await page.getByRole('button', { name: 'Compute again' }).click();
  await page.getByText('Out of date.').waitFor({ state: 'detached' });
  const { trapezoid } = (await (await response).json()).baselines;
  const fastest = (trapezoid.peak_speed_m_s * trapezoid.duration_s) / trapezoid.slowed.duration_s;
  expect(fastest <= model.limits.speed_m_s * (1 + 1e-9), `${fastest} m/s is over the limit`);
  await page.locator('.bars').getByText('slowed to keep the limits').first().waitFor();
});

await check('a plan shows its probability of success', async () => {
  const charge = (await get(`/v1/robots/${robot}`)).model.battery.reserve_fraction * 100 + 0.2;
  await page.getByLabel('Charge now').fill(String(charge));
  const request = page.waitForRequest('**/autonomy'); // a response may belong to a cancelled request
  await page.keyboard.press('Enter');
  const { plan, minimum_energy: planned } = await (await (await request).response()).json();
  const shown = (p) =>
    p > 0.999
      ? 'more than 99.9\u00a0%'
      : p < 0.001
        ? 'less than 0.1\u00a0%'
        : `${(100 * p).toFixed(p > 0.99 || p < 0.01 ? 1 : 0)}\u00a0%`;
  const verdict = `${shown(planned.success_probability)} chance to finish with its reserve of`;
  await until(verdict, async () =>
    (await page.locator('.verdict-box .verdict').allTextContents()).some((text) => text.includes(verdict)),
  );
  const rows = await page.locator('.chances tbody tr').allTextContents();
  for (const [k, p] of [planned, plan].entries())
    expect(rows[k].includes(shown(p.success_probability)), `${rows[k]} against ${p.success_probability}`);
  const low = page.waitForResponse((r) => r.url().endsWith('/autonomy'));
  await page.getByLabel('Charge now').fill('');
  await page.keyboard.press('Enter');
  await low;
});

await check('impossible time savings are not offered', async () => {
  let response = page.waitForResponse((r) => r.url().endsWith('/profile'));
  await page.getByRole('button', { name: 'Compute', exact: true }).click();
  const { certificate } = await (await response).json();
  response = page.waitForResponse((r) => r.url().endsWith('/profile'));
  await page.getByLabel('Deadline').fill((certificate.shortest_time_s * 1.0004).toFixed(5));
  await page.keyboard.press('Enter');
  await response;
  await page.locator('.facts').getByText('no shorter time is possible: the robot is at its limits').waitFor();
  equal(
    await page.getByText(/(second less|less time) costs at least 0 (J|Wh)/).count(),
    0,
    'offers for nothing',
  );
  response = page.waitForResponse((r) => r.url().endsWith('/profile'));
  await page.getByLabel('Deadline').fill('');
  await page.getByRole('button', { name: 'Compute', exact: true }).click();
  const free = await (await response).json();
  // The cheapest drive of some robots is at their limits.
  const atLimits = free.duration_s <= 1.001 * free.certificate.shortest_time_s;
  const words = atLimits ? 'no shorter time is possible' : 'the duration of least energy';
  await page.locator('.facts').getByText(words).waitFor();
});

await check('a deadline of the front is met; charge limits it', async () => {
  const point = page.locator('.front-pick .number');
  const energyOf = (text) => Number.parseFloat(text.split('·')[1]);
  const slowest = await point.innerText();
  await page.getByRole('slider').press('Home');
  await point.filter({ hasNotText: slowest }).waitFor();
  const fastest = await point.innerText();
  expect(energyOf(fastest) > energyOf(slowest), `${fastest} left of ${slowest}`);
  await page.keyboard.press('End');
  await point.filter({ hasText: slowest }).waitFor();
  await page.keyboard.press('ArrowLeft');
  const again = page.waitForResponse((r) => r.url().endsWith('/profile'));
  await page.getByRole('button', { name: 'Use as deadline' }).click();
  const answer = await (await again).json();
  const deadline = Number(await page.getByLabel('Deadline').inputValue());
  expect(answer.duration_s <= deadline * (1 + 1e-6), `${answer.duration_s} s after ${deadline} s`);
  await page.getByLabel('Charge now').fill('90');
  await page.keyboard.press('Enter');
  await page.getByText('The charge suffices').waitFor();
  await page.getByLabel('Charge now').fill('1');
  await page.keyboard.press('Enter');
  await page.getByText('The charge does not suffice').waitFor();
});

await check('legs are edited and a path is drawn by keyboard', async () => {
  await page.getByLabel('Deadline').fill('');
  await page.getByRole('button', { name: 'Add a leg' }).click();
  await page.getByLabel('Kind of leg 4').selectOption('arc');
  let request = page.waitForRequest((r) => r.url().endsWith('/profile'));
  await page.getByRole('button', { name: 'Compute', exact: true }).click();
  equal((await request).postDataJSON().path[3].kind, 'arc', 'fourth segment');
  await page.getByRole('button', { name: 'Draw' }).click();
  await page.getByRole('button', { name: 'Clear' }).click();
  const canvas = page.locator('.draw canvas');
  await canvas.focus();
  await page.keyboard.press('Enter');
  for (let k = 0; k < 4; ++k) await page.keyboard.press('Shift+ArrowRight');
  await page.keyboard.press('Enter');
  const box = await canvas.boundingBox();
  await page.mouse.click(box.x + box.width * 0.8, box.y + box.height * 0.3);
  request = page.waitForRequest((r) => r.url().endsWith('/profile'));
  await page.getByRole('button', { name: 'Compute', exact: true }).click();
  const body = (await request).postDataJSON();
  equal(body.path[0].points.length, 2, 'points after the first');
  equal(body.path[0].points[0].x_m, 4, 'x of the second point');
});

await check('unknown pages and records are reported', async () => {
  faultsWanted = true; // the browser reports the expected 404
  const refused = [];
  page.on('response', (r) => r.status() === 404 && refused.push(r.url()));
  await go(page, '#/missions/999999');
  await page.getByText('There is no mission 999999').waitFor();
  await page.getByRole('link', { name: 'all missions' }).waitFor();
  equal(refused.length, 1, `requests with status 404: ${refused}`);
  await go(page, '#/gap/999999');
  await page.getByText('There is no diagnosis 999999').waitFor();
  await go(page, '#/robots/absent');
  await page.getByText('There is no robot absent').waitFor();
  await go(page, '#/nowhere');
  await page.getByText('There is no such page').waitFor();
  faultsWanted = false;
});

await check('waiting and faults are shown and retried', async () => {
  const fresh = await openPage();
  const shot = (name) =>
    fresh.screenshot({ path: path.join(given.out, 'screenshots', `${name}-laptop.png`) });
  let letGo;
  const held = new Promise((goOn) => (letGo = goOn));
  await fresh.route('**/v1/missions?*', async (route) => {
    await held;
    await route.fulfill({
      status: 503,
      contentType: 'application/problem+json',
      body: JSON.stringify({ title: 'Service Unavailable', status: 503, detail: 'the store is busy' }),
    });
  });
  await go(fresh, '#/missions');
  await fresh.getByText('Loading missions').waitFor();
  await shot('missions-loading');
  faultsWanted = true;
  letGo();
  await fresh.getByText('the store is busy').waitFor();
  await shot('missions-fault');
  await fresh.unroute('**/v1/missions?*');
  await fresh.getByRole('button', { name: 'Try again' }).click();
  await fresh.locator('.missions tbody tr').first().waitFor();
  await close(fresh);
  faultsWanted = false;
});

await check('every link of every view works', async () => {
  const seen = new Set();
  for (const hash of ['#/fleet', `#/robots/${robot}`, '#/missions', `#/missions/${mission.id}`, '#/plan']) {
    await go(page, hash);
    await settled(page);
    for (const to of await page
      .locator('a[href]')
      .evaluateAll((all) => all.map((a) => a.getAttribute('href'))))
      seen.add(to);
  }
  for (const to of [...seen].filter(
    (to, k, all) =>
      to !== '#main' && all.findIndex((o) => o.replace(/[\d]+/g, '') === to.replace(/[\d]+/g, '')) === k,
  )) {
    await go(page, to);
    await page.locator('main h1, main .empty').first().waitFor({ state: 'attached' });
    equal(await page.getByText('There is no such page').count(), 0, `link ${to}`);
  }
});

let diagnosis = 0;
await check('other views are loaded on demand and report failures', async () => {
  const fresh = await openPage();
  await fresh.goto(`${base}/#/fleet`);
  await fresh.locator('.fleet tbody th a').first().waitFor();
  expect(
    !(await fresh.evaluate(() =>
      performance.getEntriesByType('resource').some((r) => /(views|uplot)\.js$/.test(r.name)),
    )),
    'other views are part of the first load',
  );
  faultsWanted = true;
  await fresh.route('**/views.js', (route) => route.abort());
  await fresh.getByRole('link', { name: 'Gap', exact: true }).click();
  await fresh.getByText('This part of the page could not be loaded').waitFor();
  await fresh.screenshot({ path: path.join(given.out, 'screenshots', 'gap-not-loaded-laptop.png') });
  await close(fresh);
  faultsWanted = false;
});

await check('a diagnosis is started by keyboard and shown', async () => {
  await go(page, '#/gap');
  await page.getByText('No diagnosis yet').waitFor();
  await page.screenshot({ path: path.join(given.out, 'screenshots', 'gap-empty-laptop.png') });
  equal(
    await page
      .getByRole('combobox', { name: 'Robot', exact: true })
      .evaluate((s) => s.querySelector('optgroup').label),
    'Recent missions',
    'robots with missions come first',
  );
  const chosen = page.getByRole('combobox', { name: 'Robot', exact: true });
  await until('the robot that departs most', async () => (await chosen.inputValue()) === 'worn-01');
  await page.getByText('8 finished missions').waitFor();
  await page.getByRole('combobox', { name: 'Robot', exact: true }).focus();
  for (const wanted of ['INPUT', 'BUTTON']) {
    await page.keyboard.press('Tab');
    equal(await page.evaluate(() => document.activeElement.tagName), wanted, 'focus');
  }
  await page.keyboard.press('Enter');
  await page.getByRole('heading', { level: 1, name: /^Diagnosis \d+$/ }).waitFor();
  diagnosis = Number((await page.getByRole('heading', { level: 1 }).textContent()).match(/\d+/)[0]);
  await page.screenshot({ path: path.join(given.out, 'screenshots', 'gap-running-laptop.png') });
  await page.getByText('Effects found').waitFor({ timeout: 120_000 });
  const { result, held_back: heldBack } = await get(`/v1/diagnoses/${diagnosis}`);
  equal(result.effects[0].id, 'coulomb_friction', 'the effect');
  equal(heldBack.length, 2, 'missions held back');
  const row = page.locator('.effects tbody tr').first();
  await row.getByText('coulomb friction').waitFor();
  equal(
    number(await row.locator('td.figure').nth(1).textContent()),
    Math.round(100 * result.effects[0].share),
    'what it closes',
  );
  equal(
    number(await row.locator('td.figure').last().textContent()),
    Math.min(97, Math.round(100 * result.effects[0].group)),
    'its group',
  );
  const errors = (await page.locator('.referee td.figure').allTextContents()).map(number);
  equal(
    errors.join(),
    [result.baseline.held_out, result.baseline.explanation_held_out, result.baseline.unchanged_model_held_out]
      .map((v) => Math.round(1000 * v) / 10)
      .join(),
    'compared with a linear regression',
  );
  expect((await page.locator('.where tbody tr').count()) >= 5, 'regions');
});

await check('a diagnosis shows checks, corrections and alternatives', async () => {
  const job = await get(`/v1/diagnoses/${diagnosis}`);
  const refused = {
    ...job,
    result: {
      ...job.result,
      verdict: 'not_this_robot',
      verdict_title: 'not this robot',
      checks: [
        {
          id: 'battery_current_reversed',
          channel: 'battery_current',
          value: -1,
          interval: [-1.1, -0.9],
          says: 'The battery current is reversed.',
          contradicted: true,
        },
      ],
      corrections: [{ parameter: 'idle_power_w', file: 20, fits: 31, sd: 0.4 }],
      effects: [
        {
          ...job.result.effects[0],
          id: 'friction_asymmetry',
          parameters: {
            ratio: { value: 0.4, sd: 0.1, unit: '1' },
            side: { value: 0, sd: null, unit: '1' },
            rate_rad_s: { value: 0, sd: null, unit: 'rad/s' },
          },
        },
      ],
      adoption: {
        refusal: null,
        corrects_file: true,
        effects: [
          {
            id: 'coulomb_friction',
            parameters: { ratio: 0.5 },
            instead: [
              { id: 'viscous_friction', parameters: { ratio: 3 } },
              { id: 'turning_scrub', parameters: {} },
            ],
          },
        ],
      },
    },
  };
  await page.route(`**/v1/diagnoses/${diagnosis}`, (route) => route.fulfill({ json: refused }));
  await openAnew(page, diagnosis);
  await page.getByText('The battery current is reversed.').waitFor();
  await page.getByText('It is not used below.').waitFor();
  await page.getByText('31.00 ± 0.40').waitFor();
  equal(
    (await page.locator('.effects tbody tr').first().locator('td > div .note').allTextContents()).join(),
    'by,side',
    'parameters, without those of zero',
  );
  await page.getByText('side right').waitFor();
  const choice = page.getByRole('combobox', { name: 'Adopt which of these' });
  equal(
    (await choice.locator('option').allTextContents()).join(),
    'choose one,coulomb friction,viscous friction',
    'effects with a strength',
  );
  expect(
    await page.getByRole('button', { name: 'Adopt', exact: true }).isDisabled(),
    'nothing is adopted before one is chosen',
  );
  await choice.selectOption('viscous_friction');
  const request = page.waitForRequest(`**/v1/robots/worn-01/models`);
  await page.route(`**/v1/robots/worn-01/models`, (route) =>
    route.fulfill({ status: 409, json: { status: 409, title: 'Conflict', detail: 'rejected by the test' } }),
  );
  faultsWanted = true;
  await adopt(page, 'Adopt');
  equal((await request).postDataJSON().effect.join(), 'viscous_friction', 'the requested effect');
  await page.getByText('rejected by the test').waitFor();
  faultsWanted = false;
  await page.unroute(`**/v1/robots/worn-01/models`);
  Object.assign(refused.result.adoption, { refusal: 'the verdict is inconclusive' });
  refused.result.adoption.effects[0].instead = [];
  await openAnew(page, diagnosis);
  await page.getByText('Not recommended:').waitFor();
  equal(
    await page.getByRole('button', { name: 'Adopt', exact: true }).count(),
    0,
    'buttons to adopt what is refused',
  );
  await page.getByRole('button', { name: 'Adopt anyway' }).waitFor();
  await page.unroute(`**/v1/diagnoses/${diagnosis}`);
  await go(page, '#/gap');
});

await check('no regions without a gap; zoom is in the address', async () => {
  const job = await get(`/v1/diagnoses/${diagnosis}`);
  const none = {
    ...job,
    model: null,
    result: {
      ...job.result,
      verdict: 'none',
      verdict_title: 'no gap',
      effects: [],
      adoption: { ...job.result.adoption, effects: [] },
    },
  };
  await page.route(`**/v1/diagnoses/${diagnosis}`, (route) => route.fulfill({ json: none }));
  await openAnew(page, diagnosis);
  await page.getByText('No gap').waitFor();
  equal(await page.locator('.where, .adopt').count(), 0, 'regions and adoption');
  const [effect] = job.result.effects;
  const effects = [effect, { ...effect, id: 'brush_drop', probability: 0.4 }];
  Object.assign(none.result, { verdict: 'inconclusive', verdict_title: 'inconclusive', effects });
  await openAnew(page, diagnosis);
  const verdict = page.locator('.verdict-box .verdict');
  await verdict.getByText('most likely').waitFor();
  expect(/coulomb friction$/.test(await verdict.textContent()), await verdict.textContent());
  await page.unroute(`**/v1/diagnoses/${diagnosis}`);
  await go(page, `#/missions/${mission.id}?from=2&to=6&colour=gap`);
  await page.getByRole('button', { name: 'Whole mission' }).waitFor();
  equal(
    await page.getByRole('button', { name: 'Gap', exact: true }).getAttribute('aria-pressed'),
    'true',
    'the colouring',
  );
  await page.getByRole('button', { name: 'Whole mission' }).click();
  await until('the address without a zoom', () => !page.url().includes('from='));
});

await check('a mission shows its conditions', async () => {
  const mission = (await get('/v1/missions?robot_id=worn-01')).missions[0];
  await go(page, `#/missions/${mission.id}`);
  const conditions = page.locator('.panel', { has: page.getByRole('heading', { name: 'Conditions' }) });
  await conditions.getByRole('rowheader', { name: 'cpu load' }).waitFor();
  const { covariates } = await get(`/v1/missions/${mission.id}/covariates`);
  const loads = covariates.find((c) => c.name === 'cpu_load').value;
  const shown = await conditions
    .getByRole('row', { name: 'cpu load' })
    .getByRole('cell')
    .last()
    .textContent();
  equal(
    shown,
    `${Number(Math.min(...loads).toPrecision(4))} to ${Number(Math.max(...loads).toPrecision(4))}, ${loads.length} changes`,
    'the range of the load',
  );
});

let outside = 0;
await check('a diagnosis shows reasons for its uncertainty', async () => {
  outside = (
    await (
      await fetch(`${base}/v1/diagnoses`, {
        method: 'POST',
        headers: { 'content-type': 'application/json' },
        body: JSON.stringify({ robot_id: 'oval-01' }),
      })
    ).json()
  ).id;
  await go(page, `#/gap/${outside}`);
  await page.getByText('Outside the catalogue', { exact: true }).waitFor({ timeout: 120_000 });
  const { result } = await get(`/v1/diagnoses/${outside}`);
  equal(result.outside.follows, 'wheel_angle', 'the followed variable');
  equal(
    await page.locator('.verdict-box .reasons li').first().textContent(),
    result.reasons[0],
    'the reason',
  );
  expect(result.reasons[0].includes('repeats with the turning of a wheel'), result.reasons[0]);
});

await check('a finding is tested, adopted and rolled back', async () => {
  await go(page, `#/gap/${diagnosis}`);
  await page.getByRole('button', { name: 'Test on other missions' }).click();
  await page.locator('.test tbody tr').first().waitFor();
  equal(await page.locator('.test tbody tr').count(), 2, 'missions tested on');
  equal((await get('/v1/robots/worn-01')).model_version, 1, 'a test alone adopts nothing');
  await page.getByText(/^On 2 missions not used for the fit, the energy error changes from/).waitFor();
  const [before, after] = (await page.locator('.verdict-box .verdict b').allTextContents())
    .slice(-2)
    .map(number);
  expect(after < before / 3, `energy error ${before} % before, ${after} % after`);
  figures.adoption_error_percent = [before, after];
  await adopt(page, 'Adopt');
  await page.getByText('Version 2 is in force').waitFor();
  await page.screenshot({
    path: path.join(given.out, 'screenshots', 'gap-adopted-laptop.png'),
    fullPage: true,
  });
  const adopted = await get('/v1/robots/worn-01');
  equal(adopted.model_version, 2, 'version');
  equal(Object.keys(adopted.model.effects)[0], 'coulomb_friction', 'adopted effect');
  await go(page, '#/robots/worn-01');
  await page
    .getByRole('link', { name: `diagnosis ${diagnosis}`, exact: true })
    .first()
    .waitFor();
  await adopt(page, 'Put version 1 in force again', 'Put version 1 in force');
  await adopt(page, 'Put version 2 in force again', 'Put version 2 in force');
  await until('version 2', async () => (await get('/v1/robots/worn-01')).model_version === 2);
  const kinds = async () => (await get('/v1/event-log?robot_id=worn-01')).events.map((e) => e.kind).join(' ');
  await until(
    'the event log',
    async () => (await kinds()) === 'model_adopted model_activated model_activated',
  );
});

await check('a change without improvement is rejected with figures', async () => {
  await page.route(`**/v1/robots/worn-01/models`, async (route) => {
    // As if the model had become worse: the adopted effect is removed.
    const { model } = (await get('/v1/robots/worn-01/models')).models.find((v) => v.model_version === 1);
    await route.continue({ postData: JSON.stringify({ model }) });
  });
  await go(page, `#/gap/${diagnosis}`);
  faultsWanted = true;
  await adopt(page, 'Adopt');
  await page.getByText('Not adopted').waitFor();
  await page.getByRole('button', { name: 'Adopt anyway' }).waitFor();
  expect((await page.locator('.test tbody tr').count()) >= 2, 'the figures of the refusal');
  await page.screenshot({
    path: path.join(given.out, 'screenshots', 'gap-refused-laptop.png'),
    fullPage: true,
  });
  faultsWanted = false;
  await page.unroute(`**/v1/robots/worn-01/models`);
});

await check('the log lists events, newest first', async () => {
  await go(page, '#/audit?robot=worn-01');
  await until('three entries', async () => (await page.locator('.events tbody tr').count()) >= 3);
  const titles = await page.locator('.events tbody th').allTextContents();
  equal(titles.slice(0, 2).join(), 'Model put in force,Model put in force', 'the newest entries');
  expect(titles.includes('Model adopted'), titles.join());
  await page.getByRole('combobox', { name: 'Robot' }).selectOption('');
  await until('entries of all robots', async () => (await page.locator('.events thead th').count()) === 4);
});

await check('a reason for attention is acknowledged', async () => {
  const reason = {
    kind: 'silent',
    severity: 'fault',
    message: 'No telemetry since noon during mission m1.',
    action: 'Check its network.',
    acknowledged: null,
  };
  let sent = null;
  await page.route('**/v1/attention', (route) =>
    route.fulfill({
      json: {
        attention: [
          {
            robot_id: robot,
            severity: 'fault',
            acknowledged: reason.acknowledged !== null,
            reasons: [reason],
          },
        ],
        counts: { fault: 1, warning: 0, notice: 0 },
      },
    }),
  );
  await page.route(`**/v1/robots/${robot}/acknowledge`, (route) => {
    sent = route.request().postDataJSON();
    reason.acknowledged = { time: '', utime_us: 1.7e15, by: 'carol', note: sent.note };
    return route.fulfill({ json: {} });
  });
  await go(page, '#/fleet');
  await until('one counted', async () => (await page.title()).startsWith('(1) Fleet'));
  await go(page, `#/robots/${robot}`);
  await page.getByRole('button', { name: 'Acknowledge' }).click();
  await page.getByRole('textbox', { name: 'Note' }).fill('battery swap');
  reason.message = 'No telemetry since 12:00 during mission m1.';
  await page.getByText(reason.message).first().waitFor(); // the list is read again; the note stays
  await page.getByRole('dialog').getByRole('button', { name: 'Acknowledge' }).click();
  await page.getByText(/^Acknowledged by carol .*: battery swap$/).waitFor();
  equal(JSON.stringify(sent), '{"kind":"silent","note":"battery swap"}', 'the request');
  await go(page, '#/fleet');
  await page.getByText('Need attention', { exact: true }).first().waitFor();
  await until('none counted', async () => (await page.title()).startsWith('Fleet'));
  await page.unroute('**/v1/attention');
  await page.unroute(`**/v1/robots/${robot}/acknowledge`);
});

await check('the fleet and trends compare periods', async () => {
  const { missions } = await get('/v1/missions?robot_id=worn-01&limit=50');
  const midnight = new Date().setHours(0, 0, 0, 0) * 1000;
  const today = (await get('/v1/missions?limit=500')).missions.filter((m) => m.start_utime_us >= midnight);
  const sum = (of) => of.reduce((total, m) => total + m.energy.battery_j, 0);
  const readout = (label) => page.locator('.readout', { has: page.getByText(label, { exact: true }) });
  await go(page, '#/fleet');
  await readout('Today').locator('.unit').first().waitFor(); // until then it is a dash
  const shown = joulesOf(await readout('Today').locator('.quantity').first().textContent());
  expect(
    shown > 0 ? shown / sum(today) > 0.8 : sum(today) === 0,
    `${shown} J today, missions ${sum(today)} J`,
  );
  const at = missions.map((m) => m.start_utime_us);
  const from = localMinute(Math.min(...at)).slice(0, 10);
  await go(page, `#/trends?robot=worn-01&from=${from}`);
  await readout('Energy').waitFor();
  const energy = joulesOf(await readout('Energy').locator('.quantity').first().textContent());
  expect(Math.abs(energy / sum(missions) - 1) < 0.01, `${energy} J, missions ${sum(missions)} J`);
  const asked = page.waitForRequest(
    (r) => r.url().includes('/v1/mission-totals?') && !r.url().includes('group_by'),
  );
  await page.getByRole('button', { name: '7 d', exact: true }).click();
  const times = new URL((await asked).url()).searchParams;
  const days = (times.get('to_utime_us') - times.get('from_utime_us')) / 86_400e6;
  expect(Math.abs(days - 7) < 0.01, `${days} days`);
  expect(page.url().includes('last=7'), page.url());
});

await check('the help contains the glossary', async () => {
  await go(page, '#/help');
  const text = await readFile(path.join(given.page, 'source/help.md'), 'utf8');
  const glossary = text.slice(text.indexOf('## Glossary'));
  await page.locator('.glossary').last().locator('dt').first().waitFor();
  equal(
    await page.locator('.glossary').last().locator('dt').count(),
    glossary.match(/^- \*\*/gm).length,
    'terms',
  );
});

await check('robots are cards on a phone without clipping', async () => {
  const phone = await openPage({ viewport: sizes.phone, hasTouch: true });
  await phone.goto(`${base}/#/fleet`);
  await phone.locator('.fleet tbody th a').first().waitFor();
  const heights = await phone
    .locator('.fleet tbody tr:not(.spacer)')
    .evaluateAll((all) => all.map((row) => row.offsetHeight));
  expect(
    heights.every((height) => height > 100 && height < 160),
    `heights ${heights}`,
  );
  const cut = await phone
    .locator('.fleet tbody tr:not(.spacer)')
    .evaluateAll((all) =>
      all.flatMap((row) =>
        [...row.querySelectorAll('td, th')]
          .filter((cell) => cell.scrollWidth > cell.clientWidth + 1)
          .map((cell) => cell.className),
      ),
    );
  equal(cut.join(), '', 'cells that are cut off');
  await phone.getByLabel('Sort by').selectOption('power');
  expect(phone.url().includes('sort=power'), phone.url());
  const columns = await phone
    .locator('.readouts .readout')
    .evaluateAll((all) => new Set(all.map((one) => one.offsetLeft)).size);
  equal(columns, 2, 'columns of figures');
  await close(phone);
});

const markedRobot = 'oval-01';
// All marks of robots and missions at the same time.
async function markAll(shown) {
  const answered = (pattern, change) =>
    shown.route(pattern, async (route) => {
      const answer = await (await route.fetch()).json();
      await route.fulfill({ json: change(answer, route.request().url()) ?? answer });
    });
  const payload = { verdict: 'undeclared', declared_kg: 0, undeclared_kg: 12.3, undeclared_sd_kg: 1 };
  await answered('**/v1/missions?*', ({ missions }) => {
    for (const m of missions)
      Object.assign(m, {
        incomplete: true,
        findings: { payload },
        mission_id: `${m.robot_id}-261123-200923-m132`,
        robot_id: `${m.robot_id}-north-hall-reach-truck-line-042`,
      });
  });
  const longAgo = { live: false, silent_s: 1e8, faults: { missing: 66, out_of_order: 3 } };
  await answered('**/v1/robots', ({ robots }) => {
    for (const one of robots) if (one.robot_id === markedRobot) Object.assign(one, longAgo);
  });
  await answered('**/v1/robots/*/gap-history?*', ({ siblings }) => {
    siblings.push({ ...siblings[0], robot_id: markedRobot, ratio: 1.18, stands_out: true });
  });
  const reasons = ['drift', 'stands_out', 'gap_diagnosed', 'proposal'].map((kind) => ({
    kind,
    severity: 'warning',
    message: 'Uses 11.2 % more energy than before 2023-11-14.',
    action: 'Start a diagnosis.',
  }));
  await answered('**/v1/attention', () => ({
    attention: [{ robot_id: markedRobot, severity: 'warning', reasons }],
  }));
}
const leftOpen = [];
for (const size of ['phone', 'landscape_tablet', 'small_laptop', 'laptop']) {
  await check(`marks stay inside their cells, ${size}`, async () => {
    const shown = await openPage({ viewport: sizes[size] });
    await markAll(shown);
    leftOpen.push(shown);
    const wide = () => shown.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    await go(shown, '#/missions');
    await shown.locator('.missions .flag').first().waitFor();
    expect((await wide()) <= 0, `missions are ${await wide()} px wider than the window`);
    if (size === 'phone') {
      const heights = await shown
        .locator('.missions tbody td.figure')
        .evaluateAll((all) => all.map((cell) => cell.offsetHeight));
      expect(Math.max(...heights) < 30, `values next to their titles: ${Math.max(...heights)} px high`);
    }
    await go(shown, '#/fleet');
    const row = shown.locator('.fleet tbody tr', { hasText: markedRobot });
    await row.getByText('Uses 11.2 % more energy than before 2023-11-14. + 3 more').waitFor();
    expect((await wide()) <= 0, `the fleet is ${await wide()} px wider than the window`);
    const outside = await row.evaluate((tr) => {
      const inside = (inner, outer) =>
        inner.left >= outer.left - 1 &&
        inner.right <= outer.right + 1 &&
        inner.top >= outer.top - 1 &&
        inner.bottom <= outer.bottom + 1;
      const bottom = tr.getBoundingClientRect().bottom;
      return [...tr.querySelectorAll('.flag, .telemetry, .ratio, .below.fault')]
        .filter((part) => {
          const { left, right, top } = part.closest('td').getBoundingClientRect();
          return !inside(part.getBoundingClientRect(), { left, right, top, bottom });
        })
        .map((part) => part.textContent);
    });
    equal(outside.join('; '), '', 'content outside its cell');
    expect(/20\d\d-\d\d-\d\d$/.test(await row.locator('.telemetry').textContent()), 'the day of the silence');
    await shown.screenshot({ path: path.join(given.out, 'screenshots', `marked-${size}.png`) });
  });
}
// Also the pages of failed checks: an open page sends requests.
for (const shown of leftOpen) await close(shown);

// A PNG of one grey.
function greyPng(width, height, grey) {
  const uint32 = (value) => {
    const bytes = Buffer.alloc(4);
    bytes.writeUInt32BE(value);
    return bytes;
  };
  const chunk = (type, body) => {
    const named = Buffer.concat([Buffer.from(type), body]);
    return Buffer.concat([uint32(body.length), named, uint32(crc32(named))]);
  };
  const rows = Buffer.alloc(height * (width + 1), grey);
  for (let row = 0; row < height; ++row) rows[row * (width + 1)] = 0;
  return Buffer.concat([
    Buffer.from('\x89PNG\r\n\x1a\n', 'latin1'),
    chunk('IHDR', Buffer.concat([uint32(width), uint32(height), Buffer.from([8, 0, 0, 0, 0])])),
    chunk('IDAT', deflateSync(rows)),
    chunk('IEND', Buffer.alloc(0)),
  ]);
}
const near = (a, b) => Math.abs(a - b) < 0.01 * Math.abs(b) + 0.01;
const asFile = (name, mimeType, content) => ({ name, mimeType, buffer: Buffer.from(content) });

await check('a robot is added, reviewed, edited and removed', async () => {
  const file = { ...JSON.parse(await readFile(hourRobot, 'utf8')), robot_id: 'added-01' };
  await go(page, '#/fleet');
  await page.getByRole('link', { name: 'Add a robot' }).click();
  const missing = await page.getByText(/values are missing/).textContent();
  expect(/wheel radius/.test(missing) && !/[._]/.test(missing), `names of the form: ${missing}`);
  await page
    .getByLabel('Load a robot file')
    .setInputFiles(asFile('added.json', 'application/json', JSON.stringify(file)));
  const capacity = page.getByLabel('Capacity', { exact: true });
  await until('the form', async () => (await capacity.inputValue()) === String(file.battery.capacity_ah));
  await capacity.fill('40000');
  await page
    .getByText(/is it in mAh/)
    .first()
    .waitFor();
  await capacity.fill('-1');
  const add = page.getByRole('button', { name: 'Add this robot', exact: true });
  await until('a fault', () => add.isDisabled());
  equal(await add.getAttribute('title'), 'Values are missing or invalid.', 'the reason');
  await capacity.fill(String(file.battery.capacity_ah));
  await until('no fault', () => add.isEnabled());
  await adopt(page, 'Add this robot');
  await page.getByRole('heading', { level: 1, name: 'added-01' }).waitFor();
  equal(JSON.stringify((await get('/v1/robots/added-01')).model), JSON.stringify(file), 'the stored file');
  await go(page, '#/robot-file/added-01');
  await page.getByLabel('Idle power', { exact: true }).fill('25');
  await adopt(page, 'Save');
  await page.getByText('Version 2').waitFor();
  equal((await get('/v1/robots/added-01')).model.idle_power_w, 25, 'idle power');
  await go(page, '#/robot-file/added-01');
  const remove = page.getByRole('button', { name: 'Remove this robot' });
  await remove.click();
  await page.getByRole('dialog').getByRole('combobox').selectOption('purge');
  await page.getByRole('dialog').getByRole('button', { name: 'Cancel' }).click();
  const removal = `**/v1/robots/added-01?*`;
  await page.route(removal, (route) => route.fulfill({ json: {} }));
  const request = page.waitForRequest(removal);
  await adopt(page, 'Remove this robot', 'Remove');
  expect((await request).url().endsWith('history=keep'), `${(await request).url()} after a cancelled choice`);
  await page.locator('.fleet').waitFor();
  await page.unroute(removal);
  await go(page, '#/robot-file/added-01');
  await remove.click();
  await page.getByRole('dialog').getByRole('combobox').selectOption('purge');
  await page.getByRole('dialog').getByRole('button', { name: 'Remove', exact: true }).click();
  await page.locator('.fleet').waitFor();
  equal((await fetch(`${base}/v1/robots/added-01/state`)).status, 404, 'status of the removed robot');
});

await check('a number stays as it is typed', async () => {
  const typed = async (input, text) => {
    await input.fill('');
    await input.pressSequentially(text, { delay: 250 }); // live values draw the view again meanwhile
    equal(await input.inputValue(), text, 'what was typed');
  };
  await go(page, `#/plan?robot=${robot}&path=turn:90`);
  await typed(page.getByLabel('Leg 1, angle, left positive'), '-0.05');
  await until('the leg in the address', () => decodeURIComponent(page.url()).includes('turn:-0.05'));
  await go(page, `#/robot-file/${robot}`);
  await typed(page.getByLabel('Wheel radius', { exact: true }), '0.075');
  await page.getByRole('button', { name: 'Save', exact: true }).click();
  await page.getByRole('dialog').getByText('→ 0.075').waitFor();
  await page.getByRole('dialog').getByRole('button', { name: 'Cancel' }).click();
});

await check('each request is one row with its answer', async () => {
  await go(page, '#/audit?of=requests');
  const row = page.locator('.events tbody tr', { hasText: 'remove the robot: added-01' });
  await row.first().waitFor();
  equal(await row.count(), 1, 'rows of the removal');
  equal(await row.locator('td.figure').textContent(), '200', 'its answer');
  await page.getByLabel('Contains').fill('store the robot file: added-01');
  await until('the two versions', async () => (await page.locator('.events tbody tr').count()) === 2);
  await page.locator('.events summary').first().click();
  await page
    .getByText(/body sha256: [0-9a-f]{64}/)
    .first()
    .waitFor();
});

await check('dates have the format of the page', async () => {
  let answer;
  const typed = new Promise((resolve) => (answer = resolve));
  const totals = '**/v1/mission-totals?*';
  await page.route(totals, (route) => typed.then(() => route.continue()));
  await go(page, '#/trends');
  const from = page.getByRole('textbox', { name: 'From', exact: true });
  await from.fill('2026-01-02');
  answer(); // the view is drawn again, and what is typed stays
  await settled(page);
  await page.unroute(totals);
  await from.press('Enter');
  await until('the date in the address', () => page.url().includes('from=2026-01-02'));
  await from.fill('01/03/2026');
  await from.press('Enter');
  await page.waitForTimeout(100);
  expect(page.url().includes('from=2026-01-02'), page.url());
  await go(page, '#/missions?from=2026-01-02T10:30');
  await until('a time with its minute', async () => (await from.inputValue()) === '2026-01-02 10:30');
});

await check('energy charged, cost and emissions are shown', async () => {
  const shown = await openPage();
  await shown.route('**/v1/tariff', (route) =>
    route.fulfill({ json: { price_per_kwh: 3600, currency: 'EUR', co2_g_per_kwh: 3600 } }),
  );
  const charged = (id, robotId) => ({
    id,
    robot_id: robotId,
    kind: 'charged',
    utime_us: (Date.now() - 60_000) * 1000,
    detail: { charged_j: 3.6e6 * id },
  });
  await shown.route('**/v1/event-log?*', (route) => {
    const asked = new URL(route.request().url()).searchParams;
    const of = (name) => asked.get(name) ?? '';
    const events = [charged(2, 'worn-01'), charged(1, 'oval-01')].filter(
      (e) =>
        of('kind') === e.kind &&
        of('robot_id') === e.robot_id &&
        Number(of('from_utime_us')) <= e.utime_us &&
        e.utime_us < Number(of('to_utime_us')),
    );
    return route.fulfill({ json: { events, next_cursor: null } });
  });
  const joule = (await get('/v1/mission-totals?robot_id=worn-01')).energy.battery_j;
  await go(shown, '#/trends?robot=worn-01&from=2020-01-01');
  const readout = (label) => shown.locator('.readout', { has: shown.getByText(label, { exact: true }) });
  await readout('Charged').getByText('2.00').waitFor();
  await readout('Charged').getByText('7200.00').waitFor();
  expect(near(number(await readout('Cost').locator('.number').textContent()), joule / 1000), 'the cost');
  const lost = 100 * (1 - joule / 7.2e6);
  expect(
    near(number(await readout('Not used in missions').locator('.number').textContent()), lost),
    'the loss',
  );
  await readout('Emissions').getByText('CO₂').waitFor();
  await close(shown);
});

await check('the map shows robots on the plan of their level', async () => {
  await go(page, `#/robot-file/${robot}`);
  await page.getByLabel('Map', { exact: true }).fill('hall');
  await page.getByLabel('Level', { exact: true }).fill('1');
  await page.getByRole('button', { name: 'Set map and level' }).click();
  await page.getByRole('button', { name: 'Set', exact: true }).waitFor();
  await go(page, '#/map?place=["hall","1"]');
  await page.getByText('Add a floor plan').click();
  await page.getByLabel(/^Image/).setInputFiles(asFile('hall.png', 'image/png', greyPng(100, 80, 90)));
  await page
    .getByLabel(/^map.yaml/)
    .setInputFiles(asFile('map.yaml', 'text/yaml', 'resolution: 0.5\norigin: [-25.0, -20.0, 0.0]\n'));
  await page.getByLabel(/^Chargers/).fill('2,3;-4,5');
  await page.getByRole('button', { name: 'Store', exact: true }).click();
  await page.getByText('Replace or remove the floor plan').waitFor();
  const [level] = (await get('/v1/maps')).levels;
  equal(
    JSON.stringify([level.resolution_m, level.origin_x_m, level.origin_y_m]),
    '[0.5,-25,-20]',
    'the scale',
  );
  const greyShare = () =>
    page.locator('.map-columns canvas').evaluate((canvas) => {
      const { width, height } = canvas; // copied: Chromium warns of repeated reads of a drawn canvas
      const copy = new OffscreenCanvas(width, height).getContext('2d', { willReadFrequently: true });
      copy.drawImage(canvas, 0, 0);
      const { data } = copy.getImageData(0, 0, width, height);
      let grey = 0;
      for (let at = 0; at < data.length; at += 4)
        if (Math.abs(data[at + 1] - 90) < 3 && data[at + 3] > 180 && data[at + 3] < 200) grey += 1;
      return grey / (data.length / 4);
    });
  await until('the plan below the robots', async () => (await greyShare()) > 0.3);
  await page.getByText('1 robot', { exact: true }).waitFor();
  await page.getByRole('link', { name: robot, exact: true }).waitFor();
});

await check('a mission is played on the map over another', async () => {
  await go(page, `#/missions/${mission.id}`);
  await page.getByRole('link', { name: 'Play on the map' }).click();
  const slider = page.getByRole('slider', { name: 'Time since the start' });
  await page.getByRole('button', { name: 'Play', exact: true }).click();
  await until('an advanced time', async () => Number(await slider.inputValue()) > 2);
  await page.getByLabel(/^Overlay/).selectOption({ index: 1 });
  await until('two missions', async () => (await page.locator('.played tbody tr').count()) === 2);
  await slider.focus();
  await page.keyboard.press('End');
  await page.getByRole('button', { name: 'Play', exact: true }).waitFor();
  await page.getByRole('button', { name: 'Live robots' }).click();
  await page.locator('.map-columns').waitFor();
});

const views = {
  fleet: '#/fleet',
  robot: `#/robots/${robot}`,
  missions: '#/missions',
  mission: `#/missions/${mission.id}`,
  hour: `#/missions/${hour.id}`,
  plan: `#/plan?robot=${robot}`,
  gap: '#/gap',
  diagnosis: `#/gap/${diagnosis}`,
  outside: `#/gap/${outside}`,
  worn: '#/robots/worn-01',
  robot_file: `#/robot-file/${robot}`,
  map: '#/map?place=["hall","1"]',
  played: `#/map?place=["hall","1"]&mission=${mission.id}`,
  trends: '#/trends?by=day&from=2020-01-01',
  compare: '#/trends?robot=worn-01,oval-01&from=2020-01-01',
  floor: '#/floor?from=2020-01-01&cell=2',
  floor_gap: '#/floor?from=2020-01-01&cell=2&robot=worn-01&show=gap',
  cluster: '#/cluster',
  audit: '#/audit',
  help: '#/help',
};
// One size and theme after another, two at a time.
const openings = Object.entries(themes).flatMap(([size, schemes]) => schemes.map((scheme) => [size, scheme]));
async function openEachView() {
  for (let next = openings.shift(); next; next = openings.shift()) {
    const [size, colorScheme] = next;
    const shown = await openPage({ viewport: sizes[size], colorScheme });
    await shown.route('**/v1/cluster', (route) => route.fulfill({ json: inCluster() }));
    for (const [name, hash] of Object.entries(views)) {
      await check(`${name}, ${size}, ${colorScheme}: accessible and within the window`, async () => {
        await go(shown, hash);
        await shown
          .locator(
            'main .readouts, main .floor-box, main .plan-result, main .jobs, main .events, main .glossary, main .trends, main .compare',
          )
          .first()
          .waitFor();
        await settled(shown);
        if (['fleet', 'robot', 'worn'].includes(name)) await shown.waitForTimeout(400); // reasons for attention
        if (name === 'mission' || name === 'hour') {
          const box = await shown.locator('.uplot .u-over').first().boundingBox();
          await shown.mouse.move(box.x + box.width * 0.4, box.y + 30);
          await shown.waitForTimeout(150);
        }
        await shown.screenshot({
          path: path.join(given.out, 'screenshots', `${name}-${size}-${colorScheme}.png`),
          fullPage: true,
        });
        const wide = await shown.evaluate(() => document.documentElement.scrollWidth - innerWidth);
        expect(wide <= 0, `${wide} px wider than the window`);
        await shown.evaluate(axe);
        const result = await shown.evaluate(() =>
          globalThis.axe.run(document, { resultTypes: ['violations'] }),
        );
        const serious = result.violations.filter((v) => ['serious', 'critical'].includes(v.impact));
        const places = (v) =>
          v.nodes
            .slice(0, 3)
            .map((n) => n.target.join(' '))
            .join(', ');
        equal(serious.map((v) => `${v.id}: ${places(v)}`).join('; '), '', 'axe');
      });
    }
    await close(shown);
  }
}
await Promise.all([openEachView(), openEachView()]);

await check('the chosen theme is kept', async () => {
  await go(page, '#/fleet');
  await page.getByRole('button', { name: 'Dark theme' }).click();
  equal(await page.evaluate(() => document.documentElement.style.colorScheme), 'dark', 'theme');
  await page.reload();
  equal(
    await page.evaluate(() => document.documentElement.style.colorScheme),
    'dark',
    'theme after a reload',
  );
});

await check('a mission of one hour at 50 Hz opens about as fast as a short one', async () => {
  expect(hour.samples > 150_000, `${hour.samples} samples`);
  figures.short_mission_ms = await openingsMs(`${base}/#/missions/${mission.id}`, missionIsShown);
  figures.one_hour_samples = hour.samples;
  const hourUrl = `${base}/#/missions/${hour.id}`;
  await opensLike('one_hour_mission', hourUrl, missionIsShown, figures.short_mission_ms);
});

figures.small_fleet_ms = await openingsMs(`${base}/#/fleet`, fleetIsShown);
figures.few_missions_ms = await openingsMs(`${base}/#/missions`, missionsAreShown);
await check('a lost service is reported and recovered', async () => {
  await go(page, '#/fleet');
  await page.locator('.fleet tbody th a').first().waitFor();
  faultsWanted = true;
  await stop(daemon);
  await page.getByText('No connection to the service since').waitFor();
  await page.screenshot({ path: path.join(given.out, 'screenshots', 'offline-laptop.png') });
  daemon = await startUntil(given.daemon, daemonArgs, ready);
  await until(
    'the banner to go',
    async () => (await page.getByText('No connection to the service since').count()) === 0,
    40,
  );
  faultsWanted = false;
});

await close(page);
await stop(fleet);
await stop(daemon);

const many = await serveManyRobots(given.page, 500);
await check('500 live robots open about as fast as a few', async () => {
  await opensLike('first_view_500_robots', many.url, fleetOf500IsShown, figures.small_fleet_ms);
});

await check('500 live robots keep the page responsive', async () => {
  const busy = await openPage();
  await busy.goto(many.url);
  await busy.locator('.fleet tbody th a').first().waitFor();
  await busy.getByText('charging, 1 h 04 min').first().waitFor();
  const rows = await busy.locator('.fleet tbody tr').count();
  expect(rows < 60, `${rows} rows drawn`);
  const session = await busy.context().newCDPSession(busy);
  await session.send('Performance.enable', { timeDomain: 'threadTicks' }); // processor time excludes other programs
  const used = async () =>
    Object.fromEntries((await session.send('Performance.getMetrics')).metrics.map((m) => [m.name, m.value]));
  await busy.waitForTimeout(1500);
  const before = await used();
  await busy.evaluate(() => {
    globalThis.longMs = 0;
    new PerformanceObserver((list) =>
      list.getEntries().forEach((e) => (globalThis.longMs = Math.max(globalThis.longMs, e.duration))),
    ).observe({ type: 'longtask' });
  });
  await busy.waitForTimeout(6000);
  const after = await used();
  const wallS = after.Timestamp - before.Timestamp;
  figures.main_thread_share_500_robots = Number(
    ((after.TaskDuration - before.TaskDuration) / wallS).toFixed(3),
  );
  figures.longest_task_500_robots_ms = Math.round(await busy.evaluate(() => globalThis.longMs));
  figures.heap_500_robots_mb = Number((after.JSHeapUsedSize / 1e6).toFixed(1));
  await busy.evaluate(() => scrollTo(0, 12_000));
  await until(
    'rows further down',
    async () =>
      (await busy.locator('.fleet tbody tr[aria-rowindex]').first().getAttribute('aria-rowindex')) > 100,
  );
  await busy.screenshot({ path: path.join(given.out, 'screenshots', 'fleet-500-laptop.png') });
  await close(busy);
  expect(
    figures.main_thread_share_500_robots < 0.5,
    `main thread busy ${figures.main_thread_share_500_robots}`,
  );
});
await many.close();

// The service with a history of 100,000 missions and 500 robots with one message per second each.
const plentyStore = path.join(given.out, 'plenty.db');
const plentyMissions = 100_000;
const plentyArgs = daemonArgs.map((value) => (value === store ? plentyStore : value));
daemon = await startUntil(given.daemon, plentyArgs, ready);
const plenty = await startUntil(
  given.client,
  [
    'simulate',
    '--robots',
    '500',
    '--rate',
    '1',
    '--seed',
    '5',
    '--mission-duration',
    '20',
    '--server',
    base,
    '--lcm-url',
    lcmUrl,
    '--quiet',
  ],
  async () => (await get('/v1/robots')).robots.filter((one) => one.live).length === 500,
  90,
);
await until(
  'missions to copy',
  async () => (await get('/v1/missions?state=finished&limit=1')).missions.length > 0,
  90,
);
await stop(daemon);
await run('python3', [
  path.join(import.meta.dirname, 'many_missions.py'),
  plentyStore,
  String(plentyMissions),
]);
daemon = await startUntil(given.daemon, plentyArgs, ready);
await until(
  '500 live robots',
  async () => (await get('/v1/robots')).robots.filter((one) => one.live).length === 500,
  60,
);

await check('500 robots and 100,000 missions open about as fast', async () => {
  const { small_fleet_ms, few_missions_ms } = figures;
  const history = `${base}/#/missions`;
  const historyIsSummed = () => /of 10\d.\d{3}/.test(document.body.textContent);
  await opensLike('service_500_robots', `${base}/#/fleet`, fleetOf500IsShown, small_fleet_ms);
  await opensLike('service_100000_missions', history, fiftyMissionsAreShown, few_missions_ms);
  figures.service_100000_missions_summed_ms = await openingsMs(history, historyIsSummed);
});

await check('500 live robots stay live on the page', async () => {
  const watched = await openPage();
  await watched.goto(`${base}/#/fleet`);
  await watched.locator('.fleet tbody th a').first().waitFor();
  const first = watched.locator('.fleet tbody tr').first().locator('td.power .number');
  const powers = new Set();
  await until(
    'four powers of the first robot',
    async () => powers.add(await first.textContent()).size >= 4,
    60,
  );
  equal(await watched.locator('.link').textContent(), 'Live', 'the link');
  const { missions } = await get('/v1/missions?state=finished&limit=1');
  expect(
    (await get('/v1/mission-totals')).missions >= plentyMissions && missions.length === 1,
    'missions in the history',
  );
  await watched.screenshot({ path: path.join(given.out, 'screenshots', 'fleet-500-service-laptop.png') });
  await watched.goto(`${base}/#/missions`);
  await watched.getByRole('button', { name: 'Load more' }).click();
  await watched.getByText('100 of').waitFor();
  await watched.screenshot({ path: path.join(given.out, 'screenshots', 'missions-100000-laptop.png') });
  await close(watched);
});
await stop(plenty);
await stop(daemon);
await rm(plentyStore, { force: true });
await browser.close();

await check('the first load is small; other views follow', async () => {
  const packed = async (names) => {
    const files = names.map((name) => readFile(path.join(given.page, name)));
    return (await Promise.all(files)).reduce((sum, bytes) => sum + gzipSync(bytes, { level: 9 }).length, 0);
  };
  const first = await packed(['index.html', 'app.js', 'base.js', 'app.css', 'favicon.svg']);
  figures.first_load_gzipped_bytes = first;
  figures.other_views_gzipped_bytes = await packed(['views.js', 'views.css']);
  figures.charts_gzipped_bytes = await packed(['uplot.js']);
  expect(first < firstLoadLimitBytes, `${first} bytes`);
});
await check('the console has no errors', async () => equal([...new Set(faults)].join('\n'), '', 'console'));

await rm(store, { force: true });
await writeFile(path.join(given.out, 'figures.json'), `${JSON.stringify(figures, null, 2)}\n`);
console.log(JSON.stringify(figures, null, 2));
for (const report of failures) console.log(report);
console.log(
  `${passed} passed, ${failures.length} failed; screenshots in ${path.join(given.out, 'screenshots')}`,
);
process.exit(failures.length === 0 ? 0 : 1);
