import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import { get, query, useGet } from '../api.js';
import { consumption, energy } from '../energy.js';
import { exportMissions } from '../export.js';
import * as format from '../format.js';
import { useLive } from '../live.js';
import { useModels } from '../models.js';
import { keepInAddress } from '../route.js';
import { SortChoice, sorted, turned } from '../table.jsx';
import {
  Answer,
  Choice,
  Empty,
  Failure,
  Loading,
  Readout,
  stateNotes,
  useOptions,
  useTitleOf,
} from '../widgets.jsx';
import { MissionTable, missionColumns } from './mission_rows.jsx';
import { Trends } from './trends.jsx';

const pageRows = 50;
const periods = { day: 'By day', week: 'By week' };
const searchRows = 1000; // a search by a part of the name looks at this many at a time

// "2026-11-21T06:10" in local time, as the inputs of the browser give it, to microseconds.
const utimeUs = (local) => (local ? new Date(local).getTime() * 1000 : undefined);

// The filter as the service takes it, from the filter as the address keeps it.
function filterOf(given) {
  return {
    robot_id: given.robot,
    state: given.state,
    incomplete: given.incomplete,
    from_utime_us: utimeUs(given.from),
    to_utime_us: utimeUs(given.to),
    payload_min_kg: given.payload_min,
    payload_max_kg: given.payload_max,
  };
}

const views = ['sort', 'down', 'trend']; // how missions are shown, not which

// Whether the address chooses among the missions.
const choosing = (given) => Object.entries(given).some(([key, value]) => value && !views.includes(key));

const Field = ({ label, children }) => (
  <label class="field">
    <span>{label}</span>
    {children}
  </label>
);

function PayloadFields({ given, set }) {
  const input = (key, word) => (
    <input
      class="short"
      type="number"
      min="0"
      step="any"
      aria-label={`Payload, ${word} kg`}
      placeholder={word}
      value={given[key] ?? ''}
      onChange={set(key)}
    />
  );
  return (
    <fieldset class="field">
      <legend>Payload, kg</legend>
      <span class="with-unit">
        {input('payload_min', 'from')}
        {input('payload_max', 'to')}
      </span>
    </fieldset>
  );
}

function RobotField({ given, set }) {
  const live = useLive();
  const known = [...live.robots.keys()].sort();
  const options = useOptions(known);
  return (
    <Field label="Robot">
      <select value={given.robot ?? ''} onChange={set('robot')}>
        <option value="">all</option>
        {given.robot && !known.includes(given.robot) && <option value={given.robot}>{given.robot}</option>}
        {options}
      </select>
    </Field>
  );
}

function Filters({ given, change }) {
  const set = (key) => (event) => change({ ...given, [key]: event.currentTarget.value });
  const date = (label, key) => (
    <Field label={label}>
      <input type="datetime-local" value={given[key] ?? ''} onChange={set(key)} />
    </Field>
  );
  return (
    <form class="filters" aria-label="Filter missions" onSubmit={(e) => e.preventDefault()}>
      <RobotField given={given} set={set} />
      {date('From', 'from')}
      {date('To', 'to')}
      <PayloadFields given={given} set={set} />
      <Field label="State">
        <select value={given.state ?? ''} onChange={set('state')}>
          <option value="">all</option>
          {Object.entries(stateNotes).map(([state, name]) => (
            <option key={state} value={state}>
              {name}
            </option>
          ))}
        </select>
      </Field>
      <Field label="Record">
        <select value={given.incomplete ?? ''} onChange={set('incomplete')}>
          <option value="">all</option>
          <option value="false">complete</option>
          <option value="true">incomplete</option>
        </select>
      </Field>
      <Field label="Name contains">
        <input type="search" value={given.name ?? ''} onInput={set('name')} />
      </Field>
      <button
        type="button"
        class="plain"
        disabled={!choosing(given)}
        onClick={() => change(Object.fromEntries(views.map((key) => [key, given[key]])))}
      >
        Clear
      </button>
    </form>
  );
}

