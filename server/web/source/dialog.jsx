// A dialog that is shown while `open`, with buttons to confirm, by `onSubmit(values of its fields by name)`,
// and to cancel; `onClose` when it is closed in any way.
import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';
import { onUnauthorized, post, sessionPath } from './api.js';
import { keepSession } from './session.js';
import { Button } from './widgets.jsx';

export function Dialog({ open, title, action, onSubmit, onClose, children, ...more }) {
  const dialog = useRef(null);
  // Shown with its content, so that a control in it gets the focus.
  useEffect(() => {
    if (open) dialog.current.showModal();
    else dialog.current.close();
  }, [open]);
  const submit = (event) => {
    event.preventDefault();
    onSubmit(Object.fromEntries(new FormData(event.target)));
  };
  return (
    <dialog ref={dialog} aria-label={title} onClose={onClose} {...more}>
      {open && (
        <form onSubmit={submit}>
          <h2>{title}</h2>
          {children}
          <p class="row wrap tools">
            <button type="submit" class="primary">
              {action}
            </button>
            <Button onClick={onClose}>Cancel</Button>
          </p>
        </form>
      )}
    </dialog>
  );
}

// A button with a dialog that confirms its action by `onConfirm(values of its fields by name)`. Its children
// describe the change; the others are of the button.
export function ConfirmButton({ label, title, action = label, onConfirm, children, ...button }) {
  const [open, setOpen] = useState(false);
  const confirm = (values) => {
    setOpen(false);
    onConfirm(values);
  };
  return (
    <>
      <Button {...button} onClick={() => setOpen(true)}>
        {label}
      </Button>
      <Dialog open={open} title={title} action={action} onSubmit={confirm} onClose={() => setOpen(false)}>
        {children}
      </Dialog>
    </>
  );
}

// The dialog for a token, opened when a request without one is rejected; once closed, only by the user.
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
