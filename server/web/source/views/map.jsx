// Robots on the floor, live, with the plan of their map and level; and missions replayed there.
import { useEffect, useMemo, useState } from 'preact/hooks';
import { del, putFile, query, useEvery, useGet } from '../api.js';
import { lastAt } from '../chart.jsx';
import { ConfirmButton } from '../dialog.jsx';
import { drawZones, powerAt, rowsOf } from '../floor.jsx';
import * as format from '../format.js';
import { needsSomeone, powerNow, useAttention } from '../health.jsx';
import { showRecent, useLive } from '../live.js';
import { missionLink, robotLink, useChoices } from '../route.js';
import { Table, column, figure, names } from '../table.jsx';
import { palette } from '../theme.js';
import { Answer, Button, Choice, Empty, Failure, Panel } from '../widgets.jsx';
import { Field, SelectField, fieldsOf, placeName } from './choosing.jsx';
import { MapCanvas, drawLine, drawNamed, planPath, useImage } from './map_canvas.jsx';

// A mission played on the map, with another one over it: both begin at the time 0.
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
    const t = of.start_utime_us.map((us) => (us - mission.value.start_utime_us) / 1e6);
    return { mission: mission.value, trace: of, t, rows: rowsOf(of) };
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

const nameCell = ({ of: { mission }, colour }) => [
  <span class={`swatch ${colour}`} />,
  <a href={missionLink(mission.id)}>{mission.mission_id}</a>,
];

const playedColumns = [
  column('mission', 'Mission', nameCell, { head: true }),
  figure('power', 'Power', (row) => format.power(powerAt(row.of.trace, row.k))),
  figure('speed', 'Speed', ({ of, k }) => format.unit(of.trace.speed_m_s.mean[k], 'm/s', 2)),
  figure('charge', 'Charge', ({ of, k }) => format.percent(of.trace.state_of_charge[k], 1)),
];

