// Missions by day or week: energy, consumption and ratio of what the filter of the view chooses.
import { useEffect, useState } from 'preact/hooks';
import { get, query } from '../api.js';
import { consumption, energyIn, energyScale } from '../energy.js';
import * as format from '../format.js';
import { Table } from '../table.jsx';
import { Answer, Quantity, Ratio } from '../widgets.jsx';

const counts = { day: 14, week: 12 };
const days = { day: 1, week: 7 };

// {from, to} in local days, newest first; a week ends today.
function periodsOf(kind, end) {
  const last = new Date(end);
  last.setHours(24, 0, 0, 0);
  const at = (back) => new Date(last.getFullYear(), last.getMonth(), last.getDate() - back).getTime() * 1000;
  return Array.from({ length: counts[kind] }, (_, k) => ({
    from: at((k + 1) * days[kind]),
    to: at(k * days[kind]),
  }));
}

function useTotals(kind, filter) {
  const [state, setState] = useState({ value: null, error: null });
  const [turn, setTurn] = useState(0);
  const key = JSON.stringify([kind, filter]);
  useEffect(() => {
    const abort = new AbortController();
    const { from_utime_us: from = 0, to_utime_us: to = Infinity } = filter;
    const ask = async (p) => {
      const chosen = { ...filter, from_utime_us: Math.max(p.from, from), to_utime_us: Math.min(p.to, to) };
      return { ...p, ...(await get(`/v1/mission-totals${query(chosen)}`, abort.signal)) };
    };
    const periods = periodsOf(kind, Math.min(to / 1000, Date.now())).filter((p) => p.to > from);
    Promise.all(periods.map(ask)).then(
      (value) => setState({ value, error: null }),
      (error) => error.name !== 'AbortError' && setState({ value: null, error }),
    );
    return () => abort.abort();
  }, [key, turn]);
  return { ...state, reload: () => setTurn((n) => n + 1) };
}

// Measured over modelled, where measured.
const ratioOf = ({ measured_j: measured, unexplained_j: unexplained }) =>
  measured !== null && unexplained !== null && measured !== unexplained
    ? measured / (measured - unexplained)
    : null;

const dayOf = (utimeUs) => format.time(utimeUs).slice(0, 10);

function Periods({ periods, kind }) {
  const some = periods.filter((p) => p.missions > 0);
  const scale = energyScale(some.map((p) => p.energy.battery_j));
  const most = Math.max(...some.map((p) => Math.abs(p.energy.battery_j)), 1e-9);
  const width = (p) => `${(100 * Math.abs(p.energy.battery_j)) / most}%`;
  const figure = (key, title, cell) => ({ key, title, class: 'figure', cell });
  const columns = [
    {
      key: 'period',
      title: kind === 'day' ? 'Day' : 'Week from',
      head: true,
      cell: (p) => dayOf(p.from),
    },
    figure('missions', 'Missions', (p) => format.fixed(p.missions)),
    figure('energy', 'Energy', (p) => <Quantity of={energyIn(scale, p.energy.battery_j)} />),
    {
      key: 'bar',
      title: '',
      class: 'bar-cell trend-bar',
      cell: (p) => (
        <svg width="100%" height="12" aria-hidden="true">
          <rect height="8" y="2" width={width(p)} class="account measured" />
        </svg>
      ),
    },
    figure('distance', 'Distance', (p) => <Quantity of={format.kilometres(p.energy.distance_m)} />),
    figure('consumption', 'Consumption', (p) => (
      <Quantity
        of={consumption(p.energy.distance_m > 0.1 ? p.energy.battery_j / p.energy.distance_m : null)}
      />
    )),
    figure('ratio', 'Ratio', (p) => <Ratio value={ratioOf(p.energy)} />),
  ];
  if (some.length === 0) return <p class="note">No mission in this time.</p>;
  return <Table class="trends" columns={columns} rows={some} keyOf={(p) => p.from} />;
}

export function Trends({ kind, filter }) {
  const totals = useTotals(kind, filter);
  return (
    <Answer of={totals} what="trends">
      {(periods) => <Periods periods={periods} kind={kind} />}
    </Answer>
  );
}
