// The containers: each reader hands the messages of the wanted types to a bag, decoded, with their times of
// receipt.
import { loadDecompressHandlers } from '@mcap/support';
import { McapStreamReader } from '@mcap/core';
import { Bag } from '@foxglove/rosbag';
import { FileReader } from '@foxglove/rosbag/node';
import { ROS2_DEFINITIONS_ARRAY, ROS2_TO_DEFINITIONS, parseYaml } from '@foxglove/rosbag2';
import { parse } from '@foxglove/rosmsg';
import { MessageReader as Ros1Reader } from '@foxglove/rosmsg-serialization';
import { MessageReader as Ros2Reader } from '@foxglove/rosmsg2-serialization';
import initSqlJs from 'sql.js';
import sqlWasm from 'sql.js/dist/sql-wasm.wasm';
import { createReadStream } from 'node:fs';
import { open, readdir, readFile, stat } from 'node:fs/promises';
import path from 'node:path';

const usOf = (time) => time.sec * 1e6 + time.nsec / 1e3;

// By the definition that ROS 2 ships for the type.
function shippedDecoder(type) {
  const shipped = ROS2_TO_DEFINITIONS.get(type);
  return shipped && new Ros2Reader([shipped, ...ROS2_DEFINITIONS_ARRAY]);
}

// By a definition inside the file, or the shipped one.
function mcapDecoder(channel, schema) {
  const text = new TextDecoder().decode(schema.data);
  if (channel.messageEncoding === 'ros1') return new Ros1Reader(parse(text));
  if (channel.messageEncoding !== 'cdr') return undefined;
  if (schema.encoding === 'ros2msg' && text !== '') return new Ros2Reader(parse(text, { ros2: true }));
  return shippedDecoder(schema.name);
}

async function readMcap(file, bag) {
  const reader = new McapStreamReader({ decompressHandlers: await loadDecompressHandlers() });
  const schemas = new Map();
  const channels = new Map();
  const take = (record) => {
    if (record.type === 'Schema') schemas.set(record.id, record);
    if (record.type === 'Channel' && !channels.has(record.id)) {
      const none = { name: record.messageEncoding, encoding: '', data: new Uint8Array() };
      const schema = schemas.get(record.schemaId) ?? none;
      const decoder = bag.wants(schema.name) ? mcapDecoder(record, schema) : undefined;
      channels.set(record.id, { topic: record.topic, type: schema.name, decoder });
    }
    if (record.type !== 'Message') return;
    const { topic, type, decoder } = channels.get(record.channelId);
    bag.see(topic, type, 1);
    if (decoder) bag.put(topic, Number(record.logTime) / 1e3, () => decoder.readMessage(record.data));
  };
  try {
    for await (const data of createReadStream(file, { highWaterMark: 1 << 22 })) {
      reader.append(data);
      for (let record; (record = reader.nextRecord());) take(record);
    }
    if (!reader.done()) bag.warn(`${file}: ends before its footer; read up to there`);
  } catch (error) {
    bag.warn(`${file}: damaged, read up to there: ${error.message}`);
  }
}

async function readRos1(file, bag) {
  const handlers = await loadDecompressHandlers();
  const reader = new FileReader(file);
  const recording = new Bag(reader, { decompress: { bz2: handlers.bz2, lz4: handlers.lz4 } });
  await recording.open().catch((error) => {
    throw new Error(`was not closed (${error.message}): \`rosbag reindex\` repairs it`);
  });
  const types = new Map();
  for (const { conn, topic, type } of recording.connections.values()) {
    types.set(topic, type);
    bag.see(topic, type, 0);
    for (const chunk of recording.chunkInfos)
      for (const each of chunk.connections) if (each.conn === conn) bag.see(topic, type, each.count);
  }
  const topics = [...types.keys()].filter((topic) => bag.wants(types.get(topic)));
  if (topics.length > 0)
    for await (const { topic, timestamp, message } of recording.messageIterator({ topics }))
      bag.put(topic, usOf(timestamp), () => message);
  await reader.close();
}

// rosbag2's sqlite3 storage, in memory.
async function readSqlite(file, bag) {
  const wal = await stat(`${file}-wal`).catch(() => undefined);
  if (wal?.size > 0)
    bag.warn(
      `${file}: its newest messages are in ${file}-wal, which is not read; \`sqlite3 ${file} 'PRAGMA wal_checkpoint'\` merges them`,
    );
  const [{ Database }, data] = await Promise.all([initSqlJs({ wasmBinary: sqlWasm }), readFile(file)]);
  data.set([1, 1], 18); // merges a write-ahead log: SQLite in memory rejects its mark
  const db = new Database(data);
  try {
    const sql = `SELECT topics.id, name, type, count(messages.id) FROM topics
      LEFT JOIN messages ON topic_id = topics.id GROUP BY topics.id`;
    const topics = new Map();
    for (const [id, name, type, count] of db.exec(sql)[0]?.values ?? []) {
      bag.see(name, type, count);
      const decoder = bag.wants(type) ? shippedDecoder(type) : undefined;
      if (decoder) topics.set(id, { name, decoder });
    }
    const statement = db.prepare(
      `SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN (${[...topics.keys()]}) ORDER BY timestamp`,
    );
    while (statement.step()) {
      const [id, timestamp, message] = statement.get(null, { useBigInt: true });
      const { name, decoder } = topics.get(Number(id));
      bag.put(name, Number(timestamp) / 1e3, () => decoder.readMessage(message));
    }
  } catch (error) {
    const repair = `\`sqlite3 ${file} .recover | sqlite3 new.db3\` reads what is left`;
    throw new Error(`${error.message}; ${repair}`, { cause: error });
  } finally {
    db.close();
  }
}

const kinds = [
  ['#ROSBAG V2.0', readRos1],
  ['\x89MCAP0\r\n', readMcap],
  ['SQLite format 3', readSqlite],
];

// The files that a name stands for: those that a folder's metadata.yaml lists, or all where a recorder that
// was killed left none; else itself.
export async function filesOf(name) {
  if (!(await stat(name)).isDirectory()) return [name];
  const text = await readFile(path.join(name, 'metadata.yaml'), 'utf8').catch(() => undefined);
  const about = text ? parseYaml(text)?.rosbag2_bagfile_information : {};
  if (about?.compression_format)
    throw new Error(
      `is compressed (${about.compression_format}, ${about.compression_mode}): \`ros2 bag convert\` writes it plain`,
    );
  const files = text
    ? about?.relative_file_paths
    : (await readdir(name)).filter((file) => /\.(db3|mcap)$/.test(file)).sort();
  if (!files?.length) throw new Error('is a folder without a bag of ROS 2');
  return files.map((file) => path.join(name, path.basename(file)));
}

export async function read(file, bag) {
  const head = Buffer.alloc(16);
  const handle = await open(file);
  await handle.read(head, 0, 16, 0);
  await handle.close();
  const kind = kinds.find(([magic]) => head.toString('latin1').startsWith(magic));
  if (!kind) throw new Error('is neither a ROS 1 bag nor MCAP nor a ROS 2 bag (.db3)');
  await kind[1](file, bag);
}
