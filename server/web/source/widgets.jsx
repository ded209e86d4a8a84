import { useErrorBoundary, useMemo } from 'preact/hooks';
import { askToSignIn, useSource } from './api.js';
import * as format from './format.js';
import { refusalFor } from './session.js';

// A number with its unit; `of` comes from a function of format.js or energy.js.
export const Quantity = ({ of }) => (
  <span class="quantity">
    <span class="number">{of.n}</span>
    {of.u && <span class="unit">{`\u00a0${of.u}`}</span>}
  </span>
);

// A quantity as such; anything else unchanged.
export const shown = (of) => (of?.u === undefined ? of : <Quantity of={of} />);

// Figures side by side, of rows [label, of, note, channel]; false rows are left out.
export const Readouts = ({ rows, large, class: name = '' }) => (
  <dl class={`wrap readouts ${name}`}>
    {rows.filter(Boolean).map(([label, of, note, channel]) => (
      <div key={label} class={`readout ${large ? 'large' : ''} ${channel ?? ''}`}>
        <dt>{label}</dt>
        <dd>
          {typeof of === 'string' ? <span class="number">{of}</span> : <Quantity of={of} />}
          {note && <span class="note">{note}</span>}
        </dd>
      </div>
    ))}
  </dl>
);

// A table of rows [name, value]; false rows are left out.
export const Facts = ({ rows, class: name = '' }) => (
  <table class={`facts ${name}`}>
    <tbody>
      {rows.filter(Boolean).map(([key, value]) => (
        <tr key={key}>
          <th scope="row">{key}</th>
          <td>{shown(value)}</td>
        </tr>
      ))}
    </tbody>
  </table>
);

// Texts as a list; nothing without texts.
export const Texts = ({ of }) =>
  of?.length > 0 && (
    <ul class="reasons">
      {of.map((text) => (
        <li key={text}>{text}</li>
      ))}
    </ul>
  );

// Measured over modelled energy; marked beyond a tenth, more than missions usually scatter.
export function Ratio({ value }) {
  const off = format.known(value) && Math.abs(value - 1) > 0.1;
  return <span class={off ? 'ratio off' : 'ratio'}>{format.fixed(value, 3)}</span>;
}

export const Empty = ({ title, children }) => (
  <div class="empty">
    <p class="empty-title">{title}</p>
    {children && <p>{children}</p>}
  </div>
);

export const Loading = ({ what }) => (
  <div class="loading" role="status">
    <span class="sweep" aria-hidden="true" />
    Loading {what} …
  </div>
);

export function Failure({ error, retry }) {
  const where = error.field && !error.message.includes(error.field) ? ` (${error.field})` : '';
  const refused = error.status === 401;
  const act = refused ? askToSignIn : retry;
  return (
    <div class={refused ? 'empty' : 'failure'} role="alert">
      <p class="empty-title">
        {[error.title ?? 'Error', !refused && error.status].filter(Boolean).join(' · ')}
      </p>
      <p>{error.message + where}</p>
      {act && <Button onClick={act}>{refused ? 'Sign in' : 'Try again'}</Button>}
    </div>
  );
}

// The result of useGet: the part `from(value)` of its value through `children`, or the error; `missing` where
// there is no such thing, `none`, with `more`, where the part is an empty list.
export function Answer({ of, what, missing, from = (value) => value, none, more, children }) {
  if (of.value !== null) {
    const part = from(of.value);
    return none && part.length === 0 ? <Empty title={none}>{more}</Empty> : children(part);
  }
  if (missing && [400, 404].includes(of.error?.status)) return missing;
  if (of.error !== null) return <Failure error={of.error} retry={of.reload} />;
  return <Loading what={what} />;
}

// With `of`, a result of useGet, its content is that of an Answer.
export const Panel = ({ title, aside, children, class: name, of, ...answer }) => (
  <section class={`panel ${name ?? ''}`}>
    <header class="row wrap">
      <h2>{title}</h2>
      {aside && <div class="row aside">{aside}</div>}
    </header>
    {of ? (
      <Answer of={of} {...answer}>
        {children}
      </Answer>
    ) : (
      children
    )}
  </section>
);

// Texts as a list in a panel; nothing without texts.
export const TextPanel = ({ title, of }) =>
  of?.length > 0 && (
    <Panel title={title}>
      <Texts of={of} />
    </Panel>
  );

// The head of a view: its title, with links above it and a note and other content next to it.
export const Heading = ({ title, crumbs, note, children }) => (
  <div class="wrap heading">
    {crumbs && <p class="note crumbs">{crumbs}</p>}
    <h1>{title}</h1>
    {note && <span class="note">{note}</span>}
    {children}
  </div>
);

// The meaning of the lines and marks of a chart, by the class of the swatch; without a name it is left out.
export const Key = ({ of }) =>
  Object.entries(of)
    .filter(([, name]) => name)
    .map(([kind, name]) => [<span class={`swatch ${kind}`} />, ` ${name} `]);

// A button, or with `href` a link like one. Disabled without the role `needs`, or with a `refusal`.
export function Button({ needs, refusal = needs && refusalFor(needs), disabled, href, ...more }) {
  if (href) return <a class="button" href={href} {...more} />;
  return <button type="button" disabled={disabled || refusal !== undefined} title={refusal} {...more} />;
}

// `options`: {key: name}.
export const Choice = ({ label, options, value, onChange }) => (
  <div class="choice" role="group" aria-label={label}>
    {Object.entries(options).map(([key, name]) => (
      <button key={key} type="button" aria-pressed={String(key === value)} onClick={() => onChange(key)}>
        {name}
      </button>
    ))}
  </div>
);

// Confines an error in one view to that view.
export function Guard({ children }) {
  const [error, reset] = useErrorBoundary(console.error);
  return error ? <Failure error={error} retry={reset} /> : children;
}

// Ids, or [id, name], as options of a choice; drawn again only when they change, not with every live value.
export const Options = ({ of }) =>
  useMemo(() => {
    const pairs = of.map((each) => (Array.isArray(each) ? each : [each, each]));
    return pairs.map(([id, name]) => (
      <option key={id} value={id}>
        {name}
      </option>
    ));
  }, [of.join('\n')]);

export function useTitleOf(text) {
  document.title = text ? `${text} · joulecast` : 'joulecast';
}

const narrowScreen = matchMedia('(max-width: 900px)');

// Whether rows are drawn as cards; the style sheet has the same width.
export const useNarrow = () => useSource(() => narrowScreen.matches, narrowScreen);