function Totals({ of }) {
  return (
    <Answer of={of} what="totals">
      {(t) => {
        const e = t.energy;
        const some = t.missions > 0;
        const incomplete =
          t.incomplete_missions > 0 ? `${format.fixed(t.incomplete_missions)} incomplete` : '';
        const part = e.unexplained_j !== null && e.battery_j !== 0 ? e.unexplained_j / e.battery_j : null;
        return (
          <dl class="readouts">
            <Readout label="Missions" of={format.fixed(t.missions)} note={incomplete} />
            <Readout label="Battery energy" of={energy(some ? e.battery_j : null)} channel="measured" />
            <Readout label="Modelled" of={energy(some ? e.modelled_j : null)} channel="modelled" />
            <Readout
              label="Unexplained"
              of={energy(e.unexplained_j)}
              channel="gap"
              note={part === null ? '' : format.text(format.percent(part, 1))}
            />
            <Readout label="Distance" of={format.length(e.distance_m)} />
            <Readout
              label="Consumption"
              of={consumption(e.distance_m > 0 ? e.battery_j / e.distance_m : null)}
            />
            <Readout label="Duration" of={format.span(e.duration_s)} />
          </dl>
        );
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

// Missions of `filter`, newest first, page by page into one list: {rows, next, error, loading, more, reload}.
function useList(filter, limit) {
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
    reload();
    return () => abort.current?.abort();
  }, [JSON.stringify(filter), limit]);
  return { ...list, more: () => read(list.rows, list.next), reload };
}

function Loaded({ list, shown, total, searching }) {
  const of = total === null ? '' : ` of ${format.fixed(total)}`;
  const found = searching ? `${format.fixed(shown)} found in ` : '';
  return (
    <nav class="pages" aria-label="More missions">
      <span role="status">
        {found}
        {searching ? 'the newest ' : ''}
        {format.fixed(list.rows.length)}
        {of} loaded
      </span>
      {list.next !== null && (
        <button type="button" disabled={list.loading} onClick={list.more}>
          {list.loading ? 'Loading …' : 'Load older'}
        </button>
      )}
    </nav>
  );
}

function List({ given, list, total, onSort }) {
  const { rows } = list;
  const part = (given.name ?? '').toLowerCase();
  const models = useModels(given.sort === 'charge' ? rows.map((m) => m.robot_id) : []);
  const named = part === '' ? rows : rows.filter((m) => m.mission_id.toLowerCase().includes(part));
  const sort = given.sort ? { key: given.sort, down: given.down === '1' } : null;
  const columns = missionColumns(named, models, true);
  const title = choosing(given) ? 'No mission matches' : 'No mission yet';
  return (
    <>
      {list.error && <Failure error={list.error} retry={list.reload} />}
      <SortChoice columns={columns} sort={sort} onSort={onSort} />
      <div class={list.loading ? 'stale' : ''} aria-busy={String(list.loading)}>
        {named.length === 0 ? (
          <Empty title={title}>Missions appear when a robot announces one or sends telemetry.</Empty>
        ) : (
          <MissionTable missions={sorted(named, columns, sort)} sort={sort} onSort={onSort} />
        )}
      </div>
      {rows.length > 0 && <Loaded list={list} shown={named.length} total={total} searching={part !== ''} />}
    </>
  );
}

export function Missions({ given: asked }) {
  useTitleOf('Missions');
  const [given, setGiven] = useState(asked);
  const change = (next) => {
    const kept = Object.fromEntries(Object.entries(next).filter(([, value]) => value));
    setGiven(kept);
    keepInAddress(kept);
  };
  const filter = useMemo(() => filterOf(given), [given]);
  const list = useList(filter, given.name ? searchRows : pageRows);
  const totals = useGet(`/v1/mission-totals${query(filter)}`);
  const refresh = () => {
    list.reload();
    totals.reload();
  };
  const onSort = (key) => {
    const sort = given.sort ? { key: given.sort, down: given.down === '1' } : null;
    const next = turned(sort, key, true);
    change({ ...given, sort: next.key, down: next.down ? '1' : '' });
  };
  const total = totals.value?.missions ?? null;
  return (
    <>
      <h1 class="hidden">Missions</h1>
      <Filters given={given} change={change} />
      <Totals of={totals} />
      {given.name && <p class="note">The sums are of all missions that the other filters choose.</p>}
      <div class="tools">
        <button type="button" onClick={refresh}>
          Refresh
        </button>
        <span class="note">
          Local times ({Intl.DateTimeFormat().resolvedOptions().timeZone}).
          {given.sort && list.next !== null && ' Sorted among the missions that are loaded.'}
        </span>
        <Choice
          label="List or sums"
          value={given.trend ?? ''}
          onChange={(trend) => change({ ...given, trend })}
          options={[['', 'List'], ...Object.entries(periods)]}
        />
        <Export filter={filter} total={total ?? 0} />
      </div>
      {given.trend in periods && <Trends kind={given.trend} filter={filter} />}
      {list.rows === null && list.error && <Failure error={list.error} retry={list.reload} />}
      {list.rows === null && !list.error && <Loading what="missions" />}
      {list.rows !== null && !(given.trend in periods) && (
        <List given={given} list={list} total={total} onSort={onSort} />
      )}
    </>
  );
}
