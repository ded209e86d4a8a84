// Adoption of a diagnosis's effects: a choice among confounded ones, a back-test and a confirmation.
import { useState } from 'preact/hooks';
import { idPath, post, useGet } from '../api.js';
import { Strips } from '../bars.jsx';
import { ConfirmButton } from '../dialog.jsx';
import { energyIn, energyScale } from '../energy.js';
import * as format from '../format.js';
import { missionLink, robotLink } from '../route.js';
import { Table, column, figure } from '../table.jsx';
import { Button, Failure } from '../widgets.jsx';
import { Changes, changesOf } from './changes.jsx';
import { SelectField } from './choosing.jsx';
import { effectName, rangeOf, share } from './jobs.jsx';

const missionCell = ({ id, mission_id: name, basis }) => [
  <a href={missionLink(id)}>{name}</a>,
  basis === 'motors' && <span class="note"> at the motors</span>,
];

function TestTable({ missions }) {
  const errors = missions.flatMap((m) => [Math.abs(m.before.relative), Math.abs(m.after.relative)]);
  const most = Math.max(0.01, ...errors);
  const scale = energyScale(missions.map((m) => m.measured_j));
  const errorOf = ({ ci, relative }) => (
    <span title={`95 % interval ${rangeOf(ci)}`}>{format.signed(share(relative))}</span>
  );
  const barOf = ({ relative }, kind) => (
    <Strips of={[[Math.max(0.005, Math.abs(relative) / most), kind]]} tallPx={12} />
  );
  const side = (key, title, kind) => [
    figure(key, title, (m) => errorOf(m[key])),
    column(`${key}-bar`, '', (m) => barOf(m[key], kind), { class: 'wide bar-cell' }),
  ];
  const columns = [
    column('mission', 'Mission', missionCell, { head: true }),
    figure('measured', 'Measured', (m) => energyIn(scale, m.measured_j)),
    ...side('before', 'Error before', 'plain'),
    ...side('after', 'Error after', 'modelled'),
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
export const TestButton = ({ state: { busy }, ask, disabled }) => (
  <Button needs="operate" disabled={disabled || busy !== ''} onClick={() => ask('test', { dry_run: true })}>
    {busy === 'test' ? 'Testing …' : 'Test on other missions'}
  </Button>
);

// Adopts with the back-test; `children` describe the change.
export const AdoptButton = ({ state: { busy }, action = 'Adopt', disabled, ...more }) => (
  <ConfirmButton
    label={busy === 'adopt' ? 'Testing and adopting …' : action}
    action={action}
    disabled={disabled || busy !== ''}
    needs="operate"
    {...more}
  />
);

// The choice of one of several effects that the data do not distinguish.
function optionsOf({ id: first, instead }) {
  const ids = instead.filter((e) => Object.keys(e.parameters).length > 0).map((e) => e.id);
  return [['', 'choose one'], ...[first, ...ids].map((id) => [id, effectName(id)])];
}

// The changes of the adoption: those of the diagnosed model, or the parameters of the chosen effects.
function changesFor(job, robot, chosen) {
  if (chosen.length === 0) return changesOf(job.model, robot?.model);
  const all = job.result.adoption.effects.flatMap((e) => [e, ...e.instead]);
  const rowOf = (id, [name, to]) => ({ key: `effects.${id}.${name}`, from: null, to: format.digits(to, 4) });
  return chosen.flatMap((id) =>
    Object.entries(all.find((e) => e.id === id)?.parameters ?? {}).map((parameter) => rowOf(id, parameter)),
  );
}

export function Adopt({ job }) {
  const offer = job.result.adoption;
  const groups = offer?.effects.filter((e) => e.instead.length > 0) ?? [];
  const refusal = offer?.refusal ?? null;
  const [chosen, setChosen] = useState({});
  const effect = groups.map((g) => chosen[g.id] ?? '');
  const robot = useGet(`/v1/robots/${idPath(job.robot_id)}`);
  const [state, askFor] = useAdoption(job.robot_id);
  const { adopted, test, error } = state;
  const ask = (busy, more) =>
    askFor(busy, { diagnosis_id: job.id, ...(effect.length > 0 && { effect }), ...more });
  const refused = error?.status === 409 && (error.body.back_test ?? null) !== null;
  const unchosen = effect.includes('');
  const confirm = (label, name, more) => (
    <AdoptButton
      state={state}
      action={label}
      class={name}
      title={`Change the model of ${job.robot_id}?`}
      disabled={unchosen}
      onConfirm={() => ask('adopt', more)}
    >
      <p>
        A new version replaces version {robot.value?.model_version},{' '}
        {more.force
          ? 'regardless of the back-test'
          : 'if the back-test on other missions shows an improvement'}
        . Every earlier version can be put in force again.
      </p>
      <Changes of={changesFor(job, robot.value, effect)} />
    </AdoptButton>
  );
  return (
    <>
      {adopted !== null && (
        <p class="verdict-box" role="status">
          Version {adopted} is in force for <a href={robotLink(job.robot_id)}>{job.robot_id}</a>: planning and
          autonomy use it now, the meter from the next mission on.
        </p>
      )}
      {refusal && (
        <p class="failure">
          <b>Not recommended:</b> {refusal}.
        </p>
      )}
      {test && <BackTest test={test} />}
      {refused && (
        <p class="failure" role="alert">
          <b>Not adopted:</b> it does not improve the model on these missions.
        </p>
      )}
      {error && !refused && <Failure error={error} />}
      {adopted === null && (
        <div class="row wrap tools adopt" style={{ marginTop: '14px' }}>
          {groups.map((g) => (
            <SelectField
              key={g.id}
              label="Adopt which of these"
              value={chosen[g.id]}
              onChange={(id) => setChosen({ ...chosen, [g.id]: id })}
              options={optionsOf(g)}
            />
          ))}
          <TestButton state={state} ask={ask} disabled={unchosen} />
          {!refusal && confirm('Adopt', 'primary', {})}
          {(refused || refusal) && confirm('Adopt anyway', '', { force: true })}
        </div>
      )}
    </>
  );
}
