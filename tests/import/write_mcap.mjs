// Writes MCAP with the format's own library: node write_mcap.mjs PACKAGES IN OUT, where PACKAGES is the
// folder with node_modules and IN is JSON {encoding, schemaEncoding, compression, messages}, messages of
// [time_ns, topic, type, definition, base64].
import { createRequire } from 'node:module';
import { open, readFile } from 'node:fs/promises';

const [packages, input, out] = process.argv.slice(2);
const require = createRequire(`${packages}/`);
const { McapWriter } = require('@mcap/core');
const zstd = require('@foxglove/wasm-zstd');
await zstd.isLoaded;
const { encoding, schemaEncoding, compression, messages } = JSON.parse(await readFile(input, 'utf8'));
const file = await open(out, 'w');
let at = 0n;
const writable = {
  position: () => at,
  async write(data) {
    await file.write(data);
    at += BigInt(data.length);
  },
};
const compressChunk = (data) => ({ compression, compressedData: zstd.compress(data) });
const writer = new McapWriter({
  writable,
  useChunks: true,
  chunkSize: 65536,
  compressChunk: compression ? compressChunk : undefined,
});
await writer.start({ profile: encoding === 'ros1' ? 'ros1' : 'ros2', library: 'test' });
const channels = new Map();
for (const [time, topic, name, definition, data] of messages) {
  if (!channels.has(topic)) {
    const schemaId = await writer.registerSchema({
      name,
      encoding: schemaEncoding,
      data: new TextEncoder().encode(definition),
    });
    channels.set(
      topic,
      await writer.registerChannel({ schemaId, topic, messageEncoding: encoding, metadata: new Map() }),
    );
  }
  const bytes = Buffer.from(data, 'base64');
  await writer.addMessage({
    channelId: channels.get(topic),
    sequence: 0,
    logTime: BigInt(time),
    publishTime: BigInt(time),
    data: bytes,
  });
}
await writer.end();
await file.close();
