// A robot's gap over its missions, its model versions, and robots of its kind.
import { useMemo, useState } from 'preact/hooks';
import { idPath, query, useGet } from '../api.js';
import { Bars } from '../bars.jsx';
import { Chart, axis, clockAxis, dots, line, timesWith } from '../chart.jsx';
import { ConfirmButton } from '../dialog.jsx';
import { strokeThrough } from '../floor.jsx';
import * as format from '../format.js';
import { robotLink } from '../route.js';
import { palette } from '../theme.js';
import { Button, Empty, Failure, Key, Panel } from '../widgets.jsx';
import { AdoptButton, BackTest, TestButton, useAdoption } from './adopt.jsx';
import { Changes, changesOf } from './changes.jsx';
import { origins } from './audit.jsx';
import { JobRows, share } from './jobs.jsx';

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
      <p class="row wrap tools">
        <TestButton state={state} ask={ask} />
        <AdoptButton
          state={state}
          class="primary"
          title={`Adopt proposal ${p.id}?`}
          onConfirm={() => ask('adopt', { expected_version: inForce.model_version })}
        >
          <p>
            {robot} gets a new model version in place of version {inForce.model_version}, if the back-test on
            other missions shows an improvement:
          </p>
          <Changes of={changes} />
        </AdoptButton>
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
      {id && ['From ', <a href={`#/gap/${id}`}>diagnosis {id}</a>, '.']} {tested}{' '}
      {forced && <span class="flag">forced</span>}
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

