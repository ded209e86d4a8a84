// The fleet's energy by place on the floor over weeks, and its departure from the models.
import { useState } from 'preact/hooks';
import { query, useGet } from '../api.js';
import { consumption, energy, energyIn, energyScale } from '../energy.js';
import { useTariff, worthTexts } from '../tariff.js';
import * as format from '../format.js';
import { useChoices } from '../route.js';
import { Table, column, figure } from '../table.jsx';
import { Answer, Button, Choice, Empty, Panel, Readouts, useNarrow } from '../widgets.jsx';
import { Filters, Misordered, RobotsField, SelectField, fieldsOf, misordered, timesOf } from './choosing.jsx';
import { Export, csvOf } from './export.jsx';
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

// What colours show: {title, kind, unit, value(cell)}.
const subject = (title, kind, unit, value) => ({ title, kind, unit, value });
const subjects = {
  energy: () => {
    const { u } = consumption(1);
    const per = u === 'J/m' ? 1 : 3.6;
    return subject('consumption', 'power', u, (c) =>
      c.energy_j_per_m === null ? null : c.energy_j_per_m / per,
    );
  },
  gap: () =>
    subject('departure from the models', 'gap', '%', (c) =>
      c.departure === null ? null : 100 * c.departure,
    ),
  time: () => subject('time spent', 'power', 'min', (c) => c.covered_s / 60),
};
const names = { gap: 'Gap', energy: 'Energy', time: 'Time' };

// As finely as squares are.
const place = (low, high, side) => {
  const places = Number.isInteger(side) ? 0 : 1;
  return `${format.fixed(low, places)} to ${format.fixed(high, places)}`;
};
const square = (cell, side) =>
  `x ${place(cell.x_m, cell.x_m + side, side)}, y ${place(cell.y_m, cell.y_m + side, side)} m`;
const share = (value) => format.signed(format.share(value));

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
  const rows = [
    ['Square', square(cell, side)],
    ['Consumption', consumption(cell.energy_j_per_m)],
    ['Departure (95 %)', departure(cell)],
    ['Ratio', format.fixed(cell.ratio, 3), 'while driving'],
    ['Time', format.span(cell.covered_s)],
    ['Missions', `${cell.missions}`, `of ${format.count(cell.robots, 'robot')}`],
  ];
  return (
    <div aria-live="polite">
      <Readouts class="strip floor-strip" rows={rows} />
    </div>
  );
}

function Zones({ map, onMark }) {
  if (map.zones.length === 0)
    return (
      <p class="note">
        No place stands out: nowhere does measured energy depart significantly by 5 % or more from the models
        times each mission’s usual ratio.
      </p>
    );
  const excesses = map.zones.map((z) => z.excess_j);
  const scale = energyScale(excesses, 2);
  const inZone = (z) => (c) =>
    c.stands_out && c.x_m >= z.x_min_m && c.x_m < z.x_max_m && c.y_m >= z.y_min_m && c.y_m < z.y_max_m;
  const zoneButton = (z) => (
    <Button class="plain" onClick={() => onMark(map.cells.find(inZone(z)) ?? null)}>
      Zone {z.number}
    </Button>
  );
  const columns = [
    column('zone', 'Zone', zoneButton, { head: true }),
    column('x', 'x, m', (z) => place(z.x_min_m, z.x_max_m, map.cell_m)),
    column('y', 'y, m', (z) => place(z.y_min_m, z.y_max_m, map.cell_m)),
    figure('departure', 'Departure', (z) => <b>{share(z.departure)}</b>, {
      hint: 'from the models times each mission’s usual ratio',
    }),
    figure('excess', 'Excess', (z) => format.withSign(energyIn(scale, z.excess_j))),
    figure('distance', 'Distance', (z) => format.length(z.distance_m)),
    figure('time', 'Time', (z) => format.span(z.covered_s)),
  ];
  const rows = map.zones.map((z, k) => ({ ...z, number: k + 1 }));
  return (
    <>
      <Table class="zones" columns={columns} rows={rows} />
      <p class="note foot">
        A zone may be the floor (a carpet, a slope, a joint), or what robots do there: turn, brake, wait. A{' '}
        <a href="#/gap">diagnosis</a> distinguishes effects.
      </p>
    </>
  );
}

