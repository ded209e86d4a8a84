// A model compared with measured energy of missions that it was not fitted on.
import { useState } from 'preact/hooks';
import { idPath, post } from '../api.js';
import { Strips } from '../bars.jsx';
import { energyIn, energyScale } from '../energy.js';
import * as format from '../format.js';
import { missionLink } from '../route.js';
import { Table, column, figure } from '../table.jsx';
import { Button } from '../widgets.jsx';
import { rangeOf, share } from './jobs.jsx';

const TestedMission = ({ id, mission_id: name, basis }) => (
  <>
    <a href={missionLink(id)}>{name}</a>
    {basis === 'motors' && <span class="note"> at the motors</span>}
  </>
);

function TestTable({ missions }) {
  const errors = missions.flatMap((m) => [Math.abs(m.before.relative), Math.abs(m.after.relative)]);
  const most = Math.max(0.01, ...errors);
  const scale = energyScale(missions.map((m) => m.measured_j));
  const error = (key, title) =>
    figure(key, title, (m) => (
      <span title={`95 % interval ${rangeOf(m[key].ci)}`}>{format.signed(share(m[key].relative))}</span>
    ));
  const bar = (key, kind) =>
    column(
      `${key}-bar`,
      '',
      (m) => <Strips of={[[Math.max(0.005, Math.abs(m[key].relative) / most), kind]]} tallPx={12} />,
      { class: 'wide bar-cell' },
    );
  const columns = [
    column('mission', 'Mission', TestedMission, { head: true }),
    figure('measured', 'Measured', (m) => energyIn(scale, m.measured_j)),
    error('before', 'Error before'),
    bar('before', 'plain'),
    error('after', 'Error after'),
    bar('after', 'modelled'),
  ];
  return <Table class="test" columns={columns} rows={missions} />;
}

const reasons = {
  fitted_on: 'used for the fit',
  open: 'still open',
  no_telemetry: 'without telemetry',
  contradicted: 'with contradictory telemetry',
  annulled: 'annulled',
  beyond_limits: 'beyond the limits',
};

export function BackTest({ test }) {
  if (test.missions.length === 0)
    return (
      <p>
        There is no mission to test it on: none with stored telemetry and measured energy that was not used
        for the fit.
      </p>
    );
  const left = Object.entries(reasons)
    .filter(([key]) => test.left_out[key] > 0)
    .map(([key, why]) => `${test.left_out[key]} ${why}`)
    .join(', ');
  return (
    <>
      <div class={`verdict-box ${test.improves ? 'good' : 'bad'}`}>
        <p class="verdict">
          On {format.count(test.missions.length, 'mission')} not used for the fit, the energy error changes
          from <b>{share(test.error_before, 2)}</b> to <b>{share(test.error_after, 2)}</b>.
        </p>
        <p class="note">
          Improvement {rangeOf(test.improvement_ci, 2)} (95 % interval). Gap in power{' '}
          {share(test.power_gap_before, 2)} before, {share(test.power_gap_after, 2)} after; it falls by{' '}
          {rangeOf(test.power_gap_fall_ci, 2)} (95 % interval).
          {format.known(test.voltage_gap_before) &&
            ` Error of changes of battery voltage ${share(test.voltage_gap_before, 2)} before, ${share(test.voltage_gap_after, 2)} after.`}{' '}
          Compared with model version {test.tested_against}.{left && ` Excluded: ${left}.`}
        </p>
      </div>
      <TestTable missions={test.missions} />
    </>
  );
}

// A change of a robot's model: {test, error, busy, adopted}, and ask(busy, body); true if it is adopted.
export function useAdoption(robot, begun = null) {
  const [state, setState] = useState({ test: begun, error: null, busy: '', adopted: null });
  const change = (part) => setState((before) => ({ ...before, ...part }));
  const ask = async (busy, body) => {
    change({ busy, error: null });
    try {
      const answer = await post(`/v1/robots/${idPath(robot)}/models`, body);
      change({ busy: '', test: answer.back_test, ...(answer.adopted && { adopted: answer.model_version }) });
      return answer.adopted;
    } catch (error) {
      change({ busy: '', error, ...(error.body?.back_test && { test: error.body.back_test }) });
      return false;
    }
  };
  return [state, ask];
}

// Requests the back-test alone.
export const TestButton = ({ busy, ...more }) => (
  <Button needs="operate" {...more}>
    {busy ? 'Testing …' : 'Test on other missions'}
  </Button>
);
