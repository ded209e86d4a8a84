// The dialog for a token, opened when the service rejects a request without one.
import { useLayoutEffect, useRef, useState } from 'preact/hooks';
import { onUnauthorized, post, sessionPath } from './api.js';
import { DialogForm } from './dialog_form.jsx';
import { keepSession } from './session.js';

export function SignIn() {
  const dialog = useRef(null);
  const [said, setSaid] = useState('');
  // Before the first response.
  useLayoutEffect(
    () =>
      onUnauthorized(() => {
        keepSession(null);
        if (!dialog.current.open) dialog.current.showModal();
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
    <dialog ref={dialog} class="sign-in" aria-label="Sign in">
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
