// The filtered missions as a file, page by page; energies in joules, whatever the page shows.
import { get, query } from './api.js';

const pageRows = 1000;
const columns = {
  id: (m) => m.id,
  robot_id: (m) => m.robot_id,
  mission_id: (m) => m.mission_id,
  state: (m) => m.state,
  incomplete: (m) => m.incomplete,
  incomplete_reason: (m) => m.incomplete_reason,
  start_utime_us: (m) => m.start_utime_us,
  end_utime_us: (m) => m.end_utime_us,
  payload_kg: (m) => m.payload_kg,
  model_version: (m) => m.model_version,
  battery_j: (m) => m.energy.battery_j,
  measured_j: (m) => m.energy.measured_j,
  measured_s: (m) => m.energy.measured_s,
  modelled_j: (m) => m.energy.modelled_j,
  unexplained_j: (m) => m.energy.unexplained_j,
  drawn_j: (m) => m.energy.drawn_j,
  returned_j: (m) => m.energy.returned_j,
  charge_ah: (m) => m.energy.charge_ah,
  distance_m: (m) => m.energy.distance_m,
  turned_rad: (m) => m.energy.turned_rad,
  duration_s: (m) => m.energy.duration_s,
  samples: (m) => m.samples,
  gap_count: (m) => m.gap_count,
  gap_s: (m) => m.gap_s,
  note: (m) => m.note,
};

// RFC 4180; a text that a spreadsheet would take for a formula gets an apostrophe.
function csvField(value) {
  if (value === null || value === undefined) return '';
  if (typeof value !== 'string') return String(value);
  const safe = /^[=+\-@\t\r]/.test(value) ? `'${value}` : value;
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}

const csvRow = (mission) =>
  `${Object.values(columns)
    .map((value) => csvField(value(mission)))
    .join(',')}\r\n`;

function save(parts, name, type) {
  const url = URL.createObjectURL(new Blob(parts, { type }));
  const anchor = Object.assign(document.createElement('a'), { href: url, download: name });
  document.body.append(anchor);
  anchor.click();
  anchor.remove();
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}

export async function exportMissions(kind, filter, progress, signal) {
  const parts = [kind === 'csv' ? `${Object.keys(columns).join(',')}\r\n` : '[\n'];
  let cursor;
  let count = 0;
  do {
    const page = await get(`/v1/missions${query({ ...filter, limit: pageRows, cursor })}`, signal);
    if (page.missions.length > 0) {
      if (kind === 'csv') parts.push(page.missions.map(csvRow).join(''));
      else parts.push((count > 0 ? ',\n' : '') + page.missions.map((m) => JSON.stringify(m)).join(',\n'));
    }
    count += page.missions.length;
    cursor = page.next_cursor;
    progress(count);
  } while (cursor !== null);
  if (kind === 'json') parts.push('\n]\n');
  const stamp = new Date().toISOString().slice(0, 19).replaceAll(':', '');
  save(parts, `joulecast-missions-${stamp}.${kind}`, kind === 'csv' ? 'text/csv' : 'application/json');
}
