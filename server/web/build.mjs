// Bundles source/ into the files that joulecastd embeds. With --check: fails when they are not what the
// sources give. With --watch: bundles again on every change.
import { build, context } from 'esbuild';
import { readFile, writeFile } from 'node:fs/promises';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';
import path from 'node:path';
import { minify } from 'terser';
import { lean_uplot } from './lean_uplot.mjs';

const here = path.dirname(fileURLToPath(import.meta.url));
const limit_bytes = 60_000;  // gzipped, what the first view needs
const later = ['gap.js', 'gap-style.css'];  // asked for with the views that need them

// htm drops the white space around line ends; what is left out here need not be sent.
const lean_templates = {
  name: 'lean-templates',
  setup: (b) => b.onLoad({ filter: /source\/.*\.js$/ }, async ({ path: file }) =>
    ({ contents: (await readFile(file, 'utf8')).replace(/\n\s+/g, '\n'), loader: 'js' })),
};

const banner = '/* joulecast operator page, built from source/; licences: third_party.txt */';

const options = {
  absWorkingDir: here,
  entryPoints: { app: 'source/main.js', gap: 'source/views/gap.js', 'gap-style': 'source/gap.css' },
  splitting: true,
  chunkNames: 'base',
  outdir: here,
  bundle: true,
  minify: true,
  format: 'esm',
  target: ['es2022'],
  charset: 'utf8',
  plugins: [lean_templates, lean_uplot],
  legalComments: 'none',
  write: false,
};

async function third_party() {
  const parts = [];
  for (const name of ['htm', 'preact', 'uplot']) {
    const folder = path.join(here, 'node_modules', name);
    const { version } = JSON.parse(await readFile(path.join(folder, 'package.json'), 'utf8'));
    const text = (await readFile(path.join(folder, 'LICENSE'), 'utf8')).replaceAll('\r\n', '\n').trim();
    parts.push(`${name} ${version}\n${'='.repeat(name.length + 1 + version.length)}\n${text}\n`);
  }
  return parts.join('\n');
}

async function products() {
  const { outputFiles } = await build(options);
  const files = new Map(outputFiles.map((file) => [path.basename(file.path), Buffer.from(file.contents)]));
  files.delete('gap.css');  // what app.css holds already
  // A second minifier takes another twentieth off what esbuild leaves.
  for (const [name, bytes] of files) {
    if (!name.endsWith('.js')) continue;
    const script = await minify(bytes.toString(), { module: true, compress: { passes: 3 }, mangle: true });
    files.set(name, Buffer.from(`${banner}\n${script.code}\n`));
  }
  for (const name of ['index.html', 'favicon.svg']) files.set(name, await readFile(path.join(here, 'source', name)));
  files.set('third_party.txt', Buffer.from(await third_party()));
  return files;
}

async function put(files) {
  let total = 0;
  for (const [name, bytes] of files) {
    await writeFile(path.join(here, name), bytes);
    if (name === 'third_party.txt') continue;
    const packed = gzipSync(bytes, { level: 9 }).length;
    const first = !later.includes(name);
    if (first) total += packed;
    console.log(`${name.padEnd(14)} ${String(bytes.length).padStart(7)} B  ${String(packed).padStart(6)} B gzipped${first ? '' : ', later'}`);
  }
  console.log(`first view     ${''.padStart(7)}    ${String(total).padStart(6)} B gzipped (limit ${limit_bytes})`);
  if (total > limit_bytes) throw new Error('the page is larger than its limit');
}

const mode = process.argv[2];
if (mode === '--check') {
  const stale = [];
  for (const [name, bytes] of await products()) {
    const present = await readFile(path.join(here, name)).catch(() => Buffer.alloc(0));
    if (!present.equals(bytes)) stale.push(name);
  }
  if (stale.length > 0) {
    console.error(`not what the sources give: ${stale.join(', ')}; run \`npm run build\` in server/web`);
    process.exit(1);
  }
  console.log('the built page is what the sources give');
} else if (mode === '--watch') {
  const rebuild = { name: 'put', setup: (b) => b.onEnd(async () => put(await products())) };
  await (await context({ ...options, plugins: [...options.plugins, rebuild] })).watch();
} else {
  await put(await products());
}
