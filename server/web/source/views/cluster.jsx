// The daemons that share the fleet, and the robots that each of them keeps.
import { useGet } from '../api.js';
import * as format from '../format.js';
import { useLive } from '../live.js';
import { robotLink, useChoices } from '../route.js';
import { Table, TablePanel, column, figure, orderOf, sorted } from '../table.jsx';
import { Answer, Empty, Facts, Failure, Heading, Panel, Readouts } from '../widgets.jsx';

const renewMs = 2000;
const lateStoredS = 10; // samples are stored twice a second

const ago = (second) => (format.known(second) ? `${format.span(second)} ago` : 'never');

const aliveCell = ({ alive }) => (
  <span class={alive ? '' : 'fault'}>
    <span class={`lamp ${alive ? 'good' : 'bad'}`} aria-hidden="true" />
    {alive ? 'alive' : 'gone'}
  </span>
);

const count = (key, title, value, more) =>
  figure(key, title, (row) => format.fixed(value(row)), { sort: value, ...more });

const ownFlag = [' ', <span class="flag good">this daemon</span>];
const nodeColumns = (own) => [
  column('node', 'Daemon', ({ node }) => [node, node === own && ownFlag], { head: true }),
  column('alive', 'State', aliveCell),
  column('address', 'Address', (n) => n.address),
  column('version', 'Version', (n) => n.version),
  figure('joined', 'Joined', (n) => ago(n.joined_s)),
  figure('lease', 'Lease left', (n) => (n.lease_left_s > 0 ? format.span(n.lease_left_s) : 'lapsed'), {
    hint: 'time until other daemons take over its robots, unless it renews the lease',
  }),
  count('kept', 'Keeps', (n) => n.robots_kept),
  count('heard', 'Receives', (n) => n.robots_heard),
];

// Seconds of an open mission that are not stored yet; null where none runs.
function lagOf(lease, state) {
  if (!state?.mission || lease.stored_utime_us === null || state.utime_us === null) return null;
  return Math.max(0, (state.utime_us - lease.stored_utime_us) * 1e-6);
}

function lagCell({ lag }) {
  if (lag === null) return <span class="note">–</span>;
  return <span class={lag > lateStoredS ? 'fault' : ''}>{format.span(lag)}</span>;
}

const leaseColumns = [
  column('robot', 'Robot', (l) => <a href={robotLink(l.robot_id)}>{l.robot_id}</a>, {
    head: true,
    sort: (l) => l.robot_id,
  }),
  column('node', 'Kept by', (l) => l.node ?? <span class="fault">none</span>, { sort: (l) => l.node ?? '' }),
  figure('taken', 'Since', (l) => format.span(l.taken_s), { sort: (l) => l.taken_s }),
  figure('lag', 'Lag', lagCell, {
    sort: (l) => l.lag,
    hint: 'from the newest sample of an open mission back to the last stored one',
  }),
  count('takeovers', 'Takeovers', (l) => l.takeovers, { hint: 'from daemons that were gone' }),
  count('epoch', 'Epoch', (l) => l.epoch, { hint: 'grows with every change of the keeper' }),
];

function Summary({ nodes, leases }) {
  const sum = (of) => leases.reduce((total, lease) => total + of(lease), 0);
  const alive = nodes.filter((n) => n.alive).length;
  const homeless = sum((l) => (l.node === null ? 1 : 0));
  const lags = leases.map((l) => l.lag).filter((s) => s !== null);
  const rows = [
    ['Daemons alive', `${alive}`, `of ${nodes.length}`],
    ['Robots kept', `${leases.length - homeless}`, `of ${leases.length}`],
    ['Takeovers', format.fixed(sum((l) => l.takeovers))],
    ['Greatest lag', ...(lags.length > 0 ? [format.span(Math.max(...lags))] : ['–', 'no mission runs'])],
  ];
  return <Readouts large rows={rows} />;
}

const ownFacts = [
  ['takeovers', 'Robots taken over from failed daemons'],
  ['handovers', 'Robots handed to daemons that joined or receive them'],
  ['missions_resumed', 'Open missions taken over'],
  ['held_messages', 'Messages held for robots that others keep'],
  ['held_messages_dropped', 'Held messages dropped from a full queue'],
  ['commands_dropped', 'Records dropped, since another daemon keeps the robot'],
  ['memberships_lost', 'Absences longer than the lease'],
];

function Shown({ of }) {
  const live = useLive();
  const order = orderOf(...useChoices({}), { key: 'robot', down: false });
  const rows = of.leases.map((l) => ({
    ...l,
    key: l.robot_id,
    lag: lagOf(l, live.robots.get(l.robot_id)?.state),
  }));
  const title = `${of.node} does not reach the database`;
  const message = `${of.error}. The data were read ${ago(of.read_s)}.`;
  const leases = sorted(rows, leaseColumns, order);
  return (
    <>
      {of.error && <Failure error={{ title, message }} />}
      <Summary nodes={of.nodes} leases={leases} />
      <TablePanel title="Daemons" class="cluster" columns={nodeColumns(of.node)} rows={of.nodes} />
      <div class="columns">
        <Panel title="Robots">
          {leases.length === 0 ? (
            <Empty title="No robot has been kept yet" />
          ) : (
            <Table class="leases" columns={leaseColumns} rows={leases} order={order} />
          )}
        </Panel>
        <Panel title={`${of.node}, since it started`}>
          <Facts class="counts" rows={ownFacts.map(([key, name]) => [name, format.fixed(of.own[key])])} />
        </Panel>
      </div>
    </>
  );
}

export function Cluster() {
  const cluster = useGet('/v1/cluster', 0, renewMs);
  return (
    <>
      <Heading
        title={['Cluster', cluster.value?.name].filter(Boolean).join(' ')}
        note="daemons that share the fleet; if one fails, others take over its robots"
      />
      <Answer of={cluster} what="the cluster">
        {(value) =>
          value.name === null ? (
            <Empty title="This daemon is in no cluster">
              To make it a member of one, set <code>cluster.name</code>.
            </Empty>
          ) : (
            <Shown of={value} />
          )
        }
      </Answer>
    </>
  );
}
