// The dialog for a token, opened when the service rejects a request without one; once it is closed, only by
// the user.
import { useLayoutEffect, useRef, useState } from 'preact/hooks';
import { onUnauthorized, post, sessionPath } from './api.js';
import { DialogForm } from './dialog_form.jsx';
import { keepSession } from './session.js';

export function SignIn() {
  const dialog = useRef(null);
  const closed = useRef(false);
  const [said, setSaid] = useState('');
  // Before the first response.
  useLayoutEffect(
    () =>
      onUnauthorized(({ detail: wanted }) => {
        keepSession(null);
        if (!dialog.current.open && (wanted || !closed.current)) dialog.current.showModal();
      }),
    [],
  );
  const submit = async (form) => {
    const token = new FormData(form).get('token').trim();
    try {
      keepSession(await post(sessionPath, { token }));
      location.reload();
    } catch (problem) {
      setSaid(problem.message);
    }
  };
  return (
    <dialog ref={dialog} class="sign-in" aria-label="Sign in" onClose={() => (closed.current = true)}>
      <DialogForm dialog={dialog} title="Sign in" action="Sign in" onSubmit={submit}>
        <p>
          <label class="field">
            <span>Token</span>
            <input name="token" type="password" autocomplete="current-password" required />
          </label>
        </p>
        <p role="alert">{said}</p>
      </DialogForm>
    </dialog>
  );
}