// Energy over the expectation of the models, of a square with a known departure.
const excessOf = ({ departure: d, measured_j: measured }) => (measured * d) / (1 + d);

function Squares({ map }) {
  const narrow = useNarrow();
  const most = map.cells.filter((c) => c.departure !== null);
  most.sort((a, b) => excessOf(b) - excessOf(a));
  const shown = most.slice(0, listed);
  const excess = energyScale(shown.map(excessOf));
  const spent = energyScale(shown.map((c) => c.energy_j));
  const columns = [
    column('square', 'Square', (c) => square(c, map.cell_m), { head: true }),
    figure('excess', 'Excess', (c) => format.withSign(energyIn(excess, excessOf(c)))),
    figure('departure', 'Departure', (c) => share(c.departure)),
    figure('energy', 'Energy', (c) => energyIn(spent, c.energy_j)),
    figure('missions', 'Missions', (c) => format.fixed(c.missions)),
  ];
  return (
    <details class="model" open={!narrow}>
      <summary>The {shown.length} squares with the greatest excess energy</summary>
      <Table class="squares" columns={columns} rows={shown} />
    </details>
  );
}

function Summary({ map }) {
  const tariff = useTariff();
  const sampled = `${format.fixed(map.missions)}, evenly sampled`;
  const of = map.missions_read === map.missions ? format.count(map.robots.length, 'robot') : sampled;
  const rows = [
    ['Energy', energy(map.energy_j), worthTexts(tariff, map.energy_j).join(', '), 'measured'],
    ['Distance', format.length(map.distance_m)],
    ['Consumption', consumption(map.distance_m > 0 ? map.energy_j / map.distance_m : null)],
    ['Ratio', format.fixed(map.ratio, 3), 'while driving'],
    ['Missions', format.fixed(map.missions_read), `of ${of}`],
    ['Zones', `${map.zones.length}`, '', map.zones.length > 0 ? 'gap' : ''],
  ];
  return <Readouts large rows={rows} />;
}

function Shown({ map, show, stale }) {
  const [marked, setMarked] = useState(null);
  const here = marked && map.cells.find((c) => c.x_m === marked.x_m && c.y_m === marked.y_m);
  if (map.cells.length === 0)
    return (
      <Empty title="No positions recorded yet">
        {map.missions === 0
          ? `No mission started in this period; by default it is the last ${usualDays} days.`
          : 'These robots do not report their position.'}
      </Empty>
    );
  return (
    <div class={stale ? 'stale' : ''}>
      <Summary map={map} />
      <div class="columns floor-columns">
        <Panel class="screen" title={`By squares of ${map.cell_m} m`}>
          <FloorCanvas map={map} {...subjects[show]()} marked={here ?? null} onMark={setMarked} />
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
  const [given, change] = useChoices(asked);
  const field = fieldsOf(given, change);
  const show = given.show in subjects ? given.show : 'gap';
  const filter = filterOf(given);
  const none = misordered(given.from, given.to);
  const map = useGet(none ? null : `/v1/floor-map${query({ ...filter, limit: 20_000, digits: 7 })}`);
  return (
    <>
      <h1 class="hidden">Floor</h1>
      <Filters label="Filter the map">
        <RobotsField {...field.of('robot')} none="the fleet" />
        {field.day('From', 'from')}
        {field.day('To', 'to')}
        <SelectField
          label="Squares"
          {...field.of('cell', String(given.cell ?? 1))}
          options={sides.map((side) => [String(side), `${side} m`])}
        />
        <Choice label="Colours show" {...field.of('show', show)} options={names} />
        <Export of={[csvOf(`/v1/floor-map${query(filter)}`, 'floor')]} disabled={none} />
      </Filters>
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
