import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import { get, query, useGet } from '../api.js';
import { useChoices } from '../choices.js';
import { consumption, energy } from '../energy.js';
import { exportMissions } from '../export.js';
import * as format from '../format.js';
import { useModels } from '../models.js';
import { SortChoice, turned } from '../table.jsx';
import { useTariff, worthTexts } from '../tariff.js';
import { Answer, Empty, Failure, Loading, Readouts, missionStates, useTitleOf } from '../widgets.jsx';
import {
  DayField,
  Field,
  Filters,
  Misordered,
  RobotsField,
  SelectField,
  TypedInput,
  misordered,
  timesOf,
} from './choosing.jsx';
import { MissionTable, missionColumns, sortNames } from './mission_rows.jsx';

const pageRows = 50;

// The filter as parameters of the service, from the parameters of the address.
function filterOf(given) {
  return {
    robot_id: given.robot,
    state: given.state,
    incomplete: given.incomplete,
    ...timesOf(given.from, given.to),
    payload_min_kg: given.payload_min,
    payload_max_kg: given.payload_max,
    ratio_min: given.ratio_min,
    ratio_max: given.ratio_max,
    name_contains: given.name,
  };
}

const views = ['sort', 'down']; // how missions are shown, not which

// The filters in the address.
const chosen = (given) => Object.keys(given).filter((key) => given[key] && !views.includes(key));
const choosing = (given) => chosen(given).length > 0;

function BoundFields({ label, name, given, set, ...more }) {
  const input = (end, word) => (
    <TypedInput
      class="short"
      type="number"
      step="any"
      aria-label={`${label}, ${word}`}
      placeholder={word}
      value={given[`${name}_${end}`]}
      onChange={set(`${name}_${end}`)}
      {...more}
    />
  );
  return (
    <fieldset class="field">
      <legend>{label}</legend>
      <span class="with-unit">
        {input('min', 'from')}
        {input('max', 'to')}
      </span>
    </fieldset>
  );
}

function Chosen({ given, change }) {
  const set = (key) => (event) => change({ [key]: event.currentTarget.value });
  const choice = (label, key, options) => (
    <SelectField label={label} value={given[key]} onChange={(v) => change({ [key]: v })} options={options} />
  );
  const date = (label, key) => (
    <DayField label={label} minutes value={given[key]} onChange={(value) => change({ [key]: value })} />
  );
  return (
    <Filters label="Filter missions">
      <RobotsField value={given.robot} onChange={(robot) => change({ robot })} none="all" />
      {date('From', 'from')}
      {date('To', 'to')}
      <BoundFields label="Payload, kg" name="payload" given={given} set={set} min="0" />
      <BoundFields label="Ratio" name="ratio" given={given} set={set} />
      {choice('State', 'state', [['', 'all'], ...Object.keys(missionStates)])}
      {choice('Record', 'incomplete', [
        ['', 'all'],
        ['false', 'complete'],
        ['true', 'incomplete'],
      ])}
      <Field label="Name contains">
        <input type="search" value={given.name ?? ''} onInput={set('name')} />
      </Field>
      <button
        type="button"
        class="plain"
        disabled={!choosing(given)}
        onClick={() => change(Object.fromEntries(chosen(given).map((key) => [key, ''])))}
      >
        Clear
      </button>
    </Filters>
  );
}

function Totals({ of }) {
  const tariff = useTariff();
  return (
    <Answer of={of} what="totals">
      {(t) => {
        const e = t.energy;
        const some = t.missions > 0;
        const incomplete =
          t.incomplete_missions > 0 ? `${format.fixed(t.incomplete_missions)} incomplete` : '';
        const part = e.unexplained_j !== null && e.battery_j !== 0 ? e.unexplained_j / e.battery_j : null;
        const rows = [
          ['Missions', format.fixed(t.missions), incomplete],
          [
            'Battery energy',
            energy(some ? e.battery_j : null),
            worthTexts(tariff, some ? e.battery_j : null).join(', '),
            'measured',
          ],
          ['Modelled', energy(some ? e.modelled_j : null), '', 'modelled'],
          [
            'Unexplained',
            energy(e.unexplained_j),
            part === null ? '' : format.text(format.percent(part, 1)),
            'gap',
          ],
          ['Distance', format.length(e.distance_m)],
          ['Consumption', consumption(e.distance_m > 0 ? e.battery_j / e.distance_m : null)],
          ['Duration', format.span(e.duration_s)],
        ];
        return <Readouts rows={rows} />;
      }}
    </Answer>
  );
}

