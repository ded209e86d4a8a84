// The audit log: changes, sign-ins and rejected requests, newest first.
import { useEffect, useState } from 'preact/hooks';
import { get, query } from '../api.js';
import * as format from '../format.js';
import { Table } from '../table.jsx';
import { Answer, Empty } from '../widgets.jsx';

const pageEntries = 200;

// A summary of the request or its status.
function summaryOf({ method, path, status, ...rest }) {
  const asked = [method, path].filter(Boolean).join(' ');
  const answered = status === undefined ? '' : `answered ${status}`;
  const others = Object.entries(rest)
    .filter(([, value]) => value !== null)
    .map(
      ([key, value]) => `${format.words(key)}: ${typeof value === 'string' ? value : JSON.stringify(value)}`,
    );
  return [asked, answered, ...others].filter(Boolean).join('; ');
}

const columns = [
  { key: 'time', title: 'Time', class: 'when', cell: (e) => format.time(e.utime_us) },
  { key: 'actor', title: 'Who', cell: (e) => e.actor ?? '–' },
  { key: 'address', title: 'From', cell: (e) => e.address ?? 'the service' },
  { key: 'action', title: 'What', head: true, cell: (e) => e.action },
  { key: 'detail', title: 'Detail', class: 'words', cell: (e) => summaryOf(e.detail) },
];

export function Requests() {
  const [read, setRead] = useState({ value: null, error: null });
  const [cursor, setCursor] = useState(null);
  useEffect(() => {
    const abort = new AbortController();
    get(`/v1/audit${query({ cursor: cursor ?? undefined, limit: pageEntries })}`, abort.signal).then(
      ({ entries, next_cursor: next }) =>
        setRead((before) => ({
          value: { entries: cursor === null ? entries : [...before.value.entries, ...entries], next },
          error: null,
        })),
      (error) => error.name !== 'AbortError' && setRead((before) => ({ ...before, error })),
    );
    return () => abort.abort();
  }, [cursor]);
  return (
    <Answer of={read} what="the audit">
      {({ entries, next }) =>
        entries.length === 0 ? (
          <Empty title="No request yet">
            Requests that change something, refusals and sign-ins are listed here.
          </Empty>
        ) : (
          <>
            <Table class="events" columns={columns} rows={entries} keyOf={(e) => e.id} />
            {next && (
              <p class="fold">
                <button type="button" onClick={() => setCursor(next)}>
                  Show older entries
                </button>
              </p>
            )}
          </>
        )
      }
    </Answer>
  );
}
