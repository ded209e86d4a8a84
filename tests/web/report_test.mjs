// Reports of diagnoses as files in headless Chromium, without a server.
// node report_test.mjs --client joulecast --source DIRECTORY --out DIRECTORY [--chromium /usr/bin/chromium]
import assert from 'node:assert/strict';
import { mkdir, readFile, rm, writeFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import path from 'node:path';
import { parseArgs } from 'node:util';
import { chromium } from 'playwright-core';
import { run } from './daemon.mjs';

const { values: given } = parseArgs({
  options: {
    client: { type: 'string' },
    source: { type: 'string' },
    out: { type: 'string' },
    chromium: { type: 'string', default: '/usr/bin/chromium' },
  },
});
const axe = await readFile(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
await rm(given.out, { recursive: true, force: true });
await mkdir(given.out, { recursive: true });
const file = (name) => path.resolve(given.out, name);
const robot = path.join(given.source, 'deploy/robots/amr.json');
const begin = '<script type="application/json" id="data">';

async function dataOf(name) {
  const html = await readFile(file(name), 'utf8');
  return JSON.parse(html.slice(html.indexOf(begin) + begin.length).split('</script>')[0]);
}

// The same report with other data.
async function withData(name, from, data) {
  const [head, rest] = (await readFile(file(from), 'utf8')).split(begin);
  const end = rest.slice(rest.indexOf('</script>'));
  await writeFile(file(name), head + begin + JSON.stringify(data).replaceAll('<', '\\u003c') + end);
}

const browser = await chromium.launch({ executablePath: given.chromium, args: ['--no-sandbox'] });
async function open(name, size = { width: 1440, height: 900 }, theme = 'light') {
  const page = await browser.newPage({ viewport: size, colorScheme: theme });
  page.on('console', (message) => assert.notEqual(message.type(), 'error', message.text()));
  page.on('pageerror', (error) => assert.fail(error));
  page.on('request', (request) => assert.equal(request.url(), `file://${file(name)}`));
  await page.goto(`file://${file(name)}`);
  await page.locator('h1').waitFor();
  return page;
}

// Numbers of a text with the place of the last digit.
function numbersIn(text) {
  const found = text.replaceAll('−', '-').matchAll(/(?<![\w.^])-?\d+(?:\u2009\d{3})*(?:\.\d+)?/g);
  return [...found].map(([number]) => {
    const plain = number.replaceAll('\u2009', '');
    return { value: Number(plain), place: 10 ** -(plain.split('.')[1]?.length ?? 0) };
  });
}

function known(data) {
  if (typeof data === 'number') return [data];
  if (typeof data === 'string') return numbersIn(data).map((n) => n.value);
  return data === null ? [] : Object.values(data).flatMap(known);
}

// Numbers on the page that are not in its data: directly, in percent or in degrees.
async function foreign(page, data) {
  const texts = await page.evaluate(() => {
    const walker = document.createTreeWalker(document.querySelector('main'), NodeFilter.SHOW_TEXT);
    const found = [];
    while (walker.nextNode()) {
      const { parentElement, data: text } = walker.currentNode;
      if (!parentElement.closest('[data-title="Started"], [data-title="Duration"]')) found.push(text);
    }
    return found;
  });
  const { figures, ...printed } = data.result; // charts are not text
  const all = [
    ...known(printed),
    ...known(figures.missions),
    ...known(data.robot),
    ...known(data.origin),
    95,
    97,
  ];
  const near = (n, v) => Math.abs(Math.abs(v) - Math.abs(n.value)) <= 0.5000001 * n.place;
  const factors = [1, 100, 180 / Math.PI];
  return numbersIn(texts.join(' ')).filter(
    (n) => !all.some((v) => factors.some((f) => near(n, f * v) || near(n, 100 * Math.tan(v)))),
  );
}

try {
  await run(given.client, [
    ...['simulate', '--robot', robot, '--robots', '1', '--seed', '7', '--missions', '6', '--speed', '0'],
    ...[
      '--effect',
      'slope=0.016',
      '--effect',
      'coulomb_friction=0.4',
      '--quiet',
      '--log',
      file('amr.lcmlog'),
    ],
  ]);
  await run(given.client, ['gap', file('amr.lcmlog'), '--robot', robot, '--report', file('gap.html')]);
  const data = await dataOf('gap.html');
  const { result } = data;
  const page = await open('gap.html');

  // The whole diagnosis is on the page.
  assert.equal(await page.locator('h1').innerText(), "Why robot amr's power differs from its model");
  assert.ok(result.effects.length > 0 && result.figures.maps.length > 3);
  const effects = await page.locator('table.effects').first().locator('tbody th').allInnerTexts();
  assert.deepEqual(
    effects.map((text) => text.split('\n')[0].trim()),
    result.effects.map((e) => e.id.replaceAll('_', ' ')),
  );
  const main = await page.locator('main').innerText();
  for (const text of [...result.reasons, ...result.checks.map((c) => c.says), ...data.origin.sources])
    assert.ok(main.includes(text), text);
  for (const [name, c] of Object.entries(result.baseline.terms))
    for (const text of [name, c.unit])
      assert.ok(main.includes(text.replace(/\^([23])/g, (_, power) => '²³'[power - 2])), text);
  assert.equal(await page.locator('.uplot').count(), result.figures.maps.length + 1, 'charts');
  assert.equal(await page.locator('canvas.floor').count(), 1, 'the floor');
  assert.equal(await page.locator('.legend .colours').count(), 1, 'its scale');
  assert.equal(
    await page.locator('[data-title="Payload, kg"]').count(),
    result.figures.missions.mission_id.length,
  );

  // Its numbers are those of the diagnosis.
  assert.deepEqual(await foreign(page, data), []);
  const other = structuredClone(data);
  other.result.baseline.held_out = 0.6873;
  Object.values(other.result.effects[0].parameters)[0].value *= 1.07;
  assert.notDeepEqual(await foreign(page, other), [], 'numbers are compared');

  // It can be read on a phone, in the dark and with a screen reader.
  const phone = await open('gap.html', { width: 390, height: 844 }, 'dark');
  assert.ok((await phone.evaluate(() => document.documentElement.scrollWidth)) <= 390, 'scrolls sideways');
  for (const one of [page, phone]) {
    await one.evaluate(axe);
    const { violations } = await one.evaluate(() => globalThis.axe.run());
    assert.deepEqual(
      violations.map((v) => v.id),
      [],
    );
  }
  await page.screenshot({ path: file('gap-laptop.png'), fullPage: true });
  await phone.screenshot({ path: file('gap-phone.png'), fullPage: true });

  // Texts of recordings are text.
  const bad = structuredClone(data);
  bad.result.robot_id = bad.origin.sources[0] = bad.result.reasons[0] = '<img src=x onerror=alert(1)>';
  await withData('bad.html', 'gap.html', bad);
  const badPage = await open('bad.html');
  assert.equal(await badPage.locator('main img').count(), 0);
  assert.ok((await badPage.locator('main').innerText()).includes('<img src=x onerror=alert(1)>'));

  // A comparison of groups has its own tables.
  const compared = structuredClone(data);
  const group = { missions: 3, samples: 100, way_m: 51.5, energy_per_m_j: 61.25, model_per_m_j: 58.5 };
  Object.assign(compared.result, {
    kind: 'comparison',
    groups: ['dry', 'wet'].map((name) => ({ name, ...group })),
    strengths: [
      {
        id: 'turning_scrub',
        parameter: 'coefficient',
        unit: '1',
        groups: {
          dry: { value: 0, sd: 0, energy_per_m_j: 0 },
          wet: { value: 0.24, sd: 0.02, energy_per_m_j: 15 },
        },
      },
    ],
    difference: {
      ...{ from: 'dry', to: 'wet', energy_per_m_j: 16.5, by_motion_j: 1.25 },
      ...{ by_effect_j: { turning_scrub: 14.75 }, unexplained_j: 0.5 },
    },
    limits: ['The groups drove different ways.'],
  });
  delete compared.result.figures;
  await withData('compared.html', 'gap.html', compared);
  const comparison = await (await open('compared.html')).locator('main').innerText();
  for (const text of [
    'between groups',
    'wet above dry',
    '+14.8',
    '0.240 ± 0.020',
    '61.3',
    'drove different ways',
  ])
    assert.ok(comparison.includes(text), text);

  // So has a diagnosis from a table of runs.
  const table = file('runs.csv');
  const rows = [
    'run,table,distance_m,speed_m_s,acceleration_m_s2,payload_kg,right_j,left_j',
    'slow,empty,10,0.5,0.125,0,53.67,56.25',
    'medium,empty,10,0.7,0.175,0,56.33,60.26',
    'fast,empty,10,0.9,0.225,0,56.78,60.76',
    'slow,loaded,10,0.5,0.125,8.25,64.81,67.56',
    'medium,loaded,10,0.7,0.175,8.25,66.38,70.40',
    'fast,loaded,10,0.9,0.225,8.25,66.62,70.90',
  ];
  await writeFile(table, `${rows.join('\n')}\n`);
  const nomad = path.join(given.source, 'deploy/robots/nomad.json');
  await run(given.client, ['gap', '--missions', table, '--robot', nomad, '--report', file('runs.html')]);
  const runs = await dataOf('runs.html');
  const runPage = await open('runs.html');
  assert.equal(await runPage.locator('[data-title="Measured, J"]').count(), runs.result.runs.length);
  const runText = await runPage.locator('main').innerText();
  for (const limit of runs.result.limits) assert.ok(runText.includes(limit), limit);
} finally {
  await browser.close();
}
