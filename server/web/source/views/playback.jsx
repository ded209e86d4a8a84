// A mission played on the map, with another one over it: both begin at the time 0.
import { useEffect, useMemo, useState } from 'preact/hooks';
import { query, useGet } from '../api.js';
import { lastAt } from '../chart.jsx';
import { powerAt, rowsOf } from '../floor.jsx';
import * as format from '../format.js';
import { missionLink, robotLink } from '../route.js';
import { Table, column, figure } from '../table.jsx';
import { palette } from '../theme.js';
import { Button, Choice, Failure, Panel } from '../widgets.jsx';
import { SelectField, fieldsOf } from './choosing.jsx';
import { MapCanvas, drawLine, drawNamed } from './map_canvas.jsx';

const tracePoints = 5000;
const listed = 50;
const frameMs = 50;
const speeds = { 1: '1 ×', 10: '10 ×', 60: '60 ×' };
const colours = ['measured', 'modelled'];

// {mission, t: seconds since its start, rows: [x m, y m]} of a mission; null until it is read.
function usePlayed(id) {
  const mission = useGet(id && `/v1/missions/${id}`);
  const trace = useGet(id && `/v1/missions/${id}/trace${query({ points: tracePoints })}`);
  const played = useMemo(() => {
    if (!id || String(mission.value?.id) !== id || String(trace.value?.id) !== id) return null;
    const of = trace.value;
    return {
      mission: mission.value,
      trace: of,
      t: of.start_utime_us.map((us) => (us - mission.value.start_utime_us) / 1e6),
      rows: rowsOf(of),
    };
  }, [id, mission.value, trace.value]);
  return [played, mission.error ?? trace.error];
}

// Position and heading there, between the rows.
function poseAt({ t, rows }, second) {
  const k = lastAt(t, second);
  const next = Math.min(k + 1, rows.length - 1);
  const [[x0, y0], [x1, y1]] = [rows[k], rows[next]];
  const part = next === k ? 0 : Math.max(0, Math.min(1, (second - t[k]) / (t[next] - t[k])));
  let back = k;
  while (back > 0 && Math.hypot(x1 - rows[back][0], y1 - rows[back][1]) < 0.05) back -= 1;
  return [x0 + part * (x1 - x0), y0 + part * (y1 - y0), Math.atan2(y1 - rows[back][1], x1 - rows[back][0])];
}

function Name({ of: { mission }, colour }) {
  return (
    <>
      <span class={`swatch ${colour}`} />
      <a href={missionLink(mission.id)}>{mission.mission_id}</a>
    </>
  );
}

const columns = [
  column('mission', 'Mission', Name, { head: true }),
  figure('power', 'Power', (row) => format.power(powerAt(row.of.trace, row.k))),
  figure('speed', 'Speed', ({ of, k }) => format.unit(of.trace.speed_m_s.mean[k], 'm/s', 2)),
  figure('charge', 'Charge', ({ of, k }) => format.percent(of.trace.state_of_charge[k], 1)),
];

function Player({ second, most, change }) {
  const [speed, setSpeed] = useState('10');
  const [playing, setPlaying] = useState(false);
  useEffect(() => {
    if (!playing) return undefined;
    const timer = setInterval(
      () => change((s) => Math.min(most, s + (Number(speed) * frameMs) / 1000)),
      frameMs,
    );
    return () => clearInterval(timer);
  }, [playing, speed, most]);
  useEffect(() => {
    if (second >= most) setPlaying(false);
  }, [second >= most]);
  const toggle = () => {
    if (second >= most) change(() => 0);
    setPlaying(!playing);
  };
  return (
    <div class="row wrap player">
      <Button onClick={toggle}>{playing ? 'Pause' : 'Play'}</Button>
      <input
        type="range"
        aria-label="Time since the start"
        aria-valuetext={format.span(second)}
        min="0"
        max={most}
        step="any"
        value={second}
        onInput={(e) => change(() => e.currentTarget.valueAsNumber)}
      />
      <span class="number">
        {format.span(second)} of {format.span(most)}
      </span>
      <Choice label="Speed" options={speeds} value={speed} onChange={setSpeed} />
    </div>
  );
}

function WithField({ of, value, onChange }) {
  const others = useGet(`/v1/missions${query({ robot_id: of.robot_id, limit: listed })}`);
  const options = (others.value?.missions ?? [])
    .filter(({ id }) => id !== of.id)
    .map((m) => [m.id, `${m.mission_id}, ${format.time(m.start_utime_us).slice(0, 16)}`]);
  return (
    <SelectField
      label={`Overlay another mission of ${of.robot_id}`}
      value={value}
      onChange={onChange}
      options={[['', 'no other mission'], ...options]}
    />
  );
}

// `given`: {mission, with}.
export function Playback({ given, change, level, image, children }) {
  const [second, setSecond] = useState(0);
  const [first, failure] = usePlayed(given.mission);
  const [other] = usePlayed(given.with);
  const played = [first, other].filter(Boolean);
  const most = Math.max(1, ...played.map(({ t }) => t.at(-1) ?? 0));
  if (failure) return <Failure error={failure} />;
  const draw = (c, view) => {
    played.forEach((of, k) => {
      const colour = palette()[colours[k]];
      c.globalAlpha = 0.35;
      drawLine(c, view, of.rows, colour, 1.5);
      c.globalAlpha = 1;
      drawLine(c, view, of.rows.slice(0, lastAt(of.t, second) + 1), colour, 3);
    });
    played.forEach((of, k) => {
      const pose = poseAt(of, second);
      if (Number.isFinite(pose[0])) drawNamed(c, view, pose, of.mission.mission_id, palette()[colours[k]]);
    });
  };
  return (
    <>
      <div class="wrap filters">
        {first && <WithField of={first.mission} {...fieldsOf(given, change).of('with')} />}
        <Button onClick={() => change({ mission: '', robot: '', with: '' })}>Live robots</Button>
        {children}
      </div>
      <Panel
        class="screen"
        title={first ? `${first.mission.mission_id}, played` : 'Mission'}
        aside={first && <a href={robotLink(first.mission.robot_id)}>{first.mission.robot_id}</a>}
      >
        <MapCanvas
          level={level}
          image={image}
          points={played.flatMap(({ rows }) => rows)}
          draw={draw}
          changes={[first, other, second]}
          label="Paths of the missions, and where the robots were at the time of the slider"
        />
        <Player second={second} most={most} change={setSecond} />
        <Table
          class="played"
          columns={columns}
          rows={played.map((of, k) => ({ of, colour: colours[k], k: lastAt(of.t, second) }))}
        />
      </Panel>
    </>
  );
}
