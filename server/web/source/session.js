// What the token may do by which this page was signed in. Unknown, and so not held against anybody, where the
// service asks for none or the browser may not keep it.
const key = 'joulecast.session';
const roles = ['read', 'plan', 'operate', 'admin']; // each may do all that the ones before it may

// The answer to POST /v1/session; null ends it.
export function keepSession(session) {
  try {
    if (session === null) localStorage.removeItem(key);
    else localStorage.setItem(key, JSON.stringify({ role: session.role, expires: session.expires }));
  } catch {
    // storage may be forbidden
  }
}

function roleNow() {
  try {
    const { role, expires } = JSON.parse(localStorage.getItem(key));
    return Date.parse(expires) > Date.now() ? role : undefined;
  } catch {
    return undefined;
  }
}

// Why what needs `role` is not offered; undefined where it is.
export function refusalFor(role) {
  const own = roleNow();
  const may = !roles.includes(own) || roles.indexOf(own) >= roles.indexOf(role);
  return may ? undefined : `This needs a token of role ${role}; yours has the role ${own}.`;
}
