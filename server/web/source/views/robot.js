import { useEffect, useState } from 'preact/hooks';
import { html } from '../html.js';
import * as format from '../format.js';
import { id_path, query, useGet } from '../api.js';
import { FloorPath } from '../floor.js';
import { useLive } from '../live.js';
import { Sparkline } from '../sparkline.js';
import { useTheme } from '../theme.js';
import { mission_link } from '../route.js';
import { Answer, Empty, Panel, Readout, useTitleOf } from '../widgets.js';
import { Health, between, charge_note, now, since } from './fleet.js';
import { flat } from './flat.js';
import { Later } from './later.js';
import { MissionRows } from './missions.js';

const recent_rows = 12;

function Model({ model }) {
  return html`<details class="model"><summary>Parameters in force</summary>
    <table class="facts"><tbody>${Object.entries(flat(model)).filter(([key]) => key !== 'robot_id').map(([key, value]) => html`<tr key=${key}><th scope="row"><code>${key}</code></th><td>${value}</td></tr>`)}</tbody></table></details>`;
}

// Where the robot is and was: the running mission's trace so far, then what is heard live.
function LiveMap({ entry }) {
  const mission = entry.state.mission?.id;
  const begun = useGet(mission ? `/v1/missions/${mission}/trace?points=600` : null);
  const [joined] = useState({ mission: null, rows: [] });
  if (joined.mission !== mission) Object.assign(joined, { mission, rows: [] });
  const heard = entry.path.last();
  const before = mission && begun.value && begun.value.id === mission
    ? begun.value.x_m.map((x, k) => [x ?? NaN, begun.value.y_m[k] ?? NaN, begun.value.measured_power_w.mean[k] ?? begun.value.modelled_power_w.mean[k] ?? NaN]) : [];
  const rows = [...before, ...heard.map(([x, y, , w]) => [x, y, w])];
  const [x, y, heading] = entry.state.pose;
  if (rows.length === 0 || x === null) return html`<${Empty} title="No position">${entry.state.silent_s === null ? 'Nothing heard yet.' : 'This robot does not tell where it is.'}<//>`;
  return html`<${FloorPath} points=${rows} height=${340} ends=${false} robot=${[x, y, heading ?? 0]} label=${`Path of ${entry.id} so far, coloured by power, and where it is now`} />`;
}

export function Robot({ id }) {
  useTitleOf(id);
  const live = useLive(), dark = useTheme();
  const detail = useGet(`/v1/robots/${id_path(id)}`);
  const missions = useGet(`/v1/missions${query({ robot_id: id, limit: recent_rows })}`);
  const entry = live.robots.get(id), s = entry?.state;
  const running = s?.mission?.id;
  useEffect(() => {
    if (missions.value !== null) missions.reload();
  }, [running]);
  if (!s && live.loaded && detail.error?.status === 404) return html`<${Empty} title=${`There is no robot ${id}`}>See the <a href="#/fleet">fleet</a>.<//>`;
  return html`
    <div class="heading"><p class="crumbs"><a href="#/fleet">Fleet</a></p><h1>${id}</h1>
      ${s && html`<span class="health"><${Health} state=${s} /></span>`}
      <span class="spring"></span><a class="button" href=${`#/plan${query({ robot: id })}`}>Plan a drive</a></div>
    ${s && s.silent_s === null && html`<p class="note">Nothing was heard of it since the service started. What is kept of it stands below.</p>`}
    ${s && s.silent_s !== null && !s.live && html`<p class="note">Silent since ${since(s.heard_us)}: what it draws and how fast it is are not known. The rest is as it was last heard.</p>`}
    ${s && s.silent_s !== null && html`<dl class="readouts">
      <${Readout} large label=${s.measured_power_w === null ? 'Power (modelled)' : 'Power'} of=${format.power(now(s, s.measured_power_w ?? s.modelled_power_w))} channel=${s.measured_power_w === null ? 'modelled' : 'measured'} note=${html`<${Sparkline} track=${entry.power} revision=${entry.revision} dark=${dark} width=${120} height=${26} />`} />
      <${Readout} large label="Charge" of=${format.percent(s.state_of_charge)} note=${[s.state_of_charge === null ? '' : charge_note(s).text, s.battery_voltage_v === null ? '' : format.text(format.unit(s.battery_voltage_v, 'V', 2))].filter(Boolean).join(' · ')} />
      <${Readout} large label="Range" of=${format.length(s.range_m)} note=${between(s.range_quantiles_m, format.length_band)} />
      <${Readout} large label="Run time" of=${format.about(s.run_time_s)} note=${between(s.run_time_quantiles_s, (low, high) => `${format.about(low)} – ${format.about(high)}`)} />
      ${s.charging === null && format.known(s.charge.time_to_charged_s) && html`<${Readout} large label="To charge" of=${format.about(s.charge.time_to_charged_s)} note="if it went now" />`}
      <${Readout} large label="Speed" of=${format.unit(now(s, s.speed_m_s), 'm/s', 2)} />
      <${Readout} large label="Payload" of=${format.unit(s.payload_kg, 'kg')} />
      <${Readout} large label="Windings, right · left" of=${s.winding_temperature_c[0] === null ? '–' : `${format.fixed(s.winding_temperature_c[0])} · ${format.fixed(s.winding_temperature_c[1])} °C`} />
      <${Readout} large label="Mission" of=${format.energy(s.mission?.energy.battery_j)} note=${s.mission ? html`<a href=${mission_link(s.mission.id)}>${s.mission.mission_id}</a>` : 'none running'} />
    </dl>`}
    ${(s || detail.value) && html`<${Later} part="RobotHistory" id=${id} />`}
    <${Panel} title="Recent missions" aside=${html`<a href=${`#/missions${query({ robot: id })}`}>All missions of ${id}</a>`}><${Answer} of=${missions} what="missions">${(page) =>
      page.missions.length === 0 ? html`<${Empty} title="No mission yet" />` : html`<div class="scroll"><${MissionRows} missions=${page.missions} with_robot=${false} /></div>`}<//><//>
    <div class="columns">
      <${Panel} class="screen" title=${s?.live === false ? 'On the floor, as last heard' : 'On the floor now'}>${entry ? html`<${LiveMap} entry=${entry} />` : html`<${Empty} title="Never heard" />`}<//>
      <${Panel} title="Model">${detail.value ? html`<${Model} model=${detail.value.model} />` : html`<p class="note">none</p>`}<//>
    </div>`;
}
