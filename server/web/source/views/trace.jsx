// A mission over time and on the floor: power, speed, path, and every sample of the motors when zoomed.
import { useMemo, useRef, useState } from 'preact/hooks';
import { query, useGet } from '../api.js';
import { Chart, axis, lastAt, line, runAxis, withAlpha, withGaps } from '../chart.jsx';
import { FloorPath, powerAt, rowsOf } from '../floor.jsx';
import * as format from '../format.js';
import { useChoices } from '../route.js';
import { Answer, Button, Choice, Empty, Key, Panel, Readouts } from '../widgets.jsx';

// Every stored sample of the motors and the battery, over the whole mission or the part that is zoomed to.
const mostSamples = 20_000;
const mostS = 400; // at 50 Hz

const quantities = {
  voltage: ['Voltage', 'motor voltage, V', 'motor_voltage_v'],
  current: ['Current', 'motor current, A', 'motor_current_a'],
  speed: ['Wheel speed', 'wheel speed, rad/s', 'wheel_velocity_rad_s'],
  temperature: ['Temperature', 'winding temperature, °C', 'motor_temperature_c'],
};

function Sides({ telemetry, mission, quantity }) {
  const [, label, column] = quantities[quantity];
  const name = `${label} of both motors over time`;
  const [right, left] = telemetry[column];
  const data = useMemo(
    () => [telemetry.utime_us.map((t) => (t - mission.start_utime_us) / 1e6), right, left],
    [telemetry, quantity],
  );
  if (!right.some((v) => v !== null) && !left.some((v) => v !== null))
    return <Empty title="Not measured">This robot does not report it.</Empty>;
  const make = (p) => ({
    axes: [runAxis('time since the start'), axis(label, { size: 56 })],
    series: [{}, line(p.accent, 1.25), line(p.measured, 1.25)],
  });
  return (
    <>
      <Chart make={make} data={data} height={200} changes={[quantity]} label={name} />
      <p class="note foot">
        <Key of={{ accent: 'right', measured: 'left' }} />
        {telemetry.utime_us.length} samples as received
        {telemetry.next_cursor !== null && ', the first of this part'}.
      </p>
    </>
  );
}

function Motors({ mission, zoom, window }) {
  const [shown, setShown] = useState(false);
  const [quantity, setQuantity] = useState('voltage');
  const [from, to] = zoom ?? [0, mission.energy.duration_s];
  const short = to - from <= mostS;
  const path = `/v1/missions/${mission.id}/telemetry${query({ ...window, limit: mostSamples })}`;
  const telemetry = useGet(shown && short ? path : null);
  const options = Object.fromEntries(Object.entries(quantities).map(([key, [name]]) => [key, name]));
  return (
    <Panel
      class="screen"
      title="Motors"
      aside={
        <>
          {shown && <Choice label="Quantity" value={quantity} onChange={setQuantity} options={options} />}
          <Button aria-expanded={String(shown)} onClick={() => setShown(!shown)}>
            {shown ? 'Hide' : 'Show samples'}
          </Button>
        </>
      }
    >
      {shown && !short && (
        <Empty title="Too long for single samples">Zoom the power chart to {mostS} s or less.</Empty>
      )}
      {shown && short && (
        <Answer of={telemetry} what="samples">
          {(t) =>
            t.utime_us.length === 0 ? (
              <Empty title="No samples stored">They are older than the retention of telemetry.</Empty>
            ) : (
              <Sides telemetry={t} mission={mission} quantity={quantity} />
            )
          }
        </Answer>
      )}
    </Panel>
  );
}

const tracePoints = 700;
// Columns of bands for the chart, with an empty row where the trace pauses, so that no line bridges it.
function withPauses({ start_utime_us: starts, width_us: width }, startUs, ...bands) {
  const times = withGaps(starts, 1.9 * width);
  const rows = new Map(starts.map((t, k) => [t, k]));
  const columns = bands.flatMap((band) => [band.max, band.min, band.mean]);
  return [
    times.map((t) => (t - startUs + width / 2) / 1e6),
    ...columns.map((column) => times.map((t) => column[rows.get(t)] ?? null)),
  ];
}

