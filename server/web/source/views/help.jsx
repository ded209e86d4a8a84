// The help: the text of help.md, of which each section is a list of terms or a paragraph.
import text from '../help.md';
import { Heading, useTitleOf } from '../widgets.jsx';

const oneLine = (lines) => lines.replaceAll(/\s+/g, ' ').trim();
const sections = text
  .split(/^#+ /m)
  .slice(1)
  .map((section) => section.split(/\n(.*)/s));
const termsOf = (lines) => [...lines.matchAll(/^- \[?\*\*(.+?)\*\*(?:\]\((.+?)\))?: (.+(?:\n {2}.+)*)$/gm)];

function Section({ lines }) {
  const terms = termsOf(lines);
  if (terms.length === 0) return <p>{oneLine(lines)}</p>;
  return (
    <dl class="glossary">
      {terms.map(([, term, to, words]) => (
        <div key={words}>
          <dt>{to ? <a href={to}>{term}</a> : term}</dt>
          <dd>{oneLine(words)}</dd>
        </div>
      ))}
    </dl>
  );
}

export function Help() {
  useTitleOf('Help');
  return sections.map(([title, lines], k) => [
    k === 0 ? <Heading title={title} /> : <h2>{title}</h2>,
    <Section lines={lines} />,
  ]);
}
