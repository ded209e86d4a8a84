import { render } from 'preact';
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import { askToSignIn, useGet, useRead, useSource } from './api.js';
import { SignIn } from './dialog.jsx';
import { toggleEnergyUnit, useEnergyUnit } from './energy.js';
import { clock } from './format.js';
import { startLive, useLive } from './live.js';
import { routeOf } from './route.js';
import './style.css';
import { toggleTheme, useTheme } from './theme.js';
import { Fleet } from './views/fleet.jsx';
import { Answer, Button, Empty, Guard, useTitleOf } from './widgets.jsx';

let loaded = null;

const loadStyle = () =>
  new Promise((onload, onerror) => {
    const link = { rel: 'stylesheet', href: 'views.css', onload, onerror };
    document.head.append(Object.assign(document.createElement('link'), link));
  });

async function load() {
  try {
    [loaded] = await Promise.all([import('./views/index.js'), loadStyle()]);
  } catch {
    const message = 'The service may be restarting, or the network is down.';
    throw { title: 'This part of the page could not be loaded', message };
  }
}

const later = (part) =>
  function Later(props) {
    const loading = useRead(load, loaded ? null : 'views');
    const View = loaded?.[part];
    return View ? <View {...props} /> : <Answer of={loading} what="this part of the page" />;
  };

// The views with the names of their tabs, or the tab that they belong to.
const views = new Map(
  Object.entries({
    fleet: [Fleet, 'Fleet'],
    robots: [later('Robot'), '', 'fleet'],
    'robot-file': [later('RobotFile'), '', 'fleet'],
    missions: [later('Missions'), 'Missions'],
    mission: [later('Mission'), '', 'missions'],
    trends: [later('Trends'), 'Trends'],
    map: [later('FloorLive'), 'Map'],
    floor: [later('Floor'), 'Floor'],
    plan: [later('Plan'), 'Plan'],
    gap: [later('Gap'), 'Gap'],
    audit: [later('Audit'), 'Log'],
    cluster: [later('Cluster'), 'Cluster'],
    help: [later('Help'), 'Help'],
  }),
);

const links = {
  live: ['Live', 'good'],
  connecting: ['Connecting', 'measured'],
  offline: ['Offline', 'bad'],
  refused: ['Signed out', 'measured'],
};

function Link() {
  const live = useLive();
  const [name, tone] = links[live.link];
  return (
    <span class={`row link ${live.link}`} role="status">
      <span class={`lamp ${tone}`} aria-hidden="true" />
      {name}
    </span>
  );
}

function OfflineBanner() {
  const live = useLive();
  const [late, setLate] = useState(false);
  useEffect(() => {
    setLate(false);
    if (live.link !== 'offline' && !(live.link === 'refused' && live.loaded)) return undefined;
    const timer = setTimeout(() => setLate(true), 1500); // the stream reconnects automatically
    return () => clearTimeout(timer);
  }, [live.link]);
  if (!late) return null;
  const since = clock(live.sinceMs * 1000);
  return (
    <div class="banner" role="alert">
      {live.link === 'offline'
        ? `No connection to the service since ${since}. The data are of that time. Reconnecting …`
        : `Signed out since ${since}. The data are of that time. `}
      {live.link === 'refused' && <Button onClick={askToSignIn}>Sign in</Button>}
    </div>
  );
}

function App() {
  const hash = useSource(() => location.hash, globalThis, 'hashchange');
  const route = useMemo(() => routeOf(hash), [hash]);
  const main = useRef(null);
  const first = useRef(true);
  const dark = useTheme();
  const unit = useEnergyUnit();
  const clustered = useGet('/v1/cluster').value?.name;
  useEffect(() => {
    if (first.current) first.current = false;
    else {
      scrollTo(0, 0);
      main.current.focus({ preventScroll: true });
    }
  }, [route.view, route.id]);
  const [View, name, here = route.view] = views.get(route.view) ?? [];
  useTitleOf(name); // until the view sets another one
  const hint = unit === 'Wh' ? 'show energy in joules' : 'show energy in watt hours';
  const theme = dark ? 'Light theme' : 'Dark theme';
  const tab = ([view, [, name]]) =>
    name &&
    (clustered || view !== 'cluster') && (
      <a key={view} class="row" href={`#/${view}`} aria-current={here === view ? 'page' : undefined}>
        {name}
      </a>
    );
  const skip = (event) => {
    event.preventDefault();
    main.current.focus();
  };
  return (
    <>
      <a class="skip" href="#main" onClick={skip}>
        Skip to content
      </a>
      <header class="row top">
        <a class="row mark" href="#/fleet" aria-label="joulecast, fleet">
          <svg viewBox="0 0 32 20" width="38" height="24" aria-hidden="true">
            <path d="M1 14h6l4-12 6 17 4-10 2 5h8" />
          </svg>
          joulecast
        </a>
        <nav aria-label="Views">{[...views].map(tab)}</nav>
        <Link />
        <Button class="unit-choice" onClick={toggleEnergyUnit} aria-label={`${unit}: ${hint}`} title={hint}>
          {unit}
        </Button>
        <Button class="row theme" onClick={toggleTheme} aria-label={theme} title={theme}>
          <svg viewBox="0 0 20 20" width="18" height="18" fill="currentColor" aria-hidden="true">
            <circle cx="10" cy="10" r="7.5" fill="none" stroke="currentColor" stroke-width="1.5" />
            <path d="M10 2.5a7.5 7.5 0 0 1 0 15z" />
          </svg>
        </Button>
      </header>
      <OfflineBanner />
      <SignIn />
      <main id="main" tabindex="-1" ref={main} style={{ outline: 'none' }}>
        <Guard key={route.hash}>
          {View ? (
            <View id={route.id} given={route.given} />
          ) : (
            <Empty title="There is no such page">
              Go to the <a href="#/fleet">fleet</a>.
            </Empty>
          )}
        </Guard>
      </main>
    </>
  );
}

startLive();
render(<App />, document.getElementById('app'));
