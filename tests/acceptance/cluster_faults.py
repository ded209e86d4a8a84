"""Faults of a cluster: of its daemons, their links, its PostgreSQL. Each fault ends with full recovery."""
import errno
import pathlib
import signal
import time

from cluster_parts import LEASE_S, NODES, Connection, say
from harness import check, wait_until
from host_faults import WRITES

AWAY_S, LONG_AWAY_S = 45, 100  # the longest time constant of the daemons is 90 s
KILLED_S, PAUSED_S = 3, 10  # limit [s] until another daemon takes over
TRIES = 3  # on a loaded machine too: late means late every time


class Faults:
    def __init__(self, cluster, robots, away_s=AWAY_S):
        self.cluster, self.robots, self.away_s = cluster, robots, away_s
        self.took_s = {}
        self.in_time = True

    def __call__(self, fault, node):
        """True if others took over in time."""
        self.in_time = True
        getattr(self, fault)(self.cluster.nodes.get("gamma" if fault == "cut_off" else node))
        return self.in_time

    def must_be_in_time(self, fault, node):
        check(any(self(fault, node) for _ in range(TRIES)), f"others took over late every time: {fault} of {node}")

    def taken_over(self, node, had, limit_s, what, since):
        """Other daemons take over the daemon's robots and store their telemetry."""
        at = self.cluster.positions()
        wait_until(lambda: all(self.cluster.keepers().get(r, node.name) != node.name for r in had), limit_s + 30, "others take over")
        taken_s = time.monotonic() - since
        wait_until(lambda: all(self.cluster.positions()[r] > at[r] for r in had), 30, "the robots' samples are stored again")
        stored_s = time.monotonic() - since
        say(f"{what}: {len(had)} robots of {node.name} kept by others after {taken_s:.2f} s, samples stored after {stored_s:.2f} s")
        self.note(what, taken_s, limit_s)

    def note(self, what, took_s, limit_s):
        self.took_s.setdefault(what, []).append(took_s)
        if took_s > limit_s:
            say(f"{what}: {took_s:.2f} s, at most {limit_s} s")
            self.in_time = False

    def spread(self, text):
        wait_until(lambda: self.cluster.is_spread(self.robots), 40, text)

    def ready(self, seconds, text):
        return wait_until(lambda: all(node.is_ready() for node in self.cluster.nodes.values()), seconds, text)

    def stored_again(self):
        at = self.cluster.positions()
        wait_until(lambda: all(us > at[robot] for robot, us in self.cluster.positions().items()), 20, "all robots are stored again")

    def killed(self, node):
        had, since = self.cluster.of(node.name), time.monotonic()
        node.kill()
        self.taken_over(node, had, KILLED_S, "kill -9", since)
        node.start()
        self.spread("the restarted daemon has robots again")

    def two_killed(self, node):
        others = [name for name in NODES if name != node.name]
        had, since = self.cluster.of(others[0]) + self.cluster.of(others[1]), time.monotonic()
        for name in others:
            self.cluster.nodes[name].kill()
        wait_until(lambda: set(self.cluster.keepers().values()) == {node.name} and len(self.cluster.keepers()) == self.robots, 30,
                   "one daemon keeps all robots")
        took_s = time.monotonic() - since
        self.note("kill -9 of two", took_s, KILLED_S)
        say(f"kill -9 of two: {len(had)} robots kept by {node.name} after {took_s:.2f} s")
        for name in others:
            self.cluster.nodes[name].start()
        self.spread("the restarted daemons have robots again")

    def paused(self, node):
        had, lost = self.cluster.of(node.name), node.metric("joulecast_cluster_memberships_lost_total")
        since = time.monotonic()
        node.send(signal.SIGSTOP)
        self.taken_over(node, had, PAUSED_S, "SIGSTOP", since)
        time.sleep(2)
        node.send(signal.SIGCONT)
        wait_until(lambda: node.metric("joulecast_cluster_memberships_lost_total") > lost, 30, "it detects its pause")
        say(f"SIGCONT: {node.metric('joulecast_cluster_commands_dropped_total'):.0f} late commands dropped")
        self.spread("the resumed daemon has robots again")

    def cut_off(self, node):
        had, lost = self.cluster.of(node.name), node.metric("joulecast_cluster_memberships_lost_total")
        since = time.monotonic()
        self.cluster.relay.open.clear()
        self.taken_over(node, had, PAUSED_S, "cut off from PostgreSQL", since)
        time.sleep(2)
        self.cluster.relay.open.set()
        wait_until(lambda: node.metric("joulecast_cluster_memberships_lost_total") > lost, 40, "it detects its disconnection")
        say(f"connected again: {node.metric('joulecast_cluster_commands_dropped_total'):.0f} late commands dropped")
        self.spread("the reconnected daemon has robots again")

    def ended(self, node):
        had, since = self.cluster.of(node.name), time.monotonic()
        check(node.stop() == 0, "the daemon did not stop in order")
        self.taken_over(node, had, KILLED_S, "SIGTERM", since)
        node.start()
        self.spread("the restarted daemon has robots")

    def rolled(self, _):
        """As in an upgrade: the daemons are restarted in turn, each as soon as the previous one is ready."""
        for node in self.cluster.nodes.values():
            check(node.stop() == 0, "a daemon did not stop in order")
            node.start()
        self.stored_again()
        self.spread("all daemons have robots after the upgrade")
        say("all daemons were restarted, one after the other")

    def database_crashed(self, _):
        check(self.cluster.server.tell("stop") == 0, "PostgreSQL did not stop")
        time.sleep(4)
        check(self.cluster.server.tell("start") == 0, "PostgreSQL did not start again")
        self.ready(20, "all daemons reach PostgreSQL again")
        self.stored_again()
        say("PostgreSQL crashed and was restarted")

    def killed_while_away(self, node):
        """PostgreSQL is away; meanwhile one daemon is killed, and one ends with a spool and cannot start again."""
        other, third = (self.cluster.nodes[NODES[(NODES.index(node.name) + k) % 3]] for k in (1, 2))
        had = len(self.cluster.of(other.name))
        check(self.cluster.server.tell("stop") == 0, "PostgreSQL did not stop")
        time.sleep(self.away_s)
        node.kill()
        other.stop()
        spool = pathlib.Path(other.store + ".spool")
        check(had == 0 or spool.exists(), f"{other.name} left no spool")
        left = spool.exists() and spool.read_bytes()
        try:
            other.start()
        except SystemExit:
            pass
        check(other.process.poll() not in (None, 0), f"{other.name} runs without PostgreSQL")
        check(left == (spool.exists() and spool.read_bytes()), f"{other.name} changed its spool without PostgreSQL")
        check(self.cluster.server.tell("start") == 0, "PostgreSQL did not start again")
        wait_until(lambda: set(self.cluster.keepers().values()) == {third.name} and len(self.cluster.keepers()) == self.robots, 40,
                   "the third daemon keeps all robots")
        self.stored_again()
        other.start()
        node.start()
        self.spread("the daemons that came back have robots again")
        kept = list(pathlib.Path(other.store).parent.glob("*.spool.refused-*"))
        check(had == 0 or kept, f"the spool of {other.name}, whose robots another daemon keeps, was removed")
        told = [line for line in pathlib.Path(other.path("daemon.log")).read_text().splitlines() if "not all of the spool" in line]
        say(f"PostgreSQL was away for {self.away_s} s; {node.name} was killed in it, {other.name} ended with a spool: {told[-1:]}")

    def primary_lost(self, _):
        server = self.cluster.server
        server.fail_over()
        took_s = self.ready(30, "all daemons reach the standby")
        self.spread("all daemons keep robots with the standby")
        self.stored_again()
        say(f"the primary was lost: all daemons were ready {took_s:.2f} s after the standby was promoted")
        server.add_standby()

    def disk_full(self, _):
        server = self.cluster.server
        server.disks[server.primary].fail_disk(WRITES, errno.ENOSPC)
        time.sleep(6)
        check(not server.takes_writes(), "PostgreSQL writes to a full disk")
        server.disks[server.primary].fail_disk(0)
        check(server.tell("start") == 0, "PostgreSQL did not start again")  # it exits when its own log does not fit
        self.ready(30, "all daemons reach PostgreSQL again")
        self.spread("all daemons have robots again")
        self.stored_again()
        say("the primary's disk was full for 6 s")

    def connections_exhausted(self, _):
        """Daemons lose their connections and find none free, for longer than their leases."""
        folder, own, began = self.cluster.server.primary, [], time.monotonic()
        none_is_free = lambda: len(own) >= 50 and not any(node.is_ready() for node in self.cluster.nodes.values())
        while time.monotonic() < began + LEASE_S + 5 or not none_is_free():
            check(time.monotonic() < began + 60, f"{len(own)} connections taken, and a daemon still has one")
            own.append(Connection(folder))
            if own[-1].refused:
                own.pop().close()
                own[0].say("SELECT pg_terminate_backend(pid) FROM pg_stat_activity "
                           "WHERE backend_type = 'client backend' AND application_name <> 'test'")
                time.sleep(0.02)
        taken = len(own)
        for connection in own:
            connection.close()
        self.ready(30, "all daemons reach PostgreSQL again")
        self.spread("all daemons have robots again")
        self.stored_again()
        say(f"all {taken} connections were taken by others")


EACH = [("killed", "alpha"), ("paused", "beta"), ("cut_off", "gamma"), ("ended", "gamma"), ("two_killed", "beta"), ("rolled", ""),
        ("database_crashed", ""), ("killed_while_away", "alpha"), ("disk_full", ""), ("connections_exhausted", ""), ("primary_lost", "")]
