// Checks the OpenAPI document with a linter and a generated client:
// node openapi_test.mjs lint|client --document FILE [--daemon PROGRAM --robot FILE]
import { spawnSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import { freePort, startUntil, stop } from './daemon.mjs';

const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: { document: { type: 'string' }, daemon: { type: 'string' }, robot: { type: 'string' } },
});

function run(program, args) {
  const done = spawnSync(process.execPath, [join('node_modules', program), ...args], {
    encoding: 'utf8',
    env: { ...process.env, REDOCLY_TELEMETRY: 'off', REDOCLY_SUPPRESS_UPDATE_NOTICE: 'true' },
  });
  const output = done.stdout + done.stderr;
  if (done.status !== 0) throw new Error(`${program} exited with ${done.status}:\n${output}`);
  return done.stdout;
}

// All rules of the recommended set, without warnings.
function lint() {
  const found = JSON.parse(
    run('@redocly/cli/bin/cli.js', ['lint', '--extends', 'recommended', '--format', 'json', values.document]),
  );
  const { errors, warnings, ignored } = found.totals;
  for (const problem of found.problems) console.log(problem.severity, problem.ruleId, problem.message);
  console.log(`redocly recommended: ${errors} errors, ${warnings} warnings, ${ignored} ignored`);
  if (errors + warnings + ignored > 0) process.exitCode = 1;
}

async function client() {
  run('openapi-typescript/bin/cli.js', [values.document, '--output', 'openapi.ts']);
  run('typescript/bin/tsc', [
    '--strict',
    '--noUncheckedIndexedAccess',
    '--target',
    'es2022',
    '--module',
    'nodenext',
    '--lib',
    'es2022,dom',
    '--skipLibCheck',
    '--outDir',
    'compiled',
    'openapi_client.ts',
    'node_process.d.ts',
  ]);
  const folder = mkdtempSync(join(tmpdir(), 'joulecast-client-'));
  const port = await freePort();
  const daemon = await startUntil(
    values.daemon,
    ['--http-port', String(port), '--store-path', join(folder, 'history.db'), '--lcm-url', 'memq://'],
    (child) => child.output.includes('ready'),
  );
  try {
    const url = `http://127.0.0.1:${port}`;
    const done = spawnSync(
      process.execPath,
      ['compiled/openapi_client.js', url, readFileSync(values.robot, 'utf8')],
      {
        encoding: 'utf8',
      },
    );
    console.log(done.stdout + done.stderr);
    if (done.status !== 0) process.exitCode = 1;
  } finally {
    await stop(daemon);
    rmSync(folder, { recursive: true });
  }
}

await { lint, client }[positionals[0]]();
