// The views apart from the fleet, which are loaded when the first of them is shown.
import { useRead } from '../api.js';
import { Answer } from '../widgets.jsx';

let views = null;

function loadStyle() {
  const link = Object.assign(document.createElement('link'), { rel: 'stylesheet', href: 'views.css' });
  const loaded = new Promise((resolve, reject) => Object.assign(link, { onload: resolve, onerror: reject }));
  document.head.append(link);
  return loaded;
}

async function load() {
  try {
    [views] = await Promise.all([import('./index.js'), loadStyle()]);
  } catch {
    const message = 'The service may be restarting, or the network is down.';
    throw { title: 'This part of the page could not be loaded', message };
  }
}

function Later({ part, ...props }) {
  const loading = useRead(load, views ? null : 'views');
  if (views === null) return <Answer of={loading} what="this part of the page" />;
  const View = views[part];
  return <View {...props} />;
}

export const later = (part) => (props) => <Later part={part} {...props} />;
