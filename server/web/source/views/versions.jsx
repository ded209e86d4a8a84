// A robot's model versions: the origin and changes of each, and its reactivation.
import { ConfirmButton } from '../confirm.jsx';
import * as format from '../format.js';
import { Failure } from '../widgets.jsx';
import { useAdoption } from './back_test.jsx';
import { Changes, changesOf } from './changes.jsx';
import { origins } from './events.jsx';
import { share } from './jobs.jsx';

function Evidence({ of: { back_test: test, forced, diagnosis_id: id } }) {
  const tested =
    test.missions.length > 0
      ? `Energy error on ${test.missions.length} other missions: ${share(test.error_before, 2)} before, ${share(test.error_after, 2)} after.`
      : 'Not tested: there was no mission to test it on.';
  return (
    <p class="note">
      {id && (
        <>
          From <a href={`#/gap/${id}`}>diagnosis {id}</a>.{' '}
        </>
      )}
      {tested} {forced && <span class="flag">forced</span>}
    </p>
  );
}

function Version({ of: v, versions, robot, busy, onActivate }) {
  const parent = versions.find((other) => other.model_version === (v.parent_version ?? v.model_version - 1));
  const active = versions.find((other) => other.active);
  const number = v.model_version;
  return (
    <li class={v.active ? 'active' : ''}>
      <p>
        <b>Version {number}</b> {v.active && <span class="flag calm">in force</span>}{' '}
        <span class="note">
          {format.time(v.created_utime_us)} · from {origins[v.origin] ?? format.words(v.origin)}
        </span>
      </p>
      {v.note && !v.evidence?.diagnosis_id && <p class="note">{v.note}</p>}
      {v.evidence && <Evidence of={v.evidence} />}
      {parent && <Changes of={changesOf(v.model, parent.model)} />}
      {!v.active && (
        <ConfirmButton
          label={busy === number ? 'Putting in force …' : `Put version ${number} in force again`}
          action={`Put version ${number} in force`}
          title={`Put version ${number} of ${robot} in force again?`}
          disabled={busy !== ''}
          needs="operate"
          onConfirm={() => onActivate(number)}
        >
          <p>
            It replaces version {active?.model_version}, without a back-test. Planning uses it at once, the
            meter from the next mission on.
          </p>
          <Changes of={changesOf(v.model, active?.model)} />
        </ConfirmButton>
      )}
    </li>
  );
}

export function Versions({ versions, robot, onChange }) {
  const [state, ask] = useAdoption(robot);
  const activate = async (version) => {
    if (await ask(version, { version })) onChange();
  };
  return (
    <>
      {state.error && <Failure error={state.error} />}
      <ol class="versions">
        {versions.map((v) => (
          <Version
            key={v.model_version}
            of={v}
            versions={versions}
            robot={robot}
            busy={state.busy}
            onActivate={activate}
          />
        ))}
      </ol>
    </>
  );
}
