// Bundles the converter into ../bags.cjs, which `joulecast import` runs.
import { build } from 'esbuild';
import { readdir, readFile } from 'node:fs/promises';
import path from 'node:path';
import { fileURLToPath } from 'node:url';

const here = path.dirname(fileURLToPath(import.meta.url));

// The decompressors load their WebAssembly from their own folder; in the bundle it is passed to them.
const wasmInside = {
  name: 'wasm-inside',
  setup({ onLoad }) {
    onLoad({ filter: /@foxglove.wasm-\w+.(dist.wasm-\w+|wasm.module)\.js$/ }, async ({ path: file }) => {
      const text = await readFile(file, 'utf8');
      const given = `Module = Module || {wasmBinary: require("./${path.basename(file, '.js')}.wasm")};`;
      return { contents: text.replace('Module = Module || {};', () => given) };
    });
  },
};

const options = {
  absWorkingDir: here,
  entryPoints: ['main.mjs'],
  plugins: [wasmInside],
  loader: { '.wasm': 'binary' },
  bundle: true,
  minify: true,
  metafile: true,
  platform: 'node',
  target: ['node18'],
  supported: { 'template-literal': false }, // their line breaks
  legalComments: 'none',
  outfile: '../bags.cjs',
};

// Name, version and licence of every package inside, which `node bags.cjs --licences` prints.
async function licences(inputs) {
  const folders = new Set(
    Object.keys(inputs).map((file) => /^.*node_modules\/(@[^/]+\/)?[^/]+/.exec(file)?.[0]),
  );
  const texts = [];
  for (const folder of [...folders].filter(Boolean).sort()) {
    const { name, version, license } = JSON.parse(
      await readFile(path.join(here, folder, 'package.json'), 'utf8'),
    );
    const file = (await readdir(path.join(here, folder))).find((each) => /^licen[cs]e/i.test(each));
    const text = file ? await readFile(path.join(here, folder, file), 'utf8') : license;
    const title = `${name} ${version}`;
    texts.push(`${title}\n${'='.repeat(title.length)}\n${text.replaceAll('\r\n', '\n').trim()}\n`);
  }
  return texts.join('\n');
}

const { metafile } = await build({ ...options, define: { LICENCES: "''" }, write: false });
await build({ ...options, define: { LICENCES: JSON.stringify(await licences(metafile.inputs)) } });
