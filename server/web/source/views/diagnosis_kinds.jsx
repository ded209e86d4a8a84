// Parts of a comparison of groups and of a diagnosis of run energies that other diagnoses lack.
import * as format from '../format.js';
import { TablePanel, column, figure } from '../table.jsx';
import { effectName, share } from './jobs.jsx';

const perMetre = (value) => format.signed(format.digits(value));

const groupColumns = [
  column('name', 'Group', (g) => g.name, { head: true }),
  figure('missions', 'Missions', (g) => g.missions),
  figure('way', 'Distance, m', (g) => format.digits(g.way_m)),
  figure('energy', 'Measured, J/m', (g) => format.digits(g.energy_per_m_j)),
  figure('model', 'Modelled, J/m', (g) => format.digits(g.model_per_m_j)),
];
const strengthColumns = [
  column('group', 'Group', ([name]) => name, { head: true }),
  figure(
    'value',
    'Above the weakest',
    ([, g, unit]) => `${format.withDeviation(g.value, g.sd)}${unit === '1' ? '' : ` ${unit}`}`,
  ),
  figure('energy', 'Energy, J/m', ([, g]) => perMetre(g.energy_per_m_j)),
];
const partColumns = [
  column('part', 'Part', ([name]) => name, { head: true }),
  figure('energy', 'J/m', ([, value]) => perMetre(value)),
];

export function Comparison({ of: c }) {
  const d = c.difference;
  const parts = d && [
    ['motion and load', d.by_motion_j],
    ...Object.entries(d.by_effect_j).map(([id, value]) => [effectName(id), value]),
    ['not explained', d.unexplained_j],
    ['measured', d.energy_per_m_j],
  ];
  return (
    <>
      <TablePanel title="Groups" columns={groupColumns} rows={c.groups} keyOf={(g) => g.name} />
      {d && (
        <TablePanel
          title={`Energy per metre of ${d.to} above ${d.from}`}
          columns={partColumns}
          rows={parts}
          keyOf={([name]) => name}
        />
      )}
      {c.strengths.map((s) => (
        <TablePanel
          key={s.id}
          title={`${effectName(s.id)} by group`}
          columns={strengthColumns}
          rows={Object.entries(s.groups).map(([name, g]) => [name, g, s.unit])}
          keyOf={([name]) => name}
        />
      ))}
    </>
  );
}

const off = (key) => (r) => format.signed(share(1 - r[key] / r.measured_j));
const runColumns = [
  column('run', 'Run', (r) => (r.table ? `${r.table}: ${r.run}` : r.run), { head: true }),
  figure('measured', 'Measured, J', (r) => format.digits(r.measured_j)),
  figure('model', 'Error of the model', off('model_j')),
  figure('held', 'With the effects, run held out', off('held_out_j')),
];

export function Runs({ of: r }) {
  return (
    <TablePanel
      title="Runs"
      columns={runColumns}
      rows={r.runs}
      note={`Error: measured minus modelled energy, in percent of the measured. Without any cause runs scatter by ${share(r.scatter.run)}.`}
    />
  );
}