function Export({ filter, total }) {
  const [progress, setProgress] = useState(null);
  const [error, setError] = useState(null);
  const abort = useRef(null);
  useEffect(() => () => abort.current?.abort(), []);
  const run = async (kind) => {
    abort.current = new AbortController();
    setError(null);
    setProgress(0);
    try {
      await exportMissions(kind, filter, setProgress, abort.current.signal);
    } catch (fault) {
      if (fault.name !== 'AbortError') setError(fault);
    }
    setProgress(null);
  };
  if (progress !== null)
    return (
      <div class="export" role="status">
        <progress max={total || 1} value={progress} /> {format.fixed(progress)} of {format.fixed(total)}
        <button type="button" onClick={() => abort.current.abort()}>
          Stop
        </button>
      </div>
    );
  return (
    <div class="export">
      {error && (
        <span class="fault" role="alert">
          {error.message}
        </span>
      )}
      <button type="button" disabled={!total} onClick={() => run('csv')}>
        Export CSV
      </button>
      <button type="button" disabled={!total} onClick={() => run('json')}>
        Export JSON
      </button>
    </div>
  );
}

// Missions of `filter` in its order, page by page into one list: {rows, next, error, loading, more, reload}.
// With `none` no request is made.
function useList(filter, limit, none) {
  const empty = { rows: null, next: null, error: null, loading: true };
  const [list, setList] = useState(empty);
  const abort = useRef(null);
  const read = async (before, cursor) => {
    abort.current?.abort();
    const { signal } = (abort.current = new AbortController());
    setList({ ...list, error: null, loading: true });
    try {
      const page = await get(`/v1/missions${query({ ...filter, limit, cursor })}`, signal);
      setList({ rows: [...before, ...page.missions], next: page.next_cursor, error: null, loading: false });
    } catch (error) {
      if (error.name !== 'AbortError') setList({ ...list, error, loading: false });
    }
  };
  const reload = () => read([], undefined);
  useEffect(() => {
    if (none) return undefined;
    reload();
    return () => abort.current?.abort();
  }, [JSON.stringify(filter), limit, none]);
  return { ...list, more: () => read(list.rows, list.next), reload };
}

function Loaded({ list, total }) {
  const of = total === null ? '' : ` of ${format.fixed(total)}`;
  return (
    <nav class="pages" aria-label="More missions">
      <span role="status">
        {format.fixed(list.rows.length)}
        {of} loaded
      </span>
      {list.next !== null && (
        <button type="button" disabled={list.loading} onClick={list.more}>
          {list.loading ? 'Loading …' : 'Load more'}
        </button>
      )}
    </nav>
  );
}

function List({ given, list, total, sort, onSort }) {
  const { rows } = list;
  const models = useModels([]);
  const title = choosing(given) ? 'No mission matches' : 'No mission yet';
  return (
    <>
      {list.error && <Failure error={list.error} retry={list.reload} />}
      <SortChoice columns={missionColumns(rows, models, true)} sort={sort} onSort={onSort} />
      <div class={list.loading ? 'stale' : ''} aria-busy={String(list.loading)}>
        {rows.length === 0 ? (
          <Empty title={title}>Missions appear when a robot announces one or sends telemetry.</Empty>
        ) : (
          <MissionTable missions={rows} sort={sort} onSort={onSort} />
        )}
      </div>
      {rows.length > 0 && <Loaded list={list} total={total} />}
    </>
  );
}

export function Missions({ given: asked }) {
  useTitleOf('Missions');
  const [given, change] = useChoices(asked);
  const filter = useMemo(() => filterOf(given), [given]);
  const sort = given.sort ? { key: given.sort, down: given.down === '1' } : { key: 'start', down: true };
  const order = { sort: sortNames[sort.key] ?? sort.key, order: sort.down ? 'desc' : 'asc' };
  const none = misordered(given.from, given.to);
  const list = useList({ ...filter, ...order }, pageRows, none);
  const totals = useGet(none ? null : `/v1/mission-totals${query(filter)}`);
  const refresh = () => {
    list.reload();
    totals.reload();
  };
  const onSort = (key) => {
    const next = turned(sort, key, true);
    change({ sort: next.key, down: next.down ? '1' : '' });
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
          <div class="tools">
            <button type="button" onClick={refresh}>
              Refresh
            </button>
            <a class="button" href={`#/trends${query({ robot: given.robot })}`}>
              Trends
            </a>
            <a class="button" href="#/trends?of=missions">
              Compare
            </a>
            <span class="note">Local times ({Intl.DateTimeFormat().resolvedOptions().timeZone}).</span>
            <Export filter={{ ...filter, ...order }} total={total ?? 0} />
          </div>
          {list.rows === null && list.error && <Failure error={list.error} retry={list.reload} />}
          {list.rows === null && !list.error && <Loading what="missions" />}
          {list.rows !== null && <List given={given} list={list} total={total} sort={sort} onSort={onSort} />}
        </>
      )}
    </>
  );
}
