import { useMemo } from 'preact/hooks';
import { query, useGet } from '../api.js';
import { chargeShare, consumption, energy, energyIn, energyScale, perMetre } from '../energy.js';
import * as format from '../format.js';
import { useNewest } from '../logs.js';
import { useModels } from '../models.js';
import { missionLink, robotLink, useChoices } from '../route.js';
import { Table, column, figure, orderOf } from '../table.jsx';
import { useTariff, worthTexts } from '../tariff.js';
import { Answer, Button, Empty, Failure, Ratio, Readouts } from '../widgets.jsx';
import { Filters, Misordered, RobotsField, TypedInput, fieldsOf, misordered, timesOf } from './choosing.jsx';
import { Export, missionFiles } from './export.jsx';

// The states of missions, in the service's words.
const missionStates = {
  open: 'not ended yet',
  finished: 'ended by the robot',
  aborted: 'ended early by the robot',
  unfinished: 'its end was never reported',
  superseded: 'another mission began before its end',
  interrupted: 'the service was stopped',
};

export const MissionState = ({ mission: { state } }) => (
  <span class={`state ${state}`} title={missionStates[state]}>
    {state}
  </span>
);

// The service's sort keys that differ from the column's key.
const sortNames = { consumption: 'wh_per_km' };

function StateCell({ mission: m }) {
  const payload = m.findings?.payload;
  const flag = (on, name, title) =>
    on && (
      <span class="flag" title={title}>
        {name}
      </span>
    );
  return (
    <>
      <MissionState mission={m} />
      {flag(m.incomplete, 'incomplete', format.words(m.incomplete_reason ?? ''))}
      {flag(m.annulled, 'annulled', m.annulled?.reason)}
      {flag(m.contradictions.length > 0, 'contradicted', m.contradictions.map((c) => c.says).join(' '))}
      {flag(
        payload?.verdict === 'undeclared',
        `${format.signed(format.digits(payload?.undeclared_kg, 2))} kg payload`,
        'Difference from the declared payload, estimated from the motion',
      )}
    </>
  );
}

// The columns for `missions`, each energy column in one unit. The service sorts.
function missionColumns(missions, models, withRobot) {
  const scale = energyScale(missions.flatMap((m) => [m.energy.battery_j, m.energy.modelled_j]));
  const share = (m) => chargeShare(m.energy.charge_ah, models.get(m.robot_id));
  const columns = [
    column('start', 'Started', (m) => format.time(m.start_utime_us), { class: 'when' }),
    column('robot', 'Robot', (m) => <a href={robotLink(m.robot_id)}>{m.robot_id}</a>),
    column('mission', 'Mission', (m) => <a href={missionLink(m.id)}>{m.mission_id}</a>, { head: true }),
    column('state', 'State', (m) => <StateCell mission={m} />, { class: 'states' }),
    figure('duration', 'Duration', (m) => format.span(m.energy.duration_s)),
    figure('distance', 'Distance', (m) => format.length(m.energy.distance_m)),
    figure('payload', 'Payload', (m) => format.unit(m.payload_kg, 'kg'), { class: 'figure wide' }),
    figure('energy', 'Energy', (m) => energyIn(scale, m.energy.battery_j)),
    figure('charge', 'Charge used', (m) => format.percent(share(m), 2), {
      hint: 'share of a full battery, if the robot file states its capacity',
    }),
    figure('modelled', 'Modelled', (m) => energyIn(scale, m.energy.modelled_j), { class: 'figure wide' }),
    figure('ratio', 'Ratio', (m) => <Ratio value={m.ratio} />, {
      hint: 'measured energy over modelled energy',
    }),
    figure('consumption', 'Consumption', (m) => consumption(perMetre(m)), {
      class: 'figure long',
      hint: 'energy over distance',
    }),
  ];
  return columns
    .filter((c) => withRobot || c.key !== 'robot')
    .map((c) => ({ ...c, sort: c.key !== 'charge' }));
}

export function MissionTable({ missions, withRobot = true, order }) {
  const models = useModels(missions.map((m) => m.robot_id));
  const columns = missionColumns(missions, models, withRobot);
  return <Table class="missions" columns={columns} rows={missions} order={order} />;
}

const pageRows = 50;

// The filter as parameters of the service, from the parameters of the address.
const filterOf = (given) => ({
  robot_id: given.robot,
  state: given.state,
  incomplete: given.incomplete,
  ...timesOf(given.from, given.to),
  payload_min_kg: given.payload_min,
  payload_max_kg: given.payload_max,
  ratio_min: given.ratio_min,
  ratio_max: given.ratio_max,
  name_contains: given.name,
});

const records = { '': 'all', false: 'complete', true: 'incomplete' };
const views = ['sort', 'down']; // how missions are shown, not which

// The filters in the address.
const chosen = (given) => Object.keys(given).filter((key) => given[key] && !views.includes(key));
const choosing = (given) => chosen(given).length > 0;

