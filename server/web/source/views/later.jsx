// Views in separate files, each of which is loaded when a view of it is first shown.
import { useEffect, useState } from 'preact/hooks';
import { Failure, Loading } from '../widgets.jsx';

const files = {
  views: () => import('./index.js'),
  gap: () => import('../gap/index.js'),
  map: () => import('../map/index.js'),
  admin: () => import('../admin/index.js'),
};
const asked = {};
const present = {};

function load(file) {
  asked[file] ??= Promise.all([files[file](), (asked.style ??= loadStyle())]).then(
    ([module]) => (present[file] = module),
    (error) => {
      asked[file] = asked.style = undefined;
      throw error;
    },
  );
  return asked[file];
}

function loadStyle() {
  const link = Object.assign(document.createElement('link'), { rel: 'stylesheet', href: 'views.css' });
  const loaded = new Promise((resolve, reject) => Object.assign(link, { onload: resolve, onerror: reject }));
  document.head.append(link);
  return loaded;
}

const unreachable = {
  status: 0,
  title: 'This part of the page could not be loaded',
  message: 'The service may be restarting, or the network is down.',
};

function Later({ part, file, ...rest }) {
  const [, setTurn] = useState(0);
  const [error, setError] = useState(null);
  const retry = () => {
    setError(null);
    load(file).then(
      () => setTurn((n) => n + 1),
      () => setError(unreachable),
    );
  };
  useEffect(() => {
    if (!present[file]) retry();
  }, []);
  if (error !== null) return <Failure error={error} retry={retry} />;
  if (!present[file]) return <Loading what="this part of the page" />;
  const Part = present[file][part];
  return <Part {...rest} />;
}

export const later =
  (part, file = 'views') =>
  (props) => <Later part={part} file={file} {...props} />;
