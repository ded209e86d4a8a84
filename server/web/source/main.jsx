import { render } from 'preact';
import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';
import './style.css';
import { askToSignIn, useGet } from './api.js';
import { clock } from './format.js';
import { toggleEnergyUnit, useEnergyUnit } from './energy.js';
import { startLive, useLive } from './live.js';
import { toggleTheme, useTheme } from './theme.js';
import { routeOf } from './route.js';
import { SignIn } from './sign_in.jsx';
import { Button, Empty, Guard } from './widgets.jsx';
import { Fleet } from './views/fleet.jsx';
import { later } from './views/later.jsx';

const views = {
  fleet: Fleet,
  robots: later('Robot'),
  'robot-file': later('RobotFile'),
  missions: later('Missions'),
  mission: later('Mission'),
  trends: later('Trends'),
  map: later('FloorLive'),
  floor: later('Floor'),
  plan: later('Plan'),
  gap: later('Gap'),
  audit: later('Audit'),
  cluster: later('Cluster'),
  help: later('Help'),
};

const tabs = Object.entries({
  fleet: 'Fleet',
  missions: 'Missions',
  trends: 'Trends',
  map: 'Map',
  floor: 'Floor',
  plan: 'Plan',
  gap: 'Gap',
  audit: 'Log',
  cluster: 'Cluster',
  help: 'Help',
});

function Link() {
  const live = useLive();
  const name = { live: 'Live', connecting: 'Connecting', offline: 'Offline', refused: 'Signed out' }[
    live.link
  ];
  return (
    <span class={`link ${live.link}`} role="status">
      <span class="lamp" aria-hidden="true" />
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
      {live.link === 'refused' && (
        <button type="button" onClick={askToSignIn}>
          Sign in
        </button>
      )}
    </div>
  );
}

function App() {
  const [route, setRoute] = useState(routeOf(location.hash));
  const main = useRef(null);
  const first = useRef(true);
  const dark = useTheme();
  const unit = useEnergyUnit();
  const clustered = useGet('/v1/cluster').value?.name;
  // A layout effect, so that a change of the address before the first paint is noticed.
  useLayoutEffect(() => {
    const change = () => setRoute(routeOf(location.hash));
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
  const change = unit === 'Wh' ? 'show energy in joules' : 'show energy in watt hours';
  const theme = dark ? 'Light theme' : 'Dark theme';
  const here = { robots: 'fleet', 'robot-file': 'fleet', mission: 'missions' }[route.view] ?? route.view;
  const tab = ([view, name]) => (
    <a key={view} href={`#/${view}`} aria-current={here === view ? 'page' : undefined}>
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
      <header class="top">
        <a class="mark" href="#/fleet" aria-label="joulecast, fleet">
          <svg viewBox="0 0 32 20" width="38" height="24" aria-hidden="true">
            <path d="M1 14h6l4-12 6 17 4-10 2 5h8" />
          </svg>
          joulecast
        </a>
        <nav aria-label="Views">{tabs.filter(([view]) => clustered || view !== 'cluster').map(tab)}</nav>
        <Link />
        <Button
          class="unit-choice"
          onClick={toggleEnergyUnit}
          aria-label={`${unit}: ${change}`}
          title={change}
        >
          {unit}
        </Button>
        <Button class="theme" onClick={toggleTheme} aria-label={theme} title={theme}>
          <svg viewBox="0 0 20 20" width="18" height="18" aria-hidden="true">
            <circle cx="10" cy="10" r="7.5" class="ring" />
            <path d="M10 2.5a7.5 7.5 0 0 1 0 15z" />
          </svg>
        </Button>
      </header>
      <OfflineBanner />
      <SignIn />
      <main id="main" tabindex="-1" ref={main}>
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