function Versions({ versions, robot, onChange }) {
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

const medianMissions = 9;

function median(values) {
  const sorted = [...values].sort((a, b) => a - b);
  const half = sorted.length >> 1;
  return sorted.length % 2 === 1 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

const changeOf = (d) => format.signed(share(d.ratio_after - d.ratio_before));

// Measured over modelled energy of each mission with a running median, drifts and new model versions.
function RatioChart({ history }) {
  const { missions, drift, versions } = history;
  const data = useMemo(() => {
    const ratio = missions.map((m) => m.ratio);
    return [
      missions.map((m) => m.start_utime_us / 1e6),
      ratio,
      ratio.map((_, k) => (k < 2 ? null : median(ratio.slice(Math.max(0, k + 1 - medianMissions), k + 1)))),
    ];
  }, [missions]);
  if (missions.length === 0) return <Empty title="No finished mission with a measured battery yet" />;
  const drawMarks = (u) => {
    const c = u.ctx;
    const p = palette();
    const y1 = u.valToPos(1, 'y', true);
    const px = devicePixelRatio;
    const { left, top, width, height } = u.bbox;
    const line = (at, colour, text, row, dash) => {
      const x = u.valToPos(at / 1e6, 'x', true);
      if (x < left || x > left + width) return;
      c.setLineDash(dash.map((d) => d * px));
      strokeThrough(c, colour, px, x, top, x, top + height);
      c.fillStyle = colour;
      const room = c.measureText(text).width + 8 * px;
      c.fillText(text, x + room > left + width ? x - room : x + 4 * px, top + row * 14 * px);
    };
    c.save();
    c.font = `${11 * px}px "Liberation Sans", Arial, sans-serif`;
    strokeThrough(c, p.muted, px, left, y1, left + width, y1);
    // A version counts from the first mission that it metered: replayed missions are older than the version.
    for (const v of versions) {
      const first = missions.find((m) => m.model_version === v.model_version);
      if (first !== undefined) line(first.start_utime_us, p.muted, `v${v.model_version}`, -0.3, []);
    }
    drift.forEach((d, k) => line(d.start_utime_us, p.gap, changeOf(d), 1 + (k % 3), [4, 3]));
    c.restore();
  };
  const spread = Math.max(0.05, ...data[1].map((v) => Math.min(0.6, Math.abs(v - 1)))) * 1.15;
  const make = (p) => ({
    scales: {
      x: { time: true, ...timesWith((spanS) => Math.max(60, 0.02 * spanS)) },
      y: { range: () => [1 - spread, 1 + spread] },
    },
    axes: [axis('', clockAxis), axis('measured / modelled', { size: 56 })],
    series: [{}, dots(p.measured, 7, 1.5), line(p.gap, 2, { spanGaps: true })],
    cursor: { show: false },
    hooks: { drawAxes: [drawMarks] },
  });
  const last = data[2][data[2].length - 1] ?? median(data[1]);
  const drifts = drift.map((d) => `${format.time(d.start_utime_us)}: ${changeOf(d)}`).join('; ');
  return (
    <>
      <Chart
        make={make}
        data={data}
        height={240}
        changes={[history]}
        label={`Measured over modelled energy of ${missions.length} missions; running median now ${format.fixed(last, 3)}; ${drift.length} drifts${drifts && `: ${drifts}`}`}
      />
      <p class="note foot">
        <Key of={{ 'measured dot': 'mission', gap: `median of the last ${medianMissions},` }} />
        now <b>{format.fixed(last, 3)}</b>; solid vertical lines: new model versions; dashed:{' '}
        {drift.length === 0 ? 'drifts (none)' : format.count(drift.length, 'drift')}.
      </p>
    </>
  );
}

// Of the ratios of one kind, in order: this robot, the outlying ones and those with the largest departures.
const mostSiblings = 12;
function chosenOf(siblings, id) {
  const off = (s) =>
    s.robot_id === id ? Infinity : (s.stands_out ? 1 : 0) + Math.min(0.9, Math.abs(s.ratio - 1));
  const kept = new Set([...siblings].sort((a, b) => off(b) - off(a)).slice(0, mostSiblings));
  return siblings.filter((s) => kept.has(s));
}

function Siblings({ siblings, id }) {
  const [whole, setWhole] = useState(false);
  const here = siblings.some((s) => s.robot_id === id);
  if (siblings.length <= (here ? 1 : 0))
    return <Empty title="No other robot of this kind has missions yet" />;
  const offs = siblings.flatMap(({ ci }) => ci.map((v) => Math.abs(v - 1)));
  const off = Math.max(0.02, ...offs.filter(Number.isFinite));
  const at = (v) => `${50 + 50 * Math.max(-1, Math.min(1, (v - 1) / off))}%`;
  const some = whole || siblings.length <= mostSiblings ? siblings : chosenOf(siblings, id);
  return (
    <>
      <Bars
        class="siblings"
        head={['Robot', 'Interval', 'Ratio']}
        rows={some.map((s) => ({
          key: s.robot_id,
          class: s.robot_id === id ? 'this' : '',
          name: [
            s.robot_id === id ? <b>{id}</b> : <a href={robotLink(s.robot_id)}>{s.robot_id}</a>,
            s.stands_out && [' ', <span class="flag">stands out</span>],
          ],
          bar: (
            <svg width="100%" height="16" aria-hidden="true">
              <line x1="50%" x2="50%" y1="0" y2="16" stroke="var(--line)" />
              <line x1={at(s.ci[0])} x2={at(s.ci[1])} y1="8" y2="8" stroke="var(--ink)" stroke-width="1.5" />
              <circle cx={at(s.ratio)} cy="8" r="4" class={`account ${s.stands_out ? 'gap' : 'measured'}`} />
            </svg>
          ),
          of: format.fixed(s.ratio, 3),
        }))}
      />
      <p class="note foot">
        Median of measured over modelled energy of each robot's newest missions, with its 95 % interval; the
        line is 1.{!here && ` ${id} has too few missions with its model in force.`}
      </p>
      {siblings.length > mostSiblings && (
        <Button aria-expanded={String(whole)} onClick={() => setWhole(!whole)}>
          {whole ? 'Show fewer' : `Show all ${siblings.length}`}
        </Button>
      )}
    </>
  );
}

// `turn` changes when the model in force may have changed.
export function RobotHistory({ id, turn, onChange }) {
  const history = useGet(`/v1/robots/${idPath(id)}/gap-history?limit=500`, turn);
  const versions = useGet(`/v1/robots/${idPath(id)}/models`, turn);
  const jobs = useGet(`/v1/diagnoses${query({ robot_id: id, limit: 5 })}`);
  return (
    <>
      <div class="columns">
        <Panel
          class="screen"
          title="Measured over modelled energy"
          aside={<a href={`#/gap${query({ robot: id })}`}>Diagnose the gap</a>}
          of={history}
          what="the history"
        >
          {(h) => <RatioChart history={h} />}
        </Panel>
        <Panel title="Robots of this kind" of={history} what="robots of this kind">
          {(h) => <Siblings siblings={h.siblings} id={id} />}
        </Panel>
      </div>
      <div class="columns">
        <Panel
          title="Diagnoses"
          aside={<a href={`#/gap${query({ robot: id })}`}>All of {id}</a>}
          of={jobs}
          what="diagnoses"
          from={(j) => j.diagnoses}
          none="No diagnosis yet"
        >
          {(rows) => <JobRows jobs={rows} withRobot={false} />}
        </Panel>
        <Panel title="Model versions" of={versions} what="models">
          {(v) => <Versions versions={v.models} robot={id} onChange={onChange} />}
        </Panel>
      </div>
    </>
  );
}
