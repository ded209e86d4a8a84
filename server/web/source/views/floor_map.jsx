// The fleet's energy by place on the floor over weeks, and its departure from the models.
import { useState } from 'preact/hooks';
import { query, useGet } from '../api.js';
import { useChoices } from '../choices.js';
import { consumption, energy, energyIn, energyScale } from '../energy.js';
import { saveText } from '../export.js';
import * as format from '../format.js';
import { Table } from '../table.jsx';
import { useTariff, worthTexts } from '../tariff.js';
import { Answer, Choice, Empty, Panel, Quantity, Readout, useNarrow, useTitleOf } from '../widgets.jsx';
import { Field, Misordered, RobotsField, dayField, misordered, timesOf } from './choosing.jsx';
import { FloorCanvas } from './floor_canvas.jsx';

const usualDays = 28;
const dayMs = 86_400_000;
const sides = [0.5, 1, 2, 5, 10];
const listed = 12;

function filterOf(given) {
  const midnightUs = new Date().setHours(0, 0, 0, 0) * 1000;
  const times = timesOf(given.from, given.to);
  return {
    robot_id: given.robot,
    ...times,
    from_utime_us: times.from_utime_us ?? (times.to_utime_us ?? midnightUs) - usualDays * dayMs * 1000,
    cell_m: given.cell ?? 1,
  };
}

// What colours show: {name, title, kind, value(cell), unit}.
const subjects = {
  energy: () => {
    const { u } = consumption(1);
    const per = u === 'J/m' ? 1 : 3.6;
    return {
      title: 'energy over distance',
      kind: 'power',
      unit: u,
      value: (c) => (c.energy_j_per_m === null ? null : c.energy_j_per_m / per),
    };
  },
  gap: () => ({
    title: 'departure from the models',
    kind: 'gap',
    unit: '%',
    value: (c) => (c.departure === null ? null : 100 * c.departure),
  }),
  time: () => ({ title: 'time spent', kind: 'power', unit: 'min', value: (c) => c.covered_s / 60 }),
};
const names = [
  ['energy', 'Energy'],
  ['gap', 'Gap'],
  ['time', 'Time'],
];

// As finely as squares are.
const place = (low, high, side) => {
  const places = Number.isInteger(side) ? 0 : 1;
  return `${format.fixed(low, places)} to ${format.fixed(high, places)}`;
};
const square = (cell, side) =>
  `x ${place(cell.x_m, cell.x_m + side, side)}, y ${place(cell.y_m, cell.y_m + side, side)} m`;
const share = (value) => format.signed(format.text(format.percent(value)));

function departure(cell) {
  if (cell.departure === null) return 'too few missions';
  const [low, high] = cell.departure_ci;
  return `${share(cell.departure)} (${share(low)} to ${share(high)})`;
}

function Marked({ cell, side }) {
  if (cell === null)
    return (
      <p class="note foot">
        Point at a square, or use the arrow keys on the map. Outlined squares have too little data.
      </p>
    );
  return (
    <dl class="readouts strip floor-strip" aria-live="polite">
      <Readout label="Square" of={square(cell, side)} />
      <Readout label="Energy over distance" of={consumption(cell.energy_j_per_m)} />
      <Readout label="Departure (95 %)" of={departure(cell)} />
      <Readout label="Ratio" of={format.fixed(cell.ratio, 3)} />
      <Readout label="Time" of={format.span(cell.covered_s)} />
      <Readout
        label="Missions"
        of={`${cell.missions}`}
        note={`of ${cell.robots} ${cell.robots === 1 ? 'robot' : 'robots'}`}
      />
    </dl>
  );
}

const figure = (key, title, cell, hint) => ({ key, title, class: 'figure', cell, hint });

function Zones({ map, onMark }) {
  if (map.zones.length === 0)
    return (
      <p class="note">
        No place stands out: nowhere does measured energy depart significantly by 5 % or more from the models
        times each mission’s usual ratio.
      </p>
    );
  const scale = energyScale(
    map.zones.map((z) => z.excess_j),
    2,
  );
  const inZone = (z) => (c) =>
    c.stands_out && c.x_m >= z.x_min_m && c.x_m < z.x_max_m && c.y_m >= z.y_min_m && c.y_m < z.y_max_m;
  const columns = [
    {
      key: 'zone',
      title: 'Zone',
      head: true,
      cell: (z) => (
        <button type="button" class="plain" onClick={() => onMark(map.cells.find(inZone(z)) ?? null)}>
          Zone {z.number}
        </button>
      ),
    },
    { key: 'x', title: 'x, m', cell: (z) => place(z.x_min_m, z.x_max_m, map.cell_m) },
    { key: 'y', title: 'y, m', cell: (z) => place(z.y_min_m, z.y_max_m, map.cell_m) },
    figure(
      'departure',
      'Departure',
      (z) => <b>{share(z.departure)}</b>,
      'from the models times each mission’s usual ratio',
    ),
    figure('excess', 'Excess', (z) => <Quantity of={energyIn(scale, z.excess_j)} sign />),
    figure('distance', 'Driven', (z) => <Quantity of={format.length(z.distance_m)} />),
    figure('time', 'Time', (z) => format.span(z.covered_s)),
  ];
  const rows = map.zones.map((z, k) => ({ ...z, number: k + 1 }));
  return (
    <>
      <Table class="zones" columns={columns} rows={rows} keyOf={(z) => z.number} />
      <p class="note foot">
        A zone may be the floor (a carpet, a slope, a joint), or what robots do there: turn, brake, wait. A{' '}
        <a href="#/gap">diagnosis</a> distinguishes effects.
      </p>
    </>
  );
}

