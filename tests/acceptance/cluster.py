#!/usr/bin/env python3
"""Three daemons share a fleet through one PostgreSQL. One is killed, one is stopped for longer than its lease and goes on, one
is cut off from PostgreSQL, ended in order and started again; then PostgreSQL itself crashes and comes back, and crashes for good, and its synchronous
standby takes over. What is stored at the end is compared
with the log of what the robots published, by sums made here, and with one daemon that reads the log alone: every sample
is in the same mission, once, and the energies agree.

By hand: --hours N repeats the faults for so long, --robots N."""
import argparse
import json
import os
import pathlib
import signal
import socket
import struct
import subprocess
import tempfile
import threading
import time
import urllib.error
import urllib.request

import jsonschema

from harness import SKIP, Programs, check, need_multicast, skip

RATE_HZ = 50
LEASE_S = 5
KILLED_S, PAUSED_S = 3, 10  # within which another daemon goes on
NODES = ("alpha", "beta", "gamma")


def options():
    parser = argparse.ArgumentParser()
    for name in ("daemon", "client", "source", "shared"):
        parser.add_argument("--" + name, required=True)
    parser.add_argument("--hours", type=float, default=0)
    parser.add_argument("--robots", type=int, default=9)
    parser.add_argument("--mission-duration", type=float, default=15)
    return parser.parse_args()


def wait_until(condition, seconds, text):
    began = time.monotonic()
    while not condition():
        check(time.monotonic() - began < seconds, f"not within {seconds} s: {text}")
        time.sleep(0.05)
    return time.monotonic() - began


class Server:
    """PostgreSQL of the test's own, with a synchronous standby."""

    def __init__(self, source):
        self.folder, self.other = tempfile.TemporaryDirectory(), tempfile.TemporaryDirectory()
        self.script = pathlib.Path(source, "tests", "support", "postgresql.sh")
        self.primary, self.standby = self.folder.name, self.other.name
        self.url = f"postgresql://joulecast@/postgres?host={self.primary},{self.standby}&target_session_attrs=read-write"

    def tell(self, what, *folders):
        return subprocess.run([self.script, what, *(folders or [self.primary])]).returncode

    def fail_over(self):
        """The primary crashes for good, and the standby takes its place."""
        check(self.tell("stop") == 0, "the primary did not stop")
        check(self.tell("promote", self.standby) == 0, "the standby was not promoted")
        self.primary, self.standby = self.standby, None

    def rows(self, text):
        done = subprocess.run(["psql", self.url, "-XqtAF", "\t", "-c", text], capture_output=True, text=True)
        check(done.returncode == 0, f"psql: {done.stderr}")
        return [line.split("\t") for line in done.stdout.splitlines()]


class Relay:
    """Between one daemon and PostgreSQL; cut, it takes what either says and passes nothing on."""

    def __init__(self, server):
        self.server, self.open = server, threading.Event()
        self.open.set()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"postgresql://joulecast@127.0.0.1:{self.listener.getsockname()[1]}/postgres"
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            client, _ = self.listener.accept()
            threading.Thread(target=self.connect, args=(client,), daemon=True).start()

    def connect(self, client):
        self.open.wait()
        database = socket.socket(socket.AF_UNIX)
        try:
            database.connect(self.server.primary + "/.s.PGSQL.5432")
        except OSError:
            client.close()
            return
        for one, other in ((client, database), (database, client)):
            threading.Thread(target=self.carry, args=(one, other), daemon=True).start()

    def carry(self, one, other):
        try:
            while data := one.recv(65536):
                self.open.wait()
                other.sendall(data)
        except OSError:
            pass
        for end in (one, other):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass


