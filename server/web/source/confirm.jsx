// A button with a dialog that confirms its action by `onConfirm(values of its fields by name)`. Its children
// describe the change; the others are of the button.
import { useState } from 'preact/hooks';
import { Dialog } from './dialog.jsx';
import { Button } from './widgets.jsx';

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