function Squares({ map }) {
  const narrow = useNarrow();
  const most = [...map.cells].filter((c) => c.energy_j_per_m !== null);
  most.sort((a, b) => b.energy_j_per_m - a.energy_j_per_m);
  const columns = [
    { key: 'square', title: 'Square', head: true, cell: (c) => square(c, map.cell_m) },
    figure('use', 'Energy over distance', (c) => <Quantity of={consumption(c.energy_j_per_m)} />),
    figure('departure', 'Departure', (c) => share(c.departure)),
    figure('missions', 'Missions', (c) => format.fixed(c.missions)),
  ];
  return (
    <details class="model" open={!narrow}>
      <summary>The {Math.min(listed, most.length)} squares of most energy over distance, as a table</summary>
      <Table
        class="squares"
        columns={columns}
        rows={most.slice(0, listed)}
        keyOf={(c) => `${c.x_m} ${c.y_m}`}
      />
    </details>
  );
}

function Summary({ map }) {
  const tariff = useTariff();
  const all = map.missions_read === map.missions;
  return (
    <dl class="readouts">
      <Readout
        large
        label="Energy"
        of={energy(map.energy_j)}
        channel="measured"
        note={worthTexts(tariff, map.energy_j).join(', ')}
      />
      <Readout large label="Driven" of={format.length(map.distance_m)} />
      <Readout
        large
        label="Energy over distance"
        of={consumption(map.distance_m > 0 ? map.energy_j / map.distance_m : null)}
      />
      <Readout large label="Ratio" of={format.fixed(map.ratio, 3)} />
      <Readout
        large
        label="Missions"
        of={format.fixed(map.missions_read)}
        note={
          all
            ? `of ${map.robots.length} ${map.robots.length === 1 ? 'robot' : 'robots'}`
            : `of ${format.fixed(map.missions)}, an even share`
        }
      />
      <Readout large label="Zones" of={`${map.zones.length}`} channel={map.zones.length > 0 ? 'gap' : ''} />
    </dl>
  );
}

function Shown({ map, show, stale }) {
  const [marked, setMarked] = useState(null);
  const subject = subjects[show]();
  const here = marked && map.cells.find((c) => c.x_m === marked.x_m && c.y_m === marked.y_m);
  if (map.cells.length === 0)
    return (
      <Empty title="No positions recorded yet">
        {map.missions === 0
          ? 'No mission started in this time.'
          : 'These robots do not report their position.'}
      </Empty>
    );
  return (
    <div class={stale ? 'stale' : ''}>
      <Summary map={map} />
      <div class="columns floor-columns">
        <Panel class="screen" title={`By squares of ${map.cell_m} m`}>
          <FloorCanvas map={map} {...subject} marked={here ?? null} onMark={setMarked} />
          <Marked cell={here ?? null} side={map.cell_m} />
        </Panel>
        <div>
          <Panel title="Zones">
            <Zones map={map} onMark={setMarked} />
          </Panel>
          <Squares map={map} />
        </div>
      </div>
      {map.cells.length < map.cells_total && (
        <p class="note foot">
          The {format.fixed(map.cells.length)} longest visited of {format.fixed(map.cells_total)} squares are
          shown.
        </p>
      )}
    </div>
  );
}

export function Floor({ given: asked }) {
  useTitleOf('Floor');
  const [given, change] = useChoices(asked);
  const show = given.show in subjects ? given.show : 'energy';
  const filter = filterOf(given);
  const none = misordered(given.from, given.to);
  const map = useGet(none ? null : `/v1/floor-map${query({ ...filter, limit: 20_000, digits: 7 })}`);
  return (
    <>
      <h1 class="hidden">Floor</h1>
      <form class="filters" aria-label="Data of the map" onSubmit={(e) => e.preventDefault()}>
        <RobotsField value={given.robot} onChange={(robot) => change({ robot })} none="the fleet" />
        {dayField('From', given.from, (from) => change({ from }))}
        {dayField('To', given.to, (to) => change({ to }))}
        <Field label="Squares">
          <select value={String(given.cell ?? 1)} onChange={(e) => change({ cell: e.currentTarget.value })}>
            {sides.map((side) => (
              <option key={side} value={String(side)}>
                {side} m
              </option>
            ))}
          </select>
        </Field>
        <Choice
          label="Colours show"
          value={show}
          onChange={(next) => change({ show: next })}
          options={names}
        />
        <span class="export">
          <button
            type="button"
            disabled={none}
            onClick={() => saveText(`/v1/floor-map${query(filter)}`, 'floor')}
          >
            Export CSV
          </button>
        </span>
      </form>
      {none ? (
        <Misordered />
      ) : (
        <Answer of={map} what="the floor">
          {(value) => <Shown map={value} show={show} stale={map.loading} />}
        </Answer>
      )}
    </>
  );
}
