// Asks for a token when the service refuses a request for want of one.
import { useLayoutEffect, useRef, useState } from 'preact/hooks';
import { onUnauthorized, post } from './api.js';

export function SignIn() {
  const dialog = useRef(null);
  const [said, setSaid] = useState('');
  // Before the first answer comes.
  useLayoutEffect(() => onUnauthorized(() => dialog.current.open || dialog.current.showModal()), []);
  const submit = async (event) => {
    event.preventDefault();
    const token = new FormData(event.target).get('token').trim();
    try {
      await post('/v1/session', { token });
      location.reload();
    } catch (problem) {
      setSaid(problem.message);
    }
  };
  return (
    <dialog ref={dialog} class="sign-in" aria-label="Sign in">
      <form onSubmit={submit}>
        <h2>Sign in</h2>
        <p>
          <label>
            Token <input name="token" type="password" autocomplete="current-password" required />
          </label>
        </p>
        <p role="alert">{said}</p>
        <p class="tools">
          <button type="submit" class="primary">
            Sign in
          </button>
          <button type="button" onClick={() => dialog.current.close()}>
            Cancel
          </button>
        </p>
      </form>
    </dialog>
  );
}
