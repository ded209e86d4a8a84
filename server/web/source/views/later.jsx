// Views in a separate file, which is loaded when one of them is first shown.
import { useEffect, useState } from 'preact/hooks';
import { Failure, Loading } from '../widgets.jsx';

let asked = null;
let present = null;

function load() {
  asked ??= Promise.all([import('./index.js'), loadStyle()]).then(
    ([module]) => (present = module),
    (error) => {
      asked = null;
      throw error;
    },
  );
  return asked;
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

function Later({ part, ...rest }) {
  const [, setTurn] = useState(0);
  const [error, setError] = useState(null);
  const retry = () => {
    setError(null);
    load().then(
      () => setTurn((n) => n + 1),
      () => setError(unreachable),
    );
  };
  useEffect(() => {
    if (present === null) retry();
  }, []);
  if (error !== null) return <Failure error={error} retry={retry} />;
  if (present === null) return <Loading what="this part of the page" />;
  const Part = present[part];
  return <Part {...rest} />;
}

export const later = (part) => (props) => <Later part={part} {...props} />;