function Player({ second, most, change }) {
  const [speed, setSpeed] = useState('10');
  const [playing, setPlaying] = useState(false);
  useEvery(playing && frameMs, () => change((s) => Math.min(most, s + (Number(speed) * frameMs) / 1000)));
  useEffect(() => {
    if (second >= most) setPlaying(false);
  }, [second >= most]);
  const toggle = () => {
    if (second >= most) change(() => 0);
    setPlaying(!playing);
  };
  return (
    <div class="row wrap" style={{ gap: '8px 14px', margin: '10px 0' }}>
      <Button onClick={toggle}>{playing ? 'Pause' : 'Play'}</Button>
      <input
        type="range"
        style={{ flex: 1, minWidth: '180px' }}
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

function WithField({ of, ...field }) {
  const others = useGet(`/v1/missions${query({ robot_id: of.robot_id, limit: listed })}`);
  const options = (others.value?.missions ?? [])
    .filter(({ id }) => id !== of.id)
    .map((m) => [m.id, `${m.mission_id}, ${format.minute(m.start_utime_us)}`]);
  return (
    <SelectField
      label={`Overlay another mission of ${of.robot_id}`}
      options={[['', 'no other mission'], ...options]}
      {...field}
    />
  );
}

// `given`: {mission, with}.
function Playback({ given, change, level, image, children }) {
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
          draw={draw}
          points={played.flatMap(({ rows }) => rows)}
          changes={[first, other, second]}
          label="Paths of the missions, and where the robots were at the time of the slider"
        />
        <Player second={second} most={most} change={setSecond} />
        <Table
          class="played"
          columns={playedColumns}
          rows={played.map((of, k) => ({ of, colour: colours[k], k: lastAt(of.t, second) }))}
        />
      </Panel>
    </>
  );
}

// Upload and removal of a level's plan.
const numbers = [
  ['resolution_m', 'Side of a pixel', 'm'],
  ['origin_x_m', 'Lower left corner, x', 'm'],
  ['origin_y_m', 'Lower left corner, y', 'm'],
  ['origin_yaw_rad', 'Rotation', 'rad'],
];

// The fields of a map.yaml of ROS.
function fromMapYaml(text) {
  const numbersOf = (key) =>
    new RegExp(`^${key}:(.*)`, 'm').exec(text)?.[1].match(/[-+.\d][-+.\deE]*/g) ?? [];
  const found = [numbersOf('resolution')[0], ...numbersOf('origin')];
  return Object.fromEntries(numbers.map(([key], k) => [key, found[k]]).filter(([, value]) => value));
}

function FloorPlanForm({ place, level, onChange }) {
  const [given, setGiven] = useState({
    ...place,
    ...level,
    chargers: level?.chargers.map(({ x_m: x, y_m: y }) => `${x},${y}`).join(';') ?? '',
  });
  const [file, setFile] = useState(null);
  const [error, setError] = useState(null);
  const set = (part) => setGiven((before) => ({ ...before, ...part }));
  const send = async (event) => {
    event.preventDefault();
    const keys = [...numbers.map(([key]) => key), 'chargers'];
    const values = Object.fromEntries(keys.map((key) => [key, given[key]]));
    try {
      // Without another image the stored one is kept.
      await putFile(planPath(given) + query(values), file ?? (await (await fetch(planPath(level))).blob()));
      setError(null);
      onChange(given);
    } catch (failure) {
      setError(failure);
    }
  };
  const { text } = fieldsOf(given, set);
  const name = { required: true, ...placeName };
  const decimal = { inputmode: 'decimal', class: 'short' };
  return (
    <details class="model">
      <summary>{level ? 'Replace or remove the floor plan' : 'Add a floor plan'}</summary>
      <Panel title="Floor plan">
        <form class="wrap filters" onSubmit={send}>
          {text('Map', 'map', name)}
          {text('Level', 'level', name)}
          <Field label="Image, PNG or SVG, at most 4 MB">
            <input
              type="file"
              required={!level}
              accept="image/png,image/svg+xml"
              onChange={(e) => setFile(e.currentTarget.files[0])}
            />
          </Field>
          <Field label="map.yaml of ROS, for the values below">
            <input
              type="file"
              accept=".yaml,.yml"
              onChange={async (e) => set(fromMapYaml((await e.currentTarget.files[0]?.text()) ?? ''))}
            />
          </Field>
          {numbers.map(([key, label, unit]) =>
            text(`${label}, ${unit}`, key, { ...decimal, key, required: key === 'resolution_m' }),
          )}
          {text('Chargers, x,y;x,y in m', 'chargers', { placeholder: 'none' })}
          <Button type="submit" class="primary" needs="admin">
            Store
          </Button>
          {level && (
            <ConfirmButton
              label="Remove"
              title={`Remove the plan of ${level.map}, ${level.level}?`}
              needs="admin"
              onConfirm={() => del(planPath(level)).then(() => onChange({}), setError)}
            >
              <p>Robots on this level are shown without a plan.</p>
            </ConfirmButton>
          )}
        </form>
        {error && <Failure error={error} />}
      </Panel>
    </details>
  );
}

const renewMs = 30_000;
const zoneDays = 28;

const placeOf = ({ map, level }) => JSON.stringify([map, level]);
const nameOf = ([map, level]) => [map ?? 'no map', level && `level ${level}`].filter(Boolean).join(', ');

// The places of plans and robots, by name, and the one with most robots.
function placesOf({ levels, robots }) {
  const counts = new Map(levels.map((level) => [placeOf(level), 0]));
  for (const robot of robots) counts.set(placeOf(robot), (counts.get(placeOf(robot)) ?? 0) + 1);
  const all = [...counts.keys()].sort((a, b) => names.compare(nameOf(JSON.parse(a)), nameOf(JSON.parse(b))));
  const planned = new Set(levels.map(placeOf));
  const weight = (key) => counts.get(key) + (planned.has(key) && counts.get(key) > 0 ? 1e6 : 0);
  return { all, usual: all.reduce((best, key) => (best && weight(best) >= weight(key) ? best : key), null) };
}

function colourOf(state, needs) {
  const p = palette();
  if (needsSomeone(needs) && needs.severity !== 'notice') return p.bad;
  if (!state.live) return p.muted;
  return state.charging ? p.good : p.ink;
}

const layers = { paths: 'Paths', zones: 'Zones', none: 'Robots only' };

function zonesPath(ids) {
  if (ids.length === 0) return null;
  const fromMs = new Date().setHours(0, 0, 0, 0) - zoneDays * 86_400_000;
  return `/v1/floor-map${query({ robot_id: ids.join(), from_utime_us: fromMs * 1000, limit: 1 })}`;
}

const stateOf = ({ state: s }) =>
  s.charging ? 'charging' : s.mission ? 'on a mission' : s.live ? 'idle' : 'silent';
const columns = [
  column('robot', 'Robot', (e) => <a href={robotLink(e.id)}>{e.id}</a>, { head: true }),
  figure('power', 'Power', (e) => format.power(powerNow(e.state))),
  figure('charge', 'Charge', (e) => format.percent(e.state.state_of_charge)),
  column('state', 'State', stateOf),
];

function Live({ maps, place, level, image, show, change }) {
  const live = useLive();
  const attention = useAttention();
  const ids = maps.robots.filter((robot) => placeOf(robot) === place).map((robot) => robot.robot_id);
  const entries = ids.map((id) => live.robots.get(id)).filter((entry) => entry?.state);
  const placed = entries.filter(({ state }) => state.pose[0] !== null && state.pose[1] !== null);
  const zones = useGet(show === 'zones' ? zonesPath(ids) : null);
  useEffect(() => showRecent(placed), [ids.join(), placed.length, live.loads]);
  const rowsOf = (e) => e.path.last().map(([, x, y]) => [x, y]);
  const points = placed.flatMap((e) => [e.state.pose, ...rowsOf(e)]);
  const draw = (c, view) => {
    if (show === 'zones' && zones.value) drawZones(c, view, zones.value.zones);
    if (show === 'paths')
      for (const rows of placed.map(rowsOf)) drawLine(c, view, rows, palette().measured, 1.5);
    for (const e of placed) drawNamed(c, view, e.state.pose, e.id, colourOf(e.state, attention.get(e.id)));
  };
  const pick = (x, y, near) => {
    const far = ({ state: { pose } }) => Math.hypot(pose[0] - x, pose[1] - y);
    const nearest = [...placed].sort((a, b) => far(a) - far(b))[0];
    if (nearest && far(nearest) < near) location.hash = robotLink(nearest.id);
  };
  const without = entries.length - placed.length;
  return (
    <div class="columns map-columns">
      <Panel
        class="screen"
        title={nameOf(JSON.parse(place))}
        aside={<Choice label="Show" options={layers} value={show} onChange={(to) => change({ show: to })} />}
      >
        {placed.length === 0 && !image ? (
          <Empty title="No robot here reports its position" />
        ) : (
          <MapCanvas
            level={level}
            image={image}
            points={points}
            draw={draw}
            changes={[live.revision, show, zones.value, attention, place]}
            label={`Map with ${placed.length} robots; the table lists them`}
            onPick={pick}
          />
        )}
        <p class="note foot">
          Red: needs attention. Grey: silent. Green: charging.
          {show === 'zones' && ' Zones: places of significant gap in the last four weeks.'}
          {without > 0 && ` ${format.count(without, 'robot reports', 'robots report')} no position.`}
        </p>
      </Panel>
      <Panel title={format.count(entries.length, 'robot')}>
        <Table class="on-map" columns={columns} rows={entries} />
      </Panel>
    </div>
  );
}

function Shown({ maps, given, change, reload }) {
  const { all, usual } = placesOf(maps);
  const robot = maps.robots.find(({ robot_id: id }) => id === given.robot);
  const place = all.includes(given.place) ? given.place : robot ? placeOf(robot) : usual;
  const level = maps.levels.find((of) => placeOf(of) === place);
  const image = useImage(level);
  if (place === null) return <Empty title="No robot yet" />;
  const choice = (
    <SelectField
      label="Map and level"
      value={place}
      onChange={(to) => change({ place: to })}
      options={all.map((key) => [key, nameOf(JSON.parse(key))])}
    />
  );
  const stored = (at) => {
    change({ place: at.map ? placeOf(at) : '' });
    reload();
  };
  const [map, floor] = JSON.parse(place);
  return (
    <>
      {given.mission ? (
        <Playback given={given} change={change} level={level} image={image}>
          {choice}
        </Playback>
      ) : (
        <>
          <div class="wrap filters">{choice}</div>
          <Live
            maps={maps}
            place={place}
            level={level}
            image={image}
            change={change}
            show={given.show ?? 'paths'}
          />
        </>
      )}
      <FloorPlanForm key={place} place={{ map, level: floor }} level={level} onChange={stored} />
    </>
  );
}

export function FloorLive({ given: asked }) {
  const [given, change] = useChoices(asked);
  const maps = useGet('/v1/maps', 0, renewMs);
  return (
    <>
      <h1 class="hidden">Map</h1>
      <Answer of={maps} what="the map">
        {(value) => <Shown maps={value} given={given} change={change} reload={maps.reload} />}
      </Answer>
    </>
  );
}
