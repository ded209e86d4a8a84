// Asks for a token when the service refuses a request for want of one.
import { useLayoutEffect, useRef, useState } from 'preact/hooks';
import { onUnauthorized, post } from './api.js';
import { DialogForm } from './dialog_form.jsx';

export function SignIn() {
  const dialog = useRef(null);
  const [said, setSaid] = useState('');
  // Before the first answer comes.
  useLayoutEffect(() => onUnauthorized(() => dialog.current.open || dialog.current.showModal()), []);
  const submit = async (form) => {
    const token = new FormData(form).get('token').trim();
    try {
      await post('/v1/session', { token });
      location.reload();
    } catch (problem) {
      setSaid(problem.message);
    }
  };
  return (
    <dialog ref={dialog} class="sign-in" aria-label="Sign in">
      <DialogForm dialog={dialog} title="Sign in" action="Sign in" onSubmit={submit}>
        <p>
          <label>
            Token <input name="token" type="password" autocomplete="current-password" required />
          </label>
        </p>
        <p role="alert">{said}</p>
      </DialogForm>
    </dialog>
  );
}
