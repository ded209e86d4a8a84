// A robot's models: the service's proposals, and the versions with the origin and changes of each.
import { idPath, useGet } from '../api.js';
import { ConfirmButton } from '../dialog.jsx';
import * as format from '../format.js';
import { Failure, Panel } from '../widgets.jsx';
import { BackTest, TestButton, useAdoption } from './back_test.jsx';
import { Changes, changesOf } from './changes.jsx';
import { origins } from './events.jsx';
import { share } from './jobs.jsx';

const kinds = { calibration: 'Calibration from recent missions', diagnosis: 'From a diagnosis' };

function parameterChanges(p, inForce) {
  const parameters = p.detail?.parameters;
  if (!Array.isArray(parameters)) return changesOf(p.model, inForce.model);
  return parameters.map(({ name, in_force: from, value, sd, unit }) => ({
    key: name,
    from: `${format.digits(from)} ${unit}`,
    to: `${format.withDeviation(value, sd)} ${unit}`,
  }));
}

function Proposal({ of: p, robot, inForce, onChange }) {
  const [state, askFor] = useAdoption(robot, p.detail?.back_test ?? null);
  const ask = async (kind, body) => {
    if (await askFor(kind, { proposal_id: p.id, ...body })) onChange();
  };
  const changes = parameterChanges(p, inForce);
  const busy = state.busy !== '';
  return (
    <li class="active">
      <p>
        <b>{kinds[p.kind] ?? format.words(p.kind)}</b>{' '}
        <span class="note">
          {format.time(p.created_utime_us)} · {p.note}
        </span>
      </p>
      <Changes of={changes} />
      {state.test && <BackTest test={state.test} />}
      {state.error && <Failure error={state.error} />}
      <p class="tools">
        <TestButton
          busy={state.busy === 'test'}
          disabled={busy}
          onClick={() => ask('test', { dry_run: true })}
        />
        <ConfirmButton
          label={state.busy === 'adopt' ? 'Testing and adopting …' : 'Adopt'}
          action="Adopt"
          class="primary"
          title={`Adopt proposal ${p.id}?`}
          disabled={busy}
          needs="operate"
          onConfirm={() => ask('adopt', { expected_version: inForce.model_version })}
        >
          <p>
            {robot} gets a new model version in place of version {inForce.model_version}, if the back-test on
            other missions shows an improvement:
          </p>
          <Changes of={changes} />
        </ConfirmButton>
      </p>
    </li>
  );
}

// `turn` changes when the model in force may have changed.
export function Proposals({ id, inForce, turn, onChange }) {
  const list = useGet(`/v1/robots/${idPath(id)}/proposals?limit=20`, turn);
  if (inForce === null || !list.value?.proposals.length) return null;
  const open = list.value.proposals.filter((p) => p.closed_reason === null);
  const closed = list.value.proposals.filter((p) => p.closed_reason !== null);
  return (
    <Panel title={open.length === 1 ? 'A better model is proposed' : 'Proposed models'}>
      {open.length === 0 && <p class="note">No proposal is open.</p>}
      <ol class="versions">
        {open.map((p) => (
          <Proposal key={p.id} of={p} robot={id} inForce={inForce} onChange={onChange} />
        ))}
      </ol>
      {closed.length > 0 && (
        <details>
          <summary>{format.count(closed.length, 'closed proposal')}</summary>
          <ol class="versions">
            {closed.map((p) => (
              <li key={p.id}>
                <b>{kinds[p.kind] ?? format.words(p.kind)}</b>{' '}
                <span class="note">{format.time(p.created_utime_us)}</span> – {p.closed_reason}
              </li>
            ))}
          </ol>
        </details>
      )}
    </Panel>
  );
}

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
        <b>Version {number}</b> {v.active && <span class="flag good">in force</span>}{' '}
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
