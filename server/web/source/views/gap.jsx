// Diagnoses of the gap: start one, follow it, list them.
import { useEffect, useState } from 'preact/hooks';
import { del, post, query, useGet } from '../api.js';
import * as format from '../format.js';
import { useLive, useModelled } from '../live.js';
import { useRatios } from '../models.js';
import { robotLink } from '../route.js';
import { Answer, Button, Empty, Failure, Heading, Options, Panel, useTitleOf } from '../widgets.jsx';
import { Adopt } from './adopt.jsx';
import { Field } from './choosing.jsx';
import { Result } from './diagnosis.jsx';
import { JobRows, State, stateNotes } from './jobs.jsx';

const adoptable = ({ result, model }) =>
  result.adoption ? result.adoption.effects.length > 0 : model !== null;
const ended = (d) => d.state !== 'queued' && d.state !== 'running';

// Follows a job that waits or runs; `onEnd` when it has ended.
function useProgress(job, onEnd) {
  const [progress, setProgress] = useState(null);
  const id = job && !ended(job) ? job.id : null;
  useEffect(() => {
    if (id === null) return undefined;
    const source = new EventSource(`/v1/diagnoses/${id}/events`);
    source.addEventListener('progress', (event) => setProgress(JSON.parse(event.data)));
    source.addEventListener('ended', () => {
      source.close();
      onEnd();
    });
    return () => source.close();
  }, [id]);
  return progress !== null && progress.id === id ? progress : job;
}

function Progress({ job, onEnd }) {
  const now = useProgress(job, onEnd);
  const [error, setError] = useState(null);
  const part = Math.round(100 * now.progress);
  const elapsedS = (Date.now() - job.started_utime_us / 1000) / 1000;
  const left = part > 0 ? `, about ${format.about((elapsedS * (100 - part)) / part)} left` : '';
  const words =
    now.state === 'queued'
      ? now.ahead > 0
        ? `${format.count(now.ahead, 'diagnosis', 'diagnoses')} before it`
        : 'about to start'
      : `${part} %${left}`;
  return (
    <div class="row wrap progress">
      <label for="progress" style={{ flexBasis: '100%' }}>
        Diagnosis {job.id} of {job.robot_id}: {stateNotes[now.state]}, {words}
      </label>
      <progress id="progress" max="100" value={now.state === 'queued' ? undefined : part} />
      <Button needs="operate" onClick={() => del(`/v1/diagnoses/${job.id}`).catch(setError)}>
        Cancel
      </Button>
      {error && <Failure error={error} />}
    </div>
  );
}

const Group = ({ name, ids }) =>
  ids.length > 0 && (
    <optgroup label={name}>
      <Options of={ids} />
    </optgroup>
  );

function Start({ given }) {
  const live = useLive();
  const robots = useModelled();
  const [robot, setRobot] = useState(given.robot ?? '');
  const [missions, setMissions] = useState('50');
  const [busy, setBusy] = useState(false);
  const [error, setError] = useState(null);
  const newest = useGet('/v1/missions?state=finished&limit=200');
  const lately = new Set(newest.value?.missions.map((m) => m.robot_id));
  const driven = robots.filter((id) => lately.has(id));
  const others = robots.filter((id) => !lately.has(id));
  const ratios = useRatios(driven);
  const departure = (id) => Math.abs((ratios.get(id) ?? 1) - 1);
  const [likeliest] = [...driven].sort((a, b) => departure(b) - departure(a));
  const chosen = robot || (newest.loading ? '' : (likeliest ?? robots[0] ?? ''));
  const past = useGet(chosen && `/v1/mission-totals${query({ robot_id: chosen, state: 'finished' })}`);
  const count = chosen && past.value !== null && !past.loading ? past.value.missions : null;
  const start = async (event) => {
    event.preventDefault();
    setBusy(true);
    setError(null);
    const body = { robot_id: chosen, max_missions: Number(missions) };
    const open = ({ id }) => {
      location.hash = `#/gap/${id}`;
    };
    await post('/v1/diagnoses', body).then(open, setError);
    setBusy(false);
  };
  if (live.loaded && robots.length === 0)
    return (
      <Empty title="No robot has a model yet">
        The gap is measured minus modelled energy: <a href="#/robot-file">add a robot</a>.
      </Empty>
    );
  return (
    <form class="wrap filters" onSubmit={start}>
      <Field label="Robot">
        <select value={chosen} onChange={(e) => setRobot(e.currentTarget.value)}>
          <Group name="Recent missions" ids={driven} />
          <Group name="Others" ids={others} />
        </select>
      </Field>
      <Field label="Missions, newest">
        <input
          class="short"
          type="number"
          min="1"
          max="1000"
          required
          value={missions}
          onInput={(e) => setMissions(e.currentTarget.value)}
        />
      </Field>
      <Button type="submit" class="primary" disabled={busy || !count} needs="operate">
        Diagnose
      </Button>
      <p class="note" role="status">
        {count > 0 && `${format.count(count, 'finished mission')}. `}
        {count === 0
          ? `${chosen} has no finished mission yet: there is nothing to diagnose.`
          : 'Every fourth is held out to test the result.'}
      </p>
      {error && <Failure error={error} />}
    </form>
  );
}

function All({ given }) {
  const jobs = useGet(`/v1/diagnoses${query({ robot_id: given.robot, limit: 50 })}`);
  const running =
    jobs.value?.diagnoses.find((d) => d.state === 'running') ??
    jobs.value?.diagnoses.findLast?.((d) => d.state === 'queued');
  return (
    <>
      <Heading title="Gap between robot and model" />
      <Start given={given} />
      {running && <Progress key={running.id} job={running} onEnd={jobs.reload} />}
      <Panel
        title={given.robot ? `Diagnoses of ${given.robot}` : 'Diagnoses'}
        aside={given.robot && <a href="#/gap">All robots</a>}
        of={jobs}
        what="diagnoses"
        from={(list) => list.diagnoses}
        none="No diagnosis yet"
        more="A diagnosis shows where measured power departs from the model, and which effects the model lacks."
      >
        {(rows) => <JobRows jobs={rows} />}
      </Panel>
    </>
  );
}

function One({ id }) {
  useTitleOf(`Diagnosis ${id}`);
  const job = useGet(`/v1/diagnoses/${encodeURIComponent(id)}`);
  const missing = (
    <Empty title={`There is no diagnosis ${id}`}>
      See <a href="#/gap">all diagnoses</a>.
    </Empty>
  );
  return (
    <Answer of={job} what="the diagnosis" missing={missing}>
      {(d) => (
        <>
          <Heading title={`Diagnosis ${d.id}`} crumbs={<a href="#/gap">Gap</a>}>
            <span>
              <a href={robotLink(d.robot_id)}>{d.robot_id}</a>
            </span>{' '}
            <State of={d} />
            <span class="note">
              {format.time(d.created_utime_us)}
              {d.model_version !== null && ` · model version ${d.model_version}`}
            </span>
            <span class="spring" />
            {d.state === 'done' && (
              <Button href={`/v1/diagnoses/${d.id}/report`} target="_blank" rel="noopener">
                Report as a file
              </Button>
            )}
          </Heading>
          {!ended(d) && <Progress key={d.id} job={d} onEnd={job.reload} />}
          {d.error && <Failure error={{ title: stateNotes[d.state], message: d.error }} />}
          {d.result && <Result result={d.result}>{adoptable(d) && <Adopt job={d} />}</Result>}
        </>
      )}
    </Answer>
  );
}

export const Gap = ({ id, given }) => (id ? <One id={id} /> : <All given={given} />);
