// The acknowledgement of a reason for attention, or the button for it.
import { idPath, post } from '../api.js';
import { ConfirmButton } from '../confirm.jsx';
import * as format from '../format.js';
import { Field } from './choosing.jsx';

export function Acknowledge({ robot, reason, onChange, onError }) {
  const { kind, acknowledged: by } = reason;
  if (by)
    return (
      <span class="note">
        Acknowledged{by.by ? ` by ${by.by}` : ''} {format.time(by.utime_us).slice(0, 16)}
        {by.note && `: ${by.note}`}
      </span>
    );
  const send = ({ note }) =>
    post(`/v1/robots/${idPath(robot)}/acknowledge`, { kind, note }).then(onChange, onError);
  return (
    <ConfirmButton
      class="plain"
      label="Acknowledge"
      title={`Acknowledge: ${format.words(kind)}`}
      needs="operate"
      onConfirm={send}
    >
      <p>{reason.message} It no longer counts as needing attention until this condition ends.</p>
      <Field label="Note">
        <input type="text" name="note" maxlength="250" />
      </Field>
    </ConfirmButton>
  );
}
