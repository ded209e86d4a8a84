// The page of a daemon with tokens in headless Chromium: it requests a token, hides it from scripts and works
// after signing in.
// node sign_in_test.mjs --daemon joulecastd --client joulecast --robot amr.json --out directory
//   [--chromium /usr/bin/chromium] [--page server/web, instead of the page built in]
import assert from 'node:assert/strict';
import { mkdir, readFile, rm } from 'node:fs/promises';
import path from 'node:path';
import { parseArgs } from 'node:util';
import { chromium } from 'playwright-core';
import { freePort, run, startUntil, stop } from './daemon.mjs';

const { values: given } = parseArgs({
  options: {
    daemon: { type: 'string' },
    client: { type: 'string' },
    robot: { type: 'string' },
    out: { type: 'string' },
    page: { type: 'string', default: '' },
    chromium: { type: 'string', default: '/usr/bin/chromium' },
  },
});
await rm(given.out, { recursive: true, force: true });
await mkdir(given.out, { recursive: true });
const model = JSON.parse(await readFile(given.robot, 'utf8'));
const tokens = path.join(given.out, 'tokens.json');
const makeToken = async (name, role) => {
  const made = await run(given.client, ['token', 'create', '--file', tokens, '--name', name, '--role', role]);
  return /jc_[0-9a-f]{64}/.exec(made)[0];
};
const token = await makeToken('carol', 'read');
const adminToken = await makeToken('root', 'admin');
const base = `http://127.0.0.1:${await freePort()}`;
const options = { '--http-port': new URL(base).port, '--store-path': path.join(given.out, 'history.db') };
Object.assign(options, { '--lcm-url': 'memq://', '--auth-token-file': tokens });
if (given.page !== '') options['--http-web-directory'] = given.page;
const answers = async () => (await fetch(`${base}/healthz`).catch(() => ({ ok: false }))).ok;
const daemon = await startUntil(given.daemon, Object.entries(options).flat(), answers);
const browser = await chromium.launch({ executablePath: given.chromium, args: ['--no-sandbox'] });
try {
  const page = await browser.newPage();
  await page.goto(base);
  const dialog = page.locator('dialog.sign-in');
  // The page reloads after signing in; a view opened before would be lost.
  const signIn = async (secret) => {
    await dialog.locator('input').fill(secret);
    await Promise.all([page.waitForEvent('load'), dialog.locator('button[type=submit]').click()]);
  };
  await dialog.waitFor({ state: 'visible' });
  await page.getByText('Sign in to see the fleet.').waitFor();
  await page.waitForTimeout(2000); // by then the page would report a lost service
  assert.equal(await page.locator('.link').textContent(), 'Signed out');
  assert.equal(await page.getByText(/No connection|Authorization|Bearer/).count(), 0);
  await dialog.locator('button', { hasText: 'Cancel' }).click();
  await page.goto(`${base}/#/help`);
  await page.goto(`${base}/#/audit`);
  await page.getByText('Sign in to see the fleet.').waitFor(); // another request was refused
  assert.equal(await dialog.isVisible(), false, 'the dialog stays closed');
  await page.getByRole('button', { name: 'Sign in', exact: true }).click();
  await dialog.locator('input').fill('jc_wrong');
  await dialog.locator('button[type=submit]').click();
  await page.waitForFunction(() => /unknown, expired or revoked/.test(document.body.innerText));
  await signIn(token);
  await page.waitForFunction(() => document.querySelector('.link.live') !== null);
  assert.equal(await dialog.isVisible(), false);
  assert.equal(await page.evaluate(() => document.cookie), '', 'the session is visible to scripts');
  const [cookie] = await page.context().cookies();
  assert.deepEqual([cookie.httpOnly, cookie.sameSite, cookie.value.includes(token)], [true, 'Strict', false]);
  const statusOf = (method, at) =>
    page.evaluate(([m, a]) => fetch(a, { method: m }).then((r) => r.status), [method, at]);
  assert.equal(await statusOf('GET', '/v1/robots'), 200);
  assert.equal(await statusOf('PUT', '/v1/robots/amr'), 403);
  await page.goto(`${base}/#/audit?of=requests`);
  await page.getByText('needs a token of role admin').waitFor();
  // Two versions of a model; a user with role read cannot activate the other one.
  for (const idle of [20, 21]) {
    const { status } = await fetch(`${base}/v1/robots/amr`, {
      method: 'PUT',
      headers: { authorization: `Bearer ${adminToken}`, 'content-type': 'application/json' },
      body: JSON.stringify({ ...model, robot_id: 'amr', idle_power_w: idle }),
    });
    assert.equal(status, 200);
  }
  await page.goto(`${base}/#/robots/amr`);
  const activate = page.getByRole('button', { name: 'Put version 1 in force again' });
  await activate.waitFor();
  assert.equal(await activate.isDisabled(), true);
  assert.match(await activate.getAttribute('title'), /token of role operate; yours has the role read/);
  await page.goto(`${base}/#/robot-file/amr`);
  await page.getByText('This needs a token of role admin; yours has the role read.').first().waitFor();
  for (const name of ['Save', 'Remove this robot', 'Set map and level'])
    assert.equal(await page.getByRole('button', { name, exact: true }).isDisabled(), true, name);
  await page.goto(`${base}/#/audit?of=requests`);
  await run(given.client, ['token', 'revoke', '--file', tokens, '--name', 'carol']);
  assert.equal(await statusOf('GET', '/v1/robots'), 401);
  await page.reload();
  await dialog.waitFor({ state: 'visible' });
  await signIn(adminToken);
  await page.goto(`${base}/#/robots/amr`);
  await activate.waitFor();
  assert.equal(await activate.isDisabled(), false);
  await page.goto(`${base}/#/audit?of=requests`);
  await page.getByRole('row', { name: /carol.*127\.0\.0\.1.*store the robot file: amr.*403/ }).waitFor();
  await page.screenshot({ path: path.join(given.out, 'requests.png') });
  await page.getByRole('button', { name: 'Robots and models' }).click();
  await page.getByText('No events yet').waitFor();
  console.log('the page signs in, signs out on revocation, and shows the audit log to an admin');
} finally {
  await browser.close();
  await stop(daemon);
}