function BoundFields({ label, name, given, change, ...more }) {
  const input = (end, word) => (
    <TypedInput
      class="short"
      type="number"
      step="any"
      aria-label={`${label}, ${word}`}
      placeholder={word}
      value={given[`${name}_${end}`]}
      onChange={(event) => change({ [`${name}_${end}`]: event.currentTarget.value })}
      {...more}
    />
  );
  return (
    <fieldset class="field">
      <legend>{label}</legend>
      <span class="row with-unit">
        {input('min', 'from')}
        {input('max', 'to')}
      </span>
    </fieldset>
  );
}

function Chosen({ given, change }) {
  const field = fieldsOf(given, change);
  return (
    <Filters label="Filter missions">
      <RobotsField {...field.of('robot')} none="all" />
      {field.day('From', 'from', { minutes: true })}
      {field.day('To', 'to', { minutes: true })}
      <BoundFields label="Payload, kg" name="payload" given={given} change={change} min="0" />
      <BoundFields label="Ratio" name="ratio" given={given} change={change} />
      {field.select('State', 'state', [['', 'all'], ...Object.keys(missionStates)])}
      {field.select('Record', 'incomplete', Object.entries(records))}
      {field.text('Name contains', 'name', { type: 'search' })}
      <Button
        class="plain"
        disabled={!choosing(given)}
        onClick={() => change(Object.fromEntries(chosen(given).map((key) => [key, ''])))}
      >
        Clear
      </Button>
    </Filters>
  );
}

function Totals({ of }) {
  const tariff = useTariff();
  return (
    <Answer of={of} what="totals">
      {(t) => {
        const e = t.energy;
        const incomplete = t.incomplete_missions > 0 && `${format.fixed(t.incomplete_missions)} incomplete`;
        const part = e.unexplained_j !== null && e.battery_j !== 0 ? e.unexplained_j / e.battery_j : null;
        const rows = [
          ['Missions', format.fixed(t.missions), incomplete],
          ['Battery energy', energy(e.battery_j), worthTexts(tariff, e.battery_j).join(', '), 'measured'],
          ['Modelled', energy(e.modelled_j), '', 'modelled'],
          ['Unexplained', energy(e.unexplained_j), part === null ? '' : format.share(part, 1), 'gap'],
          ['Distance', format.length(e.distance_m)],
          ['Consumption', consumption(perMetre(t))],
          ['Duration', format.span(e.duration_s)],
        ];
        return <Readouts rows={rows} />;
      }}
    </Answer>
  );
}

function List({ given, list, total, order }) {
  const rows = list.value.entries;
  const title = choosing(given) ? 'No mission matches' : 'No mission yet';
  return (
    <>
      {list.error && <Failure error={list.error} retry={list.reload} />}
      <div class={list.loading ? 'stale' : ''} aria-busy={String(list.loading)}>
        {rows.length === 0 ? (
          <Empty title={title}>
            Missions appear when a robot with a robot file announces one or sends telemetry.
          </Empty>
        ) : (
          <MissionTable missions={rows} order={order} />
        )}
      </div>
      {rows.length > 0 && (
        <nav class="row wrap pages" aria-label="More missions">
          <span role="status">
            {format.fixed(rows.length)}
            {total !== null && ` of ${format.fixed(total)}`} loaded
          </span>
          {list.value.next !== null && (
            <Button disabled={list.loading} onClick={list.more}>
              {list.loading ? 'Loading …' : 'Load more'}
            </Button>
          )}
        </nav>
      )}
    </>
  );
}

export function Missions({ given: asked }) {
  const [given, change] = useChoices(asked);
  const filter = useMemo(() => filterOf(given), [given]);
  const order = orderOf(given, change, { key: 'start', down: true });
  const [{ key, down }] = order;
  const listed = { ...filter, sort: sortNames[key] ?? key, order: down ? 'desc' : 'asc' };
  const none = misordered(given.from, given.to);
  const list = useNewest(none ? null : '/v1/missions', listed, pageRows);
  const totals = useGet(none ? null : `/v1/mission-totals${query(filter)}`);
  const refresh = () => {
    list.reload();
    totals.reload();
  };
  const total = totals.value?.missions ?? null;
  return (
    <>
      <h1 class="hidden">Missions</h1>
      <Chosen given={given} change={change} />
      {none ? (
        <Misordered />
      ) : (
        <>
          <Totals of={totals} />
          <div class="row wrap tools">
            <Button onClick={refresh}>Refresh</Button>
            <Button href={`#/trends${query({ robot: given.robot })}`}>Trends</Button>
            <Button href="#/trends?of=missions">Compare</Button>
            <span class="note">Local times ({Intl.DateTimeFormat().resolvedOptions().timeZone}).</span>
            <Export of={missionFiles(listed)} total={total} disabled={!total} />
          </div>
          <Answer of={list} what="missions">
            {() => <List given={given} list={list} total={total} order={order} />}
          </Answer>
        </>
      )}
    </>
  );
}
