// The dialog for a token, opened when the service rejects a request without one; once it is closed, only by
// the user.
import { useLayoutEffect, useRef, useState } from 'preact/hooks';
import { onUnauthorized, post, sessionPath } from './api.js';
import { Dialog } from './dialog.jsx';
import { keepSession } from './session.js';

export function SignIn() {
  const closed = useRef(false);
  const [open, setOpen] = useState(false);
  const [said, setSaid] = useState('');
  // Before the first response.
  useLayoutEffect(
    () =>
      onUnauthorized(({ detail: wanted }) => {
        keepSession(null);
        if (wanted || !closed.current) setOpen(true);
      }),
    [],
  );
  const close = () => {
    closed.current = true;
    setOpen(false);
  };
  const submit = async ({ token }) => {
    try {
      keepSession(await post(sessionPath, { token: token.trim() }));
      location.reload();
    } catch (problem) {
      setSaid(problem.message);
    }
  };
  return (
    <Dialog open={open} title="Sign in" action="Sign in" onSubmit={submit} onClose={close} class="sign-in">
      <p>
        <label class="field">
          <span>Token</span>
          <input name="token" type="password" autocomplete="current-password" required />
        </label>
      </p>
      <p role="alert">{said}</p>
    </Dialog>
  );
}
