// Bundles source/ into the files that joulecastd embeds. With --check: fails when they are not what the
// sources give.
import { build } from 'esbuild-wasm';
import { readFile, writeFile } from 'node:fs/promises';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';
import path from 'node:path';

const here = path.dirname(fileURLToPath(import.meta.url));
const firstLoad = ['index.html', 'app.js', 'base.js', 'app.css', 'favicon.svg'];
const limits = {
  'first load': [firstLoad, 26_000],
  'other views': [['views.js', 'views.css'], 65_000],
  report: [['report.template'], 60_000],
  charts: [['uplot.js'], 24_000],
};

// The sections of help.md: a list of terms, [term, address of its view, words], or a paragraph.
const oneLine = (lines) => lines.replaceAll(/\s+/g, ' ').trim();
const term = /^- \[?\*\*(.+?)\*\*(?:\]\((.+?)\))?: (.+(?:\n {2}.+)*)$/gm;
function sectionOf(section) {
  const [title, lines] = section.split(/\n(.*)/s);
  const terms = [...lines.matchAll(term)].map(([, name, to, words]) => [name, to, oneLine(words)]);
  return { title, terms, text: terms.length === 0 ? oneLine(lines) : '' };
}
async function readHelp({ path: file }) {
  const text = await readFile(file, 'utf8');
  return { contents: JSON.stringify(text.split(/^#+ /m).slice(1).map(sectionOf)), loader: 'json' };
}
const help = { name: 'help', setup: (b) => b.onLoad({ filter: /help\.md$/ }, readHelp) };

const options = {
  absWorkingDir: here,
  entryPoints: [
    { in: 'source/main.jsx', out: 'app' },
    { in: 'source/views/index.js', out: 'views' },
    // Not by an import of index.js, which would put it into app.css, too.
    { in: 'source/views/views.css', out: 'views' },
    { in: 'uplot', out: 'uplot' },
  ],
  splitting: true,
  chunkNames: 'base', // one file of the modules that the first load and the views share
  outdir: here,
  bundle: true,
  minify: true,
  format: 'esm',
  target: ['es2022'],
  charset: 'utf8',
  jsx: 'automatic',
  jsxImportSource: 'preact',
  plugins: [help],
  banner: { js: '/* joulecast operator page, built from source/; licences: third_party.txt */' },
  legalComments: 'none',
  write: false,
};

async function thirdParty() {
  const parts = [];
  for (const name of ['preact', 'uplot']) {
    const folder = path.join(here, 'node_modules', name);
    const { version } = JSON.parse(await readFile(path.join(folder, 'package.json'), 'utf8'));
    const text = (await readFile(path.join(folder, 'LICENSE'), 'utf8')).replaceAll('\r\n', '\n').trim();
    parts.push(`${name} ${version}\n${'='.repeat(name.length + 1 + version.length)}\n${text}\n`);
  }
  return parts.join('\n');
}

// The page of reports: one file, in which the writer replaces @DATA@ by a diagnosis.
async function reportTemplate() {
  const { outputFiles } = await build({
    ...options,
    entryPoints: ['source/report.jsx'],
    splitting: false,
    format: 'iife',
    banner: { js: `/*!\n${await thirdParty()}*/` },
  });
  const textOf = (end) => outputFiles.find((file) => file.path.endsWith(end)).text;
  const page = await readFile(path.join(here, 'source/report.html'), 'utf8');
  return page
    .replace('@STYLE@', () => textOf('.css'))
    .replace('@SCRIPT@', () => textOf('.js').replaceAll('</script', '<\\/script'));
}

async function products() {
  const { outputFiles } = await build(options);
  const files = new Map(outputFiles.map((file) => [path.basename(file.path), Buffer.from(file.contents)]));
  for (const name of ['index.html', 'favicon.svg']) files.set(name, await readFile(path.join(here, name)));
  files.set('third_party.txt', Buffer.from(await thirdParty()));
  files.set('report.template', Buffer.from(await reportTemplate()));
  return files;
}

async function put(files) {
  const packed = new Map([...files].map(([name, bytes]) => [name, gzipSync(bytes, { level: 9 }).length]));
  for (const [name, bytes] of files) {
    await writeFile(path.join(here, name), bytes);
    console.log(
      `${name.padEnd(15)} ${String(bytes.length).padStart(7)} B  ${String(packed.get(name)).padStart(6)} B gzipped`,
    );
  }
  for (const [what, [names, limit]] of Object.entries(limits)) {
    const total = names.reduce((sum, name) => sum + packed.get(name), 0);
    console.log(
      `${what.padEnd(15)} ${''.padStart(7)}    ${String(total).padStart(6)} B gzipped (limit ${limit})`,
    );
    if (total > limit) throw new Error(`${what}: larger than its limit`);
  }
}

if (process.argv[2] === '--check') {
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
} else {
  await put(await products());
}
