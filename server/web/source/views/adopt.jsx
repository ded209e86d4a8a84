// Adoption of the effects found by a diagnosis: a choice among confounded effects, a back-test and a
// confirmation.
import { useState } from 'preact/hooks';
import { idPath, useGet } from '../api.js';
import { ConfirmButton } from '../dialog.jsx';
import * as format from '../format.js';
import { robotLink } from '../route.js';
import { Failure } from '../widgets.jsx';
import { BackTest, TestButton, useAdoption } from './back_test.jsx';
import { Changes, changesOf } from './changes.jsx';
import { SelectField } from './choosing.jsx';
import { effectName } from './jobs.jsx';

// One of several effects that the data do not distinguish.
function ChooseEffect({ of, value, onChange }) {
  const ids = [of.id, ...of.instead.filter((e) => Object.keys(e.parameters).length > 0).map((e) => e.id)];
  const options = [['', 'choose one'], ...ids.map((id) => [id, effectName(id)])];
  return <SelectField label="Adopt which of these" value={value} onChange={onChange} options={options} />;
}

// The changes of the adoption: those of the diagnosed model, or the parameters of the chosen effects.
function changesFor(job, robot, chosen) {
  if (chosen.length === 0) return changesOf(job.model, robot?.model);
  const all = job.result.adoption.effects.flatMap((e) => [e, ...e.instead]);
  return chosen
    .map((id) => all.find((e) => e.id === id))
    .flatMap((e) =>
      Object.entries(e?.parameters ?? {}).map(([name, value]) => [`effects.${e.id}.${name}`, value]),
    )
    .map(([key, value]) => ({ key, from: null, to: format.digits(value, 4) }));
}

function Messages({ job, state, refusal, refused }) {
  const { adopted, test, error } = state;
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
    </>
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
  const ask = (busy, more) =>
    askFor(busy, { diagnosis_id: job.id, ...(effect.length > 0 && { effect }), ...more });
  const refused = state.error?.status === 409 && (state.error.body?.back_test ?? null) !== null;
  const hold = state.busy !== '' || effect.includes('');
  const confirm = (label, name, more) => (
    <ConfirmButton
      label={state.busy === 'adopt' ? 'Testing and adopting …' : label}
      action={label}
      class={name}
      title={`Change the model of ${job.robot_id}?`}
      disabled={hold}
      needs="operate"
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
    </ConfirmButton>
  );
  return (
    <>
      <Messages job={job} state={state} refusal={refusal} refused={refused} />
      {state.adopted === null && (
        <div class="tools adopt">
          {groups.map((g) => (
            <ChooseEffect
              key={g.id}
              of={g}
              value={chosen[g.id] ?? ''}
              onChange={(id) => setChosen({ ...chosen, [g.id]: id })}
            />
          ))}
          <TestButton
            busy={state.busy === 'test'}
            disabled={hold}
            onClick={() => ask('test', { dry_run: true })}
          />
          {!refusal && confirm('Adopt', 'primary', {})}
          {(refused || refusal) && confirm('Adopt anyway', '', { force: true })}
        </div>
      )}
    </>
  );
}
