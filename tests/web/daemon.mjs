// The programs under test as children of this process.
import { spawn } from 'node:child_process';
import { once } from 'node:events';
import { createServer } from 'node:net';

const children = new Set();
process.on('exit', () => children.forEach((child) => child.kill('SIGKILL')));

export async function freePort() {
  const server = createServer().listen(0, '127.0.0.1');
  await once(server, 'listening');
  const { port } = server.address();
  server.close();
  await once(server, 'close');
  return port;
}

function start(program, args) {
  const child = spawn(program, args, { stdio: ['ignore', 'pipe', 'pipe'] });
  child.output = '';
  for (const stream of [child.stdout, child.stderr]) stream.on('data', (text) => (child.output += text));
  children.add(child);
  child.on('exit', () => children.delete(child));
  return child;
}

export async function run(program, args) {
  const child = start(program, args);
  const [code] = await once(child, 'exit');
  if (code !== 0) throw new Error(`${program} ${args.join(' ')} exited with ${code}: ${child.output}`);
  return child.output;
}

// Starts a program and waits until `ready(child)` is true.
export async function startUntil(program, args, ready, seconds = 20) {
  const child = start(program, args);
  const end = Date.now() + seconds * 1000;
  while (!(await ready(child))) {
    if (child.exitCode !== null || Date.now() > end)
      throw new Error(`${program} did not become ready: ${child.output}`);
    await new Promise((wait) => setTimeout(wait, 50));
  }
  return child;
}

export async function stop(child) {
  if (child.exitCode !== null) return;
  child.kill('SIGTERM');
  await once(child, 'exit');
}
