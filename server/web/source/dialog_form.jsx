// The form of a dialog, with buttons to confirm and to cancel.
export function DialogForm({ dialog, title, action, onSubmit, children }) {
  const submit = (event) => {
    event.preventDefault();
    onSubmit(event.target);
  };
  return (
    <form onSubmit={submit}>
      <h2>{title}</h2>
      {children}
      <p class="tools">
        <button type="submit" class="primary">
          {action}
        </button>
        <button type="button" onClick={() => dialog.current.close()}>
          Cancel
        </button>
      </p>
    </form>
  );
}
