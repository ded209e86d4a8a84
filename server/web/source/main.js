import { render } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import './style.css';
import { clock } from './format.js';
import { html } from './html.js';
import { start_live, useLive } from './live.js';
import { toggle_theme, useTheme } from './theme.js';
import { route_of } from './route.js';
import { Empty, Guard } from './widgets.js';
import { Fleet } from './views/fleet.js';
import { Gap } from './views/later.js';
import { Robot } from './views/robot.js';
import { Missions } from './views/missions.js';
import { Mission } from './views/mission.js';
import { Plan } from './views/plan.js';

const views = { fleet: Fleet, robots: Robot, missions: Missions, mission: Mission, plan: Plan, gap: Gap };

function Link() {
  const live = useLive();
  const name = { live: 'Live', connecting: 'Connecting', offline: 'Offline' }[live.link];
  return html`<span class=${`link ${live.link}`} role="status"><span class="lamp" aria-hidden="true"></span>${name}</span>`;
}

function OfflineBanner() {
  const live = useLive();
  const [late, set_late] = useState(false);
  useEffect(() => {
    set_late(false);
    if (live.link !== 'offline') return undefined;
    const timer = setTimeout(() => set_late(true), 1500);  // a restart of the stream is no news
    return () => clearTimeout(timer);
  }, [live.link]);
  if (!late) return null;
  const since = clock(live.since_ms * 1000);
  return html`<div class="banner" role="alert">No connection to the service since ${since}. What is shown is as of then; trying again.</div>`;
}

function App() {
  const [route, set_route] = useState(route_of(location.hash));
  const main = useRef(null), first = useRef(true);
  const dark = useTheme();
  useEffect(() => {
    const change = () => set_route(route_of(location.hash));
    addEventListener('hashchange', change);
    return () => removeEventListener('hashchange', change);
  }, []);
  useEffect(() => {
    if (first.current) first.current = false;
    else {
      scrollTo(0, 0);
      main.current.focus({ preventScroll: true });
    }
  }, [route.view, route.id]);
  const View = views[route.view];
  const here = { robots: 'fleet', mission: 'missions' }[route.view] ?? route.view;
  const tab = (view, name) => html`<a href=${`#/${view}`} aria-current=${here === view ? 'page' : undefined}>${name}</a>`;
  const skip = (event) => {
    event.preventDefault();
    main.current.focus();
  };
  return html`
    <a class="skip" href="#main" onClick=${skip}>Skip to content</a>
    <header class="top">
      <a class="mark" href="#/fleet" aria-label="joulecast, fleet">
        <svg viewBox="0 0 32 20" width="38" height="24" aria-hidden="true"><path d="M1 14h6l4-12 6 17 4-10 2 5h8" /></svg>joulecast</a>
      <nav aria-label="Views">${tab('fleet', 'Fleet')}${tab('missions', 'Missions')}${tab('plan', 'Plan')}${tab('gap', 'Gap')}</nav>
      <${Link} />
      <button type="button" class="theme" onClick=${toggle_theme} aria-label=${dark ? 'Light theme' : 'Dark theme'} title=${dark ? 'Light theme' : 'Dark theme'}>
        <svg viewBox="0 0 20 20" width="18" height="18" aria-hidden="true"><circle cx="10" cy="10" r="7.5" class="ring" /><path d="M10 2.5a7.5 7.5 0 0 1 0 15z" /></svg></button>
    </header>
    <${OfflineBanner} />
    <main id="main" tabindex="-1" ref=${main}>
      <${Guard} view=${location.hash}>
        ${View ? html`<${View} key=${`${route.view}/${route.id ?? ''}`} id=${route.id} given=${route.given} />`
          : html`<${Empty} title="There is no such page">Go to the <a href="#/fleet">fleet</a>.<//>`}
      <//>
    </main>`;
}

start_live();
render(html`<${App} />`, document.getElementById('app'));
