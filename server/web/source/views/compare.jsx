// Two robots, two periods or two missions side by side.
import { query, useGet } from '../api.js';
import { useChoices } from '../choices.js';
import { consumption, energyIn, energyScale } from '../energy.js';
import * as format from '../format.js';
import { useLive } from '../live.js';
import { missionLink, robotLink } from '../route.js';
import { Table, names } from '../table.jsx';
import { useTariff, worthNames, worthOf } from '../tariff.js';
import { effectOn } from '../waterfall.jsx';
import { Choice, Failure, Loading, Quantity, Ratio, useOptions, useTitleOf } from '../widgets.jsx';
import { Field, Misordered, dayField, misordered, timesOf } from './choosing.jsx';
import { totalsPath } from './trends.jsx';

const sides = ['a', 'b'];
const kinds = { robots: 'Robots', periods: 'Periods', missions: 'Missions' };

const dayAgo = (days) => {
  const d = new Date(Date.now() - days * 86_400_000);
  const two = (v) => String(v).padStart(2, '0');
  return `${d.getFullYear()}-${two(d.getMonth() + 1)}-${two(d.getDate())}`;
};

// The robot of a side for which none is chosen: another than the other side's.
function freeRobot(given, side, robots) {
  const other = given[side === 'a' ? 'b_robot' : 'a_robot'];
  return robots.filter((id) => id !== other)[side === 'b' && !other ? 1 : 0];
}

// The request of one side: {path, name, link}; path null until all is chosen.
function sideOf(given, side, kind, robots) {
  const at = (key) => given[`${side}_${key}`];
  if (kind === 'missions') {
    const id = at('mission');
    return {
      path: id ? `/v1/missions/${encodeURIComponent(id)}` : null,
      name: `Mission ${id}`,
      link: missionLink(id),
    };
  }
  const robot = kind === 'robots' ? (at('robot') ?? freeRobot(given, side, robots)) : given.robot;
  // Seven days each, the second ending today.
  const from = kind === 'robots' ? given.from : (at('from') ?? dayAgo(side === 'a' ? 13 : 6));
  const to = kind === 'robots' ? given.to : (at('to') ?? (side === 'a' ? dayAgo(7) : undefined));
  const none = misordered(from, to);
  return {
    path:
      none || (kind === 'robots' && !robot) ? null : totalsPath({ robot_id: robot, ...timesOf(from, to) }),
    none,
    robot,
    from,
    to,
    name: kind === 'robots' ? robot : `${from} to ${to ?? 'now'}`,
    link: kind === 'robots' && robot ? robotLink(robot) : null,
  };
}

// The robots that have missions, in descending order of their number; null until they are read.
function useDriven(kind) {
  const totals = useGet(kind === 'missions' ? null : `/v1/mission-totals${query({ group_by: 'robot' })}`);
  const live = useLive();
  if (totals.error !== null) return [...live.robots.keys()].sort();
  const groups = [...(totals.value?.groups ?? [])].sort((a, b) => b.missions - a.missions);
  return totals.value && groups.map((group) => group.robots[0]);
}

function RobotChoice({ label, value, onChange, all, robots }) {
  const others = value && !robots?.includes(value) ? [value] : [];
  const options = useOptions([...others, ...(robots ?? [])].sort(names.compare));
  return (
    <Field label={label}>
      <select value={value ?? ''} onChange={(event) => onChange(event.currentTarget.value)}>
        {all && <option value="">the fleet</option>}
        {options}
      </select>
    </Field>
  );
}

function MissionChoice({ label, value, onChange, recent }) {
  const known = recent.some((m) => String(m.id) === value);
  return (
    <Field label={label}>
      <select value={value ?? ''} onChange={(event) => onChange(event.currentTarget.value)}>
        {!known && <option value={value ?? ''}>{value ? `Mission ${value}` : 'choose …'}</option>}
        {recent.map((m) => (
          <option key={m.id} value={m.id}>
            {m.robot_id} {m.mission_id} {format.time(m.start_utime_us).slice(0, 16)}
          </option>
        ))}
      </select>
    </Field>
  );
}

function Fields({ given, kind, change, shown, robots }) {
  const recent = useGet(kind === 'missions' ? '/v1/missions?limit=200' : null);
  const set = (key) => (value) => change({ [key]: value });
  if (kind === 'missions')
    return sides.map((side) => (
      <MissionChoice
        key={side}
        label={side === 'a' ? 'First' : 'Second'}
        value={given[`${side}_mission`]}
        onChange={set(`${side}_mission`)}
        recent={recent.value?.missions ?? []}
      />
    ));
  if (kind === 'robots')
    return (
      <>
        <RobotChoice label="First" value={shown[0].robot} onChange={set('a_robot')} robots={robots} />
        <RobotChoice label="Second" value={shown[1].robot} onChange={set('b_robot')} robots={robots} />
        {dayField('From', given.from, set('from'))}
        {dayField('To', given.to, set('to'))}
      </>
    );
  return (
    <>
      <RobotChoice label="Robot" value={given.robot} onChange={set('robot')} robots={robots} all />
      {sides.map((side, k) => (
        <fieldset class="field" key={side}>
          <legend>{k === 0 ? 'First period' : 'Second period'}</legend>
          <span class="with-unit">
            {dayField('From', shown[k].from, set(`${side}_from`))}
            {dayField('To', shown[k].to, set(`${side}_to`))}
          </span>
        </fieldset>
      ))}
    </>
  );
}

