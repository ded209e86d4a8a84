import sections from '../help.md';
import { Heading } from '../widgets.jsx';

export const Help = () =>
  sections.map(({ title, terms, text }, k) => [
    k === 0 ? <Heading title={title} /> : <h2>{title}</h2>,
    text ? (
      <p>{text}</p>
    ) : (
      <dl class="glossary">
        {terms.map(([term, to, words]) => (
          <div key={words}>
            <dt>{to ? <a href={to}>{term}</a> : term}</dt>
            <dd>{words}</dd>
          </div>
        ))}
      </dl>
    ),
  ]);