function Charts({ trace, mission, setZoom, setCursor }) {
  const [power, speed] = useMemo(() => {
    const of = (...bands) => withPauses(trace, mission.start_utime_us, ...bands);
    return [of(trace.measured_power_w, trace.modelled_power_w), of(trace.speed_m_s)];
  }, [trace]);
  const traceNow = useRef(trace);
  traceNow.current = trace;
  const indexAt = (second) => lastAt(traceNow.current.start_utime_us, mission.start_utime_us + second * 1e6);
  const plots = useRef(new Set());
  const hooks = {
    init: [(u) => plots.current.add(u)],
    destroy: [(u) => plots.current.delete(u)],
    setCursor: [({ data: [t], cursor: { idx } }) => setCursor(format.known(idx) ? indexAt(t[idx]) : null)],
    setSelect: [
      (u) => {
        if (u.select.width < 6) return;
        setZoom([u.posToVal(u.select.left, 'x'), u.posToVal(u.select.left + u.select.width, 'x')]);
        u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
      },
    ],
  };
  const cursor = {
    sync: { key: 'mission' },
    points: { size: 7, width: 1.5 },
    focus: { prox: -1 },
    drag: { x: true, y: false, setScale: false, dist: 6 },
    bind: { dblclick: () => () => setZoom(null) },
  };
  // `quantities(palette)`: [colour, width, opacity of the band from least to greatest].
  const maker = (time, value, quantities) => (p) => {
    const shown = quantities(p);
    const none = line('transparent');
    return {
      cursor,
      hooks,
      axes: [runAxis(time), axis(value)],
      bands: shown.map(([colour, , share], k) => ({
        series: [3 * k + 1, 3 * k + 2],
        fill: withAlpha(colour, share),
      })),
      series: [{}, ...shown.flatMap(([colour, width]) => [none, none, line(colour, width)])],
    };
  };
  const makePower = maker('', 'power, W', (p) => [
    [p.measured, 2.75, 0.2],
    [p.modelled, 1, 0.16],
  ]);
  const makeSpeed = maker('time since the start', 'speed, m/s', (p) => [[p.ink, 1.5, 0.12]]);
  // Keys move the cursor over both charts and zoom around it.
  const at = useRef(0);
  const key = (event) => {
    const [t] = power;
    const far = Math.max(1, Math.round(t.length / 20));
    const step = event.shiftKey ? far : 1;
    const places = {
      ArrowLeft: at.current - step,
      ArrowRight: at.current + step,
      Home: 0,
      End: t.length - 1,
    };
    const to = places[event.key];
    const span = t[t.length - 1] - t[0];
    const here = t[Math.min(at.current, t.length - 1)];
    if (to !== undefined) {
      at.current = Math.max(0, Math.min(t.length - 1, to));
      for (const u of plots.current) u.setCursor({ left: u.valToPos(t[at.current], 'x'), top: 8 });
    } else if (event.key === '+' && span > 4)
      setZoom([Math.max(t[0], here - span / 4), Math.min(t[t.length - 1], here + span / 4)]);
    else if (event.key === '-' || event.key === 'Escape') setZoom(null);
    else return;
    event.preventDefault();
  };
  return (
    <div
      class="charts"
      tabindex="0"
      role="group"
      aria-label="Power and speed over time. Left and right move the cursor, plus zooms in, minus shows the whole mission."
      onKeyDown={key}
    >
      <Chart
        make={makePower}
        data={power}
        height={270}
        label="Battery power over the mission, measured and modelled, with the least and greatest of each span"
      />
      <Chart make={makeSpeed} data={speed} height={150} label="Speed over the mission" />
    </div>
  );
}

function AtCursor({ trace, mission, index }) {
  const at = index !== null && index < trace.start_utime_us.length ? index : null;
  const of = (column, f) => (at === null ? format.none : f(column[at]));
  const measured = trace.measured_power_w;
  const modelled = trace.modelled_power_w;
  const gap = at === null || measured.mean[at] === null ? null : measured.mean[at] - modelled.mean[at];
  const band = gap !== null && `${format.fixed(measured.min[at])} to ${format.fixed(measured.max[at])}`;
  const rows = [
    ['Time', at === null ? '–' : format.span((trace.start_utime_us[at] - mission.start_utime_us) / 1e6)],
    ['Measured', of(measured.mean, format.power), band, 'measured'],
    ['Modelled', of(modelled.mean, format.power), '', 'modelled'],
    ['Gap', format.withSign(format.power(gap)), '', 'gap'],
    ['Speed', of(trace.speed_m_s.mean, (v) => format.unit(v, 'm/s', 2))],
    ['Charge', of(trace.state_of_charge, (v) => format.percent(v, 2))],
  ];
  return <Readouts class="strip" rows={rows} />;
}