// Rows of figures: {name, values, cell(value)}; both energies of a row in one unit.
function rowsOf(one, other, ledgers, tariff) {
  const row = (name, value, cell, count) => ({ name, values: [value(one), value(other)], cell, count });
  const plain = (of) => (v) => <Quantity of={of(v)} />;
  const joules = (name, value) => {
    const values = [value(one, ledgers?.[0]), value(other, ledgers?.[1])];
    const scale = energyScale(values);
    return { name, values, cell: plain((v) => energyIn(scale, v)) };
  };
  const terms = Object.keys(ledgers?.[0]?.terms_j ?? {}).filter((term) =>
    ledgers.some((ledger) => Math.abs(ledger.terms_j[term] ?? 0) > 0),
  );
  const perMetre = (totals, joule) =>
    totals.energy.distance_m > 0.1 && joule !== null ? joule / totals.energy.distance_m : null;
  return [
    ...(one.missions === undefined
      ? []
      : [
          row(
            'Missions',
            (t) => t.missions,
            (v) => format.fixed(v),
            true,
          ),
        ]),
    joules('Battery energy', (t) => t.energy.battery_j),
    ...worthNames
      .filter(([key]) => worthOf(tariff, 0)[key])
      .map(([key, name]) =>
        row(
          name,
          (t) => t.energy.battery_j,
          plain((v) => worthOf(tariff, v)[key]),
        ),
      ),
    joules('Modelled', (t) => t.energy.modelled_j),
    row(
      'Ratio',
      (t) => t.ratio,
      (v) => <Ratio value={v} />,
    ),
    row('Distance', (t) => t.energy.distance_m, plain(format.length)),
    row('Duration', (t) => t.energy.duration_s, format.span),
    row(
      'Mean power',
      (t) => (t.energy.duration_s > 0 ? t.energy.battery_j / t.energy.duration_s : null),
      plain(format.power),
    ),
    row('Consumption', (t) => (t.wh_per_km === null ? null : 3.6 * t.wh_per_km), plain(consumption)),
    ...terms.map((term) => ({
      name: `of which ${format.words(term)}`,
      values: [one, other].map((t, k) => perMetre(t, effectOn(term, ledgers[k].terms_j[term]))),
      least: Math.abs(perMetre(one, one.energy.battery_j) ?? 0) / 100,
      cell: plain(consumption),
    })),
  ];
}

// The relative change; null if the first value is negligible.
const change = ([a, b], least = 0) =>
  format.known(a) && format.known(b) && Math.abs(a) > least ? (b - a) / Math.abs(a) : null;

function Figures({ shown, values, ledgers }) {
  const tariff = useTariff();
  const columns = [
    { key: 'name', title: '', head: true, cell: (r) => r.name },
    ...shown.map((side, k) => ({
      key: k,
      title: side.name,
      class: 'figure',
      cell: (r) => r.cell(r.values[k]),
    })),
    {
      key: 'change',
      title: 'Second to first',
      class: 'figure long',
      cell: (r) => !r.count && <Quantity of={format.percent(change(r.values, r.least), 1)} sign />,
    },
  ];
  return (
    <>
      <p class="note">
        {shown.map((side, k) => (
          <span key={k}>
            {k > 0 && ' · '}
            {side.link ? <a href={side.link}>{side.name}</a> : side.name}
            {values[k].mission_id && ` ${values[k].robot_id} ${values[k].mission_id}`}
          </span>
        ))}
      </p>
      <Table
        class="compare"
        columns={columns}
        rows={rowsOf(...values, ledgers, tariff)}
        keyOf={(r) => r.name}
      />
      <p class="note foot">
        Terms of the ledger are shown over the distance, so that unequal sides can be compared.
      </p>
    </>
  );
}

function Unchosen({ kind, robots }) {
  if (kind === 'missions') return <p class="note">Choose two missions.</p>;
  if (robots === null) return <Loading what="the robots" />;
  return <p class="note">Two robots with missions are needed to compare them.</p>;
}

export function Compare({ given: asked }) {
  useTitleOf('Compare');
  const [given, change] = useChoices(asked);
  const kind = given.kind in kinds ? given.kind : 'robots';
  const robots = useDriven(kind);
  const shown = sides.map((side) => sideOf(given, side, kind, robots ?? []));
  const none = shown.some((side) => side.none);
  const [one, other] = [useGet(shown[0].path), useGet(shown[1].path)];
  const ledgerPath = (k) => (kind === 'missions' && shown[k].path ? `${shown[k].path}/ledger` : null);
  const [first, second] = [useGet(ledgerPath(0)), useGet(ledgerPath(1))];
  const ready = one.path === shown[0].path && other.path === shown[1].path && one.value && other.value;
  const ledgers =
    kind === 'missions'
      ? first.value && second.value && [first.value.ledger, second.value.ledger]
      : ready && [one.value.ledger, other.value.ledger];
  const error = one.error ?? other.error;
  const choosing = shown.some((side) => side.path === null);
  return (
    <>
      <h1 class="hidden">Compare</h1>
      <form class="filters" aria-label="Data of the comparison" onSubmit={(e) => e.preventDefault()}>
        <Choice
          label="Compare"
          value={kind}
          onChange={(next) => change({ kind: next })}
          options={Object.entries(kinds)}
        />
        <Fields given={given} kind={kind} change={change} shown={shown} robots={robots} />
        <a class="button" href="#/trends">
          Trends
        </a>
      </form>
      {none && <Misordered />}
      {!none && choosing && <Unchosen kind={kind} robots={robots} />}
      {!choosing && error && (
        <Failure error={error} retry={() => [one, other].forEach((each) => each.reload())} />
      )}
      {!choosing && !error && !ready && <Loading what="the comparison" />}
      {!choosing && !error && ready && (
        <Figures shown={shown} values={[one.value, other.value]} ledgers={ledgers || null} />
      )}
    </>
  );
}
