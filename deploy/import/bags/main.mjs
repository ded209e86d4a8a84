// node bags.cjs REQUEST: REQUEST is JSON {bags, out, robot, mapping, robot_id} with names of files. Writes
// the tables and a mapping of each recording into the folder `out`, and answer.json: {recordings: [{source,
// table, mapping, lines}]} or {field, message}. node bags.cjs --licences prints the licences of the
// packages inside.
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { filesOf, read } from './readers.mjs';
import { Recording } from './recording.mjs';

async function parsed(option, file) {
  try {
    return file ? JSON.parse(await readFile(file, 'utf8')) : {};
  } catch (error) {
    throw Object.assign(error, { option, message: `${file}: ${error.message}` });
  }
}

async function convert(request) {
  const choices = await parsed('--mapping', request.mapping);
  const robot = await parsed('--robot', request.robot);
  const robotId = request.robot_id || choices.robot_id || robot.robot_id;
  if (!robotId)
    return { field: '--robot', message: 'bags do not name the robot: give its file, or --robot-id' };
  new Recording(choices, robot); // its mistakes, without a bag too
  const recordings = [];
  let open; // files of one recording follow each other
  let source;
  let at; // the bag that an error is about
  const close = async () => {
    at = source;
    const name = path.parse(path.resolve(source)).name.replace(/[^\w.-]/g, '_');
    for (const [k, part] of open.parts().entries()) {
      const stem = k ? `${name}-${k + 1}` : name;
      const { files, mapping } = part.tables(stem, robotId);
      for (const [file, text] of files) await writeFile(path.join(request.out, file), text);
      await writeFile(path.join(request.out, `${stem}.json`), JSON.stringify(mapping));
      recordings.push({ source, table: `${stem}.csv`, mapping: `${stem}.json`, lines: part.report });
    }
  };
  try {
    for (const bag of request.bags) {
      at = bag;
      const recording = new Recording(choices, robot);
      for (const file of await filesOf(bag)) await read(file, recording);
      if (open?.absorb(recording)) continue;
      if (open) await close();
      [open, source] = [recording, bag];
    }
    if (open) await close();
  } catch (error) {
    return { field: error.option ?? at, message: error.message };
  }
  return { recordings };
}

async function main() {
  if (process.argv[2] === '--licences') return process.stdout.write(LICENCES);
  const request = JSON.parse(process.argv[2]);
  const answer = await convert(request).catch(({ option, message }) => ({ field: option, message }));
  // Of a failed call of the system.
  answer.message = answer.message?.replace(/E[A-Z]+: (.*), \w+ '(.*)'$/, (_, why, file) =>
    file === answer.field ? `cannot be opened: ${why}` : `'${file}' cannot be opened: ${why}`,
  );
  await writeFile(path.join(request.out, 'answer.json'), JSON.stringify(answer));
}
main();
