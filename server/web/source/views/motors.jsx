// Every stored sample of the motors and the battery, over the whole mission or the part that is zoomed to.
import { useMemo, useState } from 'preact/hooks';
import { query, useGet } from '../api.js';
import { Chart, axis, line, runAxis } from '../chart.jsx';
import { Answer, Button, Choice, Empty, Key, Panel } from '../widgets.jsx';

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
      <Chart
        make={make}
        data={data}
        height={200}
        changes={[quantity]}
        label={`${label} of both motors over time`}
      />
      <p class="note foot">
        <Key of={{ accent: 'right', measured: 'left' }} />
        {telemetry.utime_us.length} samples as received
        {telemetry.next_cursor !== null && ', the first of this part'}.
      </p>
    </>
  );
}

export function Motors({ mission, zoom }) {
  const [shown, setShown] = useState(false);
  const [quantity, setQuantity] = useState('voltage');
  const [from, to] = zoom ?? [0, mission.energy.duration_s];
  const short = to - from <= mostS;
  const utime = (second) => Math.round(mission.start_utime_us + second * 1e6);
  const window = zoom ? { from_utime_us: utime(from), to_utime_us: utime(to) } : {};
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