// The path on the floor, coloured by power or by the gap, with the place of the charts' cursor.
function PathPanel({ way, trace, cursor, measured, colouring, setColouring }) {
  const path = useMemo(() => {
    const [measured, modelled] = [way.measured_power_w.mean, way.modelled_power_w.mean];
    const gapAt = (k) => (measured[k] === null ? NaN : measured[k] - modelled[k]);
    return rowsOf(way, colouring === 'gap' ? gapAt : (k) => powerAt(way, k) ?? NaN);
  }, [way, colouring]);
  const known = cursor !== null && cursor < trace.start_utime_us.length;
  const here = known ? lastAt(way.start_utime_us, trace.start_utime_us[cursor] + trace.width_us / 2) : null;
  const options = { power: 'Power', ...(measured && { gap: 'Gap' }) };
  const what = colouring === 'gap' ? 'measured minus modelled power' : 'power';
  return (
    <Panel
      class="screen"
      title="Path"
      aside={<Choice label="Colour by" value={colouring} onChange={setColouring} options={options} />}
    >
      {path.some(([x]) => Number.isFinite(x)) ? (
        <>
          <FloorPath
            points={path}
            kind={colouring}
            cursor={here}
            height={440}
            label={`Path of the mission, coloured by ${what}; circle: start, square: end`}
          />
          <p class="note foot">○ start ■ end. Positions as the robot reported them.</p>
        </>
      ) : (
        <Empty title="No positions">This robot did not report its position.</Empty>
      )}
    </Panel>
  );
}

export function TracePanels({ mission, whole, fine, given: asked }) {
  const [given, change] = useChoices(asked);
  const [cursor, setCursor] = useState(null);
  const ends = [given.from, given.to].map(Number);
  const zoom = given.to && ends.every(Number.isFinite) ? ends : null;
  const setZoom = (next) => change({ from: next?.[0].toFixed(2), to: next?.[1].toFixed(2) });
  const utime = (second) => Math.round(mission.start_utime_us + second * 1e6);
  const window = zoom && { from_utime_us: utime(zoom[0]), to_utime_us: utime(zoom[1]) };
  const part = query({ points: tracePoints, ...window });
  const closer = useGet(window && `/v1/missions/${mission.id}/trace${part}`);
  const trace = zoom !== null && closer.value?.start_utime_us.length > 1 ? closer.value : whole;
  const measured = whole.measured_power_w.mean.some((v) => v !== null);
  if (whole.start_utime_us.length === 0)
    return (
      <Panel title="Power">
        <Empty title="No trace stored">The mission ended before its first sample was stored.</Empty>
      </Panel>
    );
  return (
    <>
      <div class="columns trace-columns">
        <Panel
          class="screen"
          title="Power and speed"
          aside={[
            <span class="row note key">
              <Key of={{ measured: 'measured', modelled: 'modelled', band: 'minimum to maximum' }} />
            </span>,
            zoom !== null ? (
              <Button onClick={() => setZoom(null)}>Whole mission</Button>
            ) : (
              <span class="note">drag or press + to zoom</span>
            ),
          ]}
        >
          <Charts trace={trace} mission={mission} setZoom={setZoom} setCursor={setCursor} />
          <AtCursor trace={trace} mission={mission} index={cursor} />
          <p class="note foot">
            Each point covers {format.span(trace.width_us / 1e6)}
            {zoom !== null ? ', zoomed' : ''}.
          </p>
        </Panel>
        <PathPanel
          way={trace === whole ? fine : trace}
          trace={trace}
          cursor={cursor}
          measured={measured}
          colouring={given.colour === 'gap' ? 'gap' : 'power'}
          setColouring={(to) => change({ colour: to === 'gap' ? to : '' })}
        />
      </div>
      <Motors mission={mission} zoom={zoom} window={window} />
    </>
  );
}
