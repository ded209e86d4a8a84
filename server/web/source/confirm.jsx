// A button with a dialog that confirms its action by `onConfirm(values of its fields by name)`. Its children
// describe the change; with `refusal`, a reason, the button is disabled.
import { useEffect, useRef, useState } from 'preact/hooks';
import { DialogForm } from './dialog_form.jsx';

export function ConfirmButton({ label, title, action, onConfirm, disabled, class: name, refusal, children }) {
  const dialog = useRef(null);
  const [open, setOpen] = useState(false);
  useEffect(() => {
    if (open) dialog.current.showModal(); // with its content, so that a control in it gets the focus
  }, [open]);
  const answer = (form) => {
    const values = Object.fromEntries(new FormData(form));
    dialog.current.close();
    onConfirm(values);
  };
  return (
    <>
      <button
        type="button"
        class={name}
        disabled={disabled || refusal !== undefined}
        title={refusal}
        onClick={() => setOpen(true)}
      >
        {label}
      </button>
      <dialog ref={dialog} aria-label={title} onClose={() => setOpen(false)}>
        {open && (
          <DialogForm dialog={dialog} title={title} action={action ?? label} onSubmit={answer}>
            {children}
          </DialogForm>
        )}
      </dialog>
    </>
  );
}
