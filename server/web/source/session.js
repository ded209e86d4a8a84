// The role of the token used for the sign-in. Unknown if the service requires no token or the browser forbids
// storage; then all actions are offered.
const key = 'joulecast.session';
const roles = ['read', 'plan', 'operate', 'admin']; // each includes the permissions of the previous ones

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

// The reason why an action that requires `role` is not offered; undefined if it is.
export function refusalFor(role) {
  const own = roleNow();
  const may = !roles.includes(own) || roles.indexOf(own) >= roles.indexOf(role);
  return may ? undefined : `This needs a token of role ${role}; yours has the role ${own}.`;
}