class Node(Programs):
    """A daemon of the cluster."""

    def __init__(self, arguments, name, url, lcm_url):
        super().__init__(arguments)
        self.name, self.lcm_url = name, lcm_url
        self.settings = ["--store-url", url, "--cluster-name", "test", "--cluster-node", name,
                         "--cluster-lease-s", str(LEASE_S), "--diagnosis-controls", "2"]

    def metric(self, name):
        with urllib.request.urlopen(self.url + "/metrics", timeout=10) as reply:
            for line in reply.read().decode().splitlines():
                if line.startswith(name + " "):
                    return float(line.split()[1])
        check(False, f"{self.name} has no metric {name}")

    def post(self, path, document):
        request = urllib.request.Request(self.url + path, data=json.dumps(document).encode(),
                                         headers={"Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=30) as reply:
            return json.load(reply)

    def is_ready(self):
        try:
            urllib.request.urlopen(self.url + "/readyz", timeout=10)
        except (urllib.error.URLError, OSError):
            return False
        return True

    def send(self, which):
        self.process.send_signal(which)


class Cluster:
    def __init__(self, arguments, server):
        first = Programs(arguments)
        self.server, self.lcm_url = server, first.lcm_url
        self.relay = Relay(server)
        urls = (server.url, server.url, self.relay.url)
        self.nodes = {name: Node(arguments, name, url, first.lcm_url) for name, url in zip(NODES, urls)}

    def keepers(self):
        """Robot to daemon; only leases of daemons that are members."""
        return dict(self.server.rows("SELECT robot_id, node FROM cluster_lease JOIN cluster_node USING (node)"))

    def of(self, name):
        return sorted(robot for robot, node in self.keepers().items() if node == name)

    def positions(self):
        return {robot: int(us) for robot, us in
                self.server.rows("SELECT robot_id, coalesce(utime_us, 0) FROM cluster_lease")}

    def is_spread(self, robots):
        held = self.keepers()
        return len(held) == robots and set(held.values()) == set(self.nodes)

    def takeover(self, name, robots, limit_s, what, since=None):
        """How long until others keep the robots that `name` kept, and store what they say since."""
        began, at = since or time.monotonic(), self.positions()
        wait_until(lambda: all(self.keepers().get(r, name) != name for r in robots), limit_s + 10, "others take over")
        taken_s = time.monotonic() - began
        wait_until(lambda: all(self.positions()[r] > at[r] for r in robots), 10, "the robots' samples are stored again")
        stored_s = time.monotonic() - began
        print(f"{what}: {len(robots)} robots of {name} kept by others after {taken_s:.2f} s, samples stored after {stored_s:.2f} s")
        check(taken_s <= limit_s, f"{what}: {taken_s} s until others kept the robots, at most {limit_s} s")


def live_everywhere(cluster, robots):
    """Every daemon tells the same live state of every robot, within a second."""
    def is_so():
        for node in cluster.nodes.values():
            for robot in robots:
                state = node.get(f"/v1/robots/{robot}/state")
                if time.time() * 1e6 - state["utime_us"] > 1.2e6:  # the robots' clocks are this machine's
                    return False
        return True
    wait_until(is_so, 5, "all daemons tell the live state of all robots")


def models_everywhere(cluster, robot):
    """A model that one daemon is given is in force at the others within a second."""
    first, *others = cluster.nodes.values()
    model = first.get(f"/v1/robots/{robot}")["model"]
    model["idle_power_w"] += 0.125
    version = first.put(f"/v1/robots/{robot}", model)["model_version"]
    answering = lambda node: node.post(f"/v1/robots/{robot}/autonomy", {})["model_version"]
    took = wait_until(lambda: all(answering(node) == version for node in others), 5, "the others answer with the model")
    print(f"a model was in force at all daemons after {took:.2f} s")
    check(took <= 1.0, f"the model was in force elsewhere after {took} s")


def faults(cluster, robots):
    alpha, beta, gamma = (cluster.nodes[name] for name in NODES)
    alpha_had = cluster.of("alpha")
    since = time.monotonic()
    alpha.kill()
    cluster.takeover("alpha", alpha_had, KILLED_S, "kill -9", since)
    alpha.start()
    wait_until(lambda: cluster.is_spread(robots), 30, "the daemon that came back has robots again")

    beta_had, lost = cluster.of("beta"), beta.metric("joulecast_cluster_memberships_lost_total")
    since = time.monotonic()
    beta.send(signal.SIGSTOP)
    cluster.takeover("beta", beta_had, PAUSED_S, "SIGSTOP", since)
    time.sleep(2)
    beta.send(signal.SIGCONT)
    wait_until(lambda: beta.metric("joulecast_cluster_memberships_lost_total") > lost, 10, "it sees that it was away")
    print(f"SIGCONT: {beta.metric('joulecast_cluster_commands_dropped_total'):.0f} late commands dropped")
    wait_until(lambda: cluster.is_spread(robots), 30, "the daemon that went on has robots again")

    gamma_had, lost = cluster.of("gamma"), gamma.metric("joulecast_cluster_memberships_lost_total")
    since = time.monotonic()
    cluster.relay.open.clear()
    cluster.takeover("gamma", gamma_had, PAUSED_S, "cut off from PostgreSQL", since)
    time.sleep(2)
    cluster.relay.open.set()
    wait_until(lambda: gamma.metric("joulecast_cluster_memberships_lost_total") > lost, 40, "it sees that it was cut off")
    print(f"connected again: {gamma.metric('joulecast_cluster_commands_dropped_total'):.0f} late commands dropped")
    wait_until(lambda: cluster.is_spread(robots), 30, "the daemon that was cut off has robots again")

    gamma_had = cluster.of("gamma")
    since = time.monotonic()
    check(gamma.stop() == 0, "the daemon did not stop in order")
    cluster.takeover("gamma", gamma_had, KILLED_S, "SIGTERM", since)
    gamma.start()
    wait_until(lambda: cluster.is_spread(robots), 30, "the daemon that was started again has robots")

    check(cluster.server.tell("stop") == 0, "PostgreSQL did not stop")
    time.sleep(4)
    check(cluster.server.tell("start") == 0, "PostgreSQL did not start again")
    wait_until(lambda: all(node.is_ready() for node in cluster.nodes.values()), 20, "all daemons reach PostgreSQL again")
    print("PostgreSQL crashed and came back")
    if cluster.server.standby:
        cluster.server.fail_over()
        took = wait_until(lambda: all(node.is_ready() for node in cluster.nodes.values()), 30, "all daemons reach the standby")
        wait_until(lambda: cluster.is_spread(robots), 30, "all daemons keep robots with the standby")
        at = cluster.positions()
        wait_until(lambda: all(us > at[robot] for robot, us in cluster.positions().items()), 15, "all robots are stored again")
        print(f"the primary was lost: all daemons were ready {took:.2f} s after the standby was promoted")


def events_of_log(path):
    """(channel, payload) of an LCM event log."""
    with open(path, "rb") as log:
        while header := log.read(28):
            sync, _, _, channel_length, data_length = struct.unpack(">IqqII", header)
            check(sync == 0xEDA1DA01, "the log of what was published is damaged")
            yield log.read(channel_length).decode(), log.read(data_length)


def published(path):
    """Robot to {sequence: (utime, V, I)}."""
    samples = {}
    for channel, data in events_of_log(path):
        if not channel.startswith("ROBOT_TELEMETRY."):
            continue
        utime, sequence, length = struct.unpack_from(">qqI", data, 8)
        robot = data[28:28 + length - 1].decode()
        volt, ampere = struct.unpack_from(">dd", data, 28 + length + 6 * 8)
        samples.setdefault(robot, {})[sequence] = (utime, volt, ampere)
    return samples


def energy_j(samples):
    """The integral of V I, both linear between samples."""
    total = 0
    for (t0, v0, i0), (t1, v1, i1) in zip(samples, samples[1:]):
        total += (2 * v0 * i0 + v0 * i1 + v1 * i0 + 2 * v1 * i1) / 6 * (t1 - t0) * 1e-6
    return total


def paged(node, path, name):
    """What all pages of a list have under a name."""
    items, cursor = [], ""
    while True:
        page = node.get(path + cursor)
        items += page[name]
        if not page["next_cursor"]:
            return items
        cursor = "&cursor=" + page["next_cursor"]


def all_missions(node):
    return paged(node, "/v1/missions?limit=500", "missions")


def stored_samples(node, mission):
    return paged(node, f"/v1/missions/{mission['id']}/telemetry?limit=100000", "sequence")


def reference(cluster, log):
    """The missions of one daemon that reads the whole log."""
    node = cluster.nodes["alpha"]
    alone = Node(node.options, "alone", "", cluster.lcm_url)
    alone.settings = []
    robots = []
    for robot in node.get("/v1/robots?limit=1000")["robots"]:
        robots.append(node.path(robot["robot_id"] + ".json"))
        versions = node.get(f"/v1/robots/{robot['robot_id']}/versions")["versions"]
        first = min(versions, key=lambda version: version["model_version"])
        pathlib.Path(robots[-1]).write_text(json.dumps(first["model"]))
    arguments = [word for robot in robots for word in ("--robot", robot)]
    node.run("replay", log, "--into", alone.store, *arguments, "--json")
    alone.start()
    return alone


def by_name(missions):
    return {(m["robot_id"], m["mission_id"], m["start_utime_us"]): m for m in missions}


def compare(cluster, log, changed):
    sent = published(log)
    node = cluster.nodes["alpha"]
    alone = reference(cluster, log)
    ours, theirs = by_name(all_missions(node)), by_name(all_missions(alone))
    for one, other, text in ((ours, theirs, "only the cluster"), (theirs, ours, "only one daemon")):
        extra = [(name, one[name]["state"], one[name]["samples"]) for name in sorted(set(one) - set(other))]
        check(not extra, f"missions that {text} has: {extra}")
    booked = {robot: [] for robot in sent}
    worst, compared, total = 0, 0, 0
    for name, mission in sorted(ours.items()):
        single = theirs[name]
        stored, expected = stored_samples(node, mission), stored_samples(alone, single)
        check(stored == expected, f"{name}: {len(stored)} samples are stored, {len(expected)} by one daemon; "
                                  f"different: {sorted(set(stored) ^ set(expected))[:20]}")
        check(mission["samples"] == len(stored), f"{name}: {mission['samples']} samples booked, {len(stored)} stored")
        check(mission["state"] == single["state"], f"{name}: {mission['state']}, by one daemon {single['state']}")
        check(mission["gap_count"] == 0, f"{name}: {mission['gap_s']} s without samples")
        booked[name[0]] += stored
        own = energy_j([sent[name[0]][k] for k in stored])
        for key, tolerance in (("measured_j", 1e-6), ("modelled_j", 1e-3)):
            if key == "modelled_j" and name[0] == changed:
                continue
            one, other = mission["energy"][key], single["energy"][key]
            if key == "modelled_j":
                worst = max(worst, abs(one - other) / abs(other))
            check(abs(one - other) <= tolerance * abs(other) + 1e-3, f"{name}: {key} is {one}, by one daemon {other}")
        check(abs(mission["energy"]["measured_j"] - own) <= 1e-4 * abs(own) + 0.1,
              f"{name}: {mission['energy']['measured_j']} J, {own} J from the log")
        total += mission["energy"]["measured_j"]
        compared += 1
    for robot, sequences in booked.items():
        check(len(set(sequences)) == len(sequences), f"{robot}: samples are in two missions")
    count = sum(map(len, booked.values()))
    print(f"{compared} missions with {count} of {sum(map(len, sent.values()))} samples published, {total:.0f} J: as one daemon "
          f"has them; modelled energies within {worst:.1e}")
    alone.stop()


def settings_are_checked(arguments):
    for settings, field in ((["--cluster-name", "x"], "cluster.name"), (["--cluster-node", "x"], "cluster.node")):
        done = subprocess.run([arguments.daemon, "--check-config", *settings], capture_output=True, text=True)
        check(done.returncode == 2 and field + ":" in done.stderr, f"{settings}: {done.returncode}, {done.stderr}")


def main():
    arguments = options()
    settings_are_checked(arguments)
    need_multicast()
    server = Server(arguments.source)
    started = server.tell("start")
    if started == SKIP:
        skip("PostgreSQL is not installed")
    check(started == 0, "PostgreSQL did not start")
    check(server.tell("standby", server.primary, server.standby) == 0, "the standby did not start")
    cluster = Cluster(arguments, server)
    alpha = cluster.nodes["alpha"]
    log = alpha.path("published.lcmlog")
    fleet = None
    try:
        for node in cluster.nodes.values():
            node.start()
        fleet = subprocess.Popen(
            [arguments.client, "simulate", "--robots", str(arguments.robots), "--lcm-url", cluster.lcm_url, "--server", alpha.url,
             "--rate", str(RATE_HZ), "--mission-duration", str(arguments.mission_duration), "--log", log, "--quiet"])
        wait_until(lambda: cluster.is_spread(arguments.robots), 40, "every daemon keeps some of the robots")
        print({name: len(cluster.of(name)) for name in NODES})
        robots = sorted(cluster.keepers())
        live_everywhere(cluster, robots)
        models_everywhere(cluster, robots[0])
        until = time.monotonic() + 3600 * arguments.hours
        while True:
            faults(cluster, arguments.robots)
            if time.monotonic() >= until:
                break
        live_everywhere(cluster, robots)
        told = alpha.get("/v1/cluster")
        jsonschema.validate(told, json.loads(pathlib.Path(arguments.source, "schemas", "cluster.schema.json").read_text()))
        check({n["node"] for n in told["nodes"]} == set(NODES) and len(told["leases"]) == arguments.robots, f"/v1/cluster: {told}")
        fleet.send_signal(signal.SIGINT)
        fleet.wait(timeout=30)
        fleet = None
        time.sleep(3)
        for node in cluster.nodes.values():
            check(node.stop() == 0, f"{node.name} did not stop in order")
        alpha.start()
        compare(cluster, log, robots[0])
    finally:
        if fleet:
            fleet.kill()
            fleet.wait()
        for node in cluster.nodes.values():
            if node.process and node.process.poll() is None:
                node.send(signal.SIGCONT)
            node.end()
        for folder in filter(None, (server.primary, server.standby)):
            server.tell("stop", folder)


main()
