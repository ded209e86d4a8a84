import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';

export const sessionPath = '/v1/session';

// An error response of the service; status 0: no connection.
class Problem extends Error {
  constructor(status, title, detail, body = {}) {
    super(detail || title);
    Object.assign(this, { status, title, body, field: body.field });
  }
}

const unauthorized = new EventTarget();

// Calls `callback` when a request without a valid token is rejected. Returns a function that unregisters it.
export function onUnauthorized(callback) {
  unauthorized.addEventListener('refused', callback);
  return () => unauthorized.removeEventListener('refused', callback);
}

// `wanted`: by the user.
export const askToSignIn = (wanted) =>
  unauthorized.dispatchEvent(new CustomEvent('refused', { detail: Boolean(wanted) }));

async function answer(response) {
  if (response.ok) return response.json();
  const problem = await response.json().catch(() => ({}));
  if (response.status === 401 && !response.url.endsWith(sessionPath)) {
    askToSignIn();
    throw new Problem(401, 'You are not signed in', 'Sign in to see the fleet.');
  }
  throw new Problem(response.status, problem.title ?? response.statusText, problem.detail, problem);
}

async function call(path, options) {
  let response;
  try {
    response = await fetch(path, options);
  } catch (error) {
    if (error.name === 'AbortError') throw error;
    throw new Problem(0, 'The service cannot be reached', 'It may be restarting, or the network is down.');
  }
  return answer(response);
}

export const get = (path, signal) => call(path, { signal });

// {text, next}: the response in that media type, and the path of the next page or null.
export async function getText(path, type, signal) {
  const response = await fetch(path, { headers: { accept: type }, signal });
  if (!response.ok) await answer(response);
  const next = /<([^>]+)>; rel="next"/.exec(response.headers.get('link') ?? '')?.[1] ?? null;
  return { text: await response.text(), next };
}

const send = (method) => (path, body, signal) =>
  call(path, { method, body: JSON.stringify(body), headers: { 'content-type': 'application/json' }, signal });
export const post = send('POST');
export const put = send('PUT');

export const putFile = (path, file) =>
  call(path, { method: 'PUT', body: file, headers: { 'content-type': file.type } });

export const del = (path) => call(path, { method: 'DELETE' });

// Empty, null and undefined values are left out.
export function query(values) {
  const kept = Object.entries(values).filter(([, v]) => v !== undefined && v !== null && v !== '');
  return kept.length === 0 ? '' : `?${new URLSearchParams(kept)}`;
}

export const idPath = (id) => encodeURIComponent(id);

// Calls `act`, as it was last drawn, every `ms`; never without `ms`.
export function useEvery(ms, act) {
  const latest = useRef();
  latest.current = act;
  useEffect(() => {
    if (!ms) return undefined;
    const timer = setInterval(() => latest.current(), ms);
    return () => clearInterval(timer);
  }, [ms]);
}

// {value, error, loading, path, reload}: what `read(signal)` resolves to. Reads again when `path` or
// `renewed` changes and, if given, every `everyMs`; keeps the last value meanwhile, with its path. An empty
// or null path reads nothing.
export function useRead(read, path, renewed, everyMs) {
  const [state, setState] = useState({ value: null, error: null, loading: Boolean(path), path });
  const [turn, setTurn] = useState(0);
  useEffect(() => {
    if (!path) return undefined;
    const abort = new AbortController();
    setState((before) => ({ ...before, loading: true }));
    read(abort.signal).then(
      (value) => setState({ value, error: null, loading: false, path }),
      (error) =>
        error.name === 'AbortError' || setState((before) => ({ ...before, error, loading: false, path })),
    );
    return () => abort.abort();
  }, [path, turn, renewed]);
  const reload = () => setTurn((n) => n + 1);
  useEvery(everyMs, reload);
  return { ...state, reload };
}

export const useGet = (path, ...more) => useRead((signal) => get(path, signal), path, ...more);

// What `read()` returns; drawn again when that changes with the event of `target`. `read` and `target` must
// not depend on props: those of the first drawing are kept. A layout effect, so that a change before the
// first paint is noticed.
export function useSource(read, target, event = 'change') {
  const [value, setValue] = useState(read);
  useLayoutEffect(() => {
    const change = () => setValue(read);
    target.addEventListener(event, change);
    return () => target.removeEventListener(event, change);
  }, []);
  return value;
}

const kept = new Map();

// What `read()` resolves to, read once; again after forget(key) or a failure.
export function once(key, read) {
  if (!kept.has(key)) {
    kept.set(key, read());
    kept.get(key).catch(() => forget(key));
  }
  return kept.get(key);
}
export const forget = (key) => kept.delete(key);
export const getOnce = (path) => once(path, () => get(path));

// `read` after a pause, unless its request is not needed any more.
export const delayed = (read, ms) => async (signal) => {
  await new Promise((wait) => setTimeout(wait, ms));
  signal.throwIfAborted();
  return read(signal);
};

// The newest value that `read(signal)` resolves to; `none` at first, an empty map. It is read after the first
// view is drawn, every `renewMs`, and when `key` changes; an empty key reads nothing. A failed request keeps
// the value: the live view reports that the service is gone.
const empty = new Map();
export const useRenewed = (read, renewMs, key, none = empty) =>
  useRead(delayed(read, 300), key, 0, renewMs).value ?? none;
