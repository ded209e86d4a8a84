#!/usr/bin/env python3
"""Three daemons share a fleet through one PostgreSQL and survive each fault of cluster_faults.py. The final history is
compared with the log of the published messages, by independent sums, and with one daemon that reads this log: every sample is in
the same mission, once, and the energies agree.

Manual options: --hours N continues with random faults, with outages longer than every time constant; --seed S, --robots N."""
import argparse
import concurrent.futures
import json
import pathlib
import random
import signal
import statistics
import struct
import subprocess
import time

import jsonschema

from cluster_faults import AWAY_S, EACH, LONG_AWAY_S, TRIES, Faults
from cluster_parts import BEGAN, NODES, Cluster, Node, Server, say
from harness import check, need_multicast, start_postgresql, wait_until

RATE_HZ = 50


def options():
    parser = argparse.ArgumentParser()
    for name in ("daemon", "client", "source", "shared"):
        parser.add_argument("--" + name, required=True)
    parser.add_argument("--hours", type=float, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--robots", type=int, default=9)
    parser.add_argument("--mission-duration", type=float, default=15)
    return parser.parse_args()


def live_everywhere(cluster, robots):
    """Every daemon reports the same live state of every robot, within a second."""
    def is_so():
        for node in cluster.nodes.values():
            for robot in robots:
                state = node.get(f"/v1/robots/{robot}/state")
                if time.time() * 1e6 - state["utime_us"] > 1.2e6:  # the robots' clocks are this machine's
                    return False
        return True
    wait_until(is_so, 30, "all daemons report the live state of all robots")


def models_everywhere(cluster, robot):
    """A model sent to one daemon is in force at the others within a second."""
    first, *others = cluster.nodes.values()
    model = first.get(f"/v1/robots/{robot}")["model"]
    answering = lambda node: node.post(f"/v1/robots/{robot}/autonomy", {})["model_version"]

    def takes_s():
        model["idle_power_w"] += 0.125
        version = first.put(f"/v1/robots/{robot}", model)["model_version"]
        took_s = wait_until(lambda: all(answering(node) == version for node in others), 20, "the others report the model")
        say(f"a model was in force at all daemons after {took_s:.2f} s")
        return took_s
    check(any(takes_s() <= 1.0 for _ in range(TRIES)), "a model was never in force elsewhere within a second")


def events_of_log(path):
    """(channel, payload) of an LCM event log."""
    with open(path, "rb") as log:
        while header := log.read(28):
            sync, _, _, channel_length, data_length = struct.unpack(">IqqII", header)
            check(sync == 0xEDA1DA01, "the log of published messages is damaged")
            yield log.read(channel_length).decode(), log.read(data_length)


def published(path):
    """{sequence: (utime, V, I)} by robot."""
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
    """The entries of all pages of a list."""
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
    extra = [f"{name} from {name[2] * 1e-6 - BEGAN:.1f} s on, {one[name]['state']}, {one[name]['samples']} samples: only {text}"
             for one, other, text in ((ours, theirs, "the cluster"), (theirs, ours, "one daemon"))
             for name in sorted(set(one) - set(other))]
    check(not extra, "missions are not the same:\n" + "\n".join(extra))
    booked = {robot: [] for robot in sent}
    worst, compared, total, wrong = 0, 0, 0, []
    for name, mission in sorted(ours.items()):
        single = theirs[name]
        stored, expected = stored_samples(node, mission), stored_samples(alone, single)
        if different := sorted(set(stored) ^ set(expected)):
            wrong.append(f"{name}: {len(stored)} samples are stored, {len(expected)} by one daemon; different: {different[:10]}, "
                         f"published from {sent[name[0]][different[0]][0] * 1e-6 - BEGAN:.1f} s on")
            continue
        check(mission["samples"] == len(stored), f"{name}: {mission['samples']} samples counted, {len(stored)} stored")
        check(mission["state"] == single["state"], f"{name}: {mission['state']}, by one daemon {single['state']}")
        check(mission["gap_count"] == 0, f"{name}: {mission['gap_s']} s without samples")
        booked[name[0]] += stored
        own = energy_j([sent[name[0]][k] for k in stored])
        for key, tolerance in (("measured_j", 1e-6), ("modelled_j", 1e-3)):
            if key == "modelled_j" and name[0] == changed:
                continue
            one, other = mission["energy"][key], single["energy"][key]
            if len(stored) < 2:  # no energy between fewer
                check(one == other, f"{name}: {key} is {one}, by one daemon {other}")
                continue
            if key == "modelled_j":
                worst = max(worst, abs(one - other) / abs(other))
            check(abs(one - other) <= tolerance * abs(other) + 1e-3, f"{name}: {key} is {one}, by one daemon {other}")
        measured_j = mission["energy"]["measured_j"] or 0
        check(abs(measured_j - own) <= 1e-4 * abs(own) + 0.1, f"{name}: {measured_j} J, {own} J from the log")
        total += measured_j
        compared += 1
    check(not wrong, "\n".join(wrong))
    for robot, sequences in booked.items():
        check(len(set(sequences)) == len(sequences), f"{robot}: samples are in two missions")
    count = sum(map(len, booked.values()))
    print(f"{compared} missions with {count} of {sum(map(len, sent.values()))} samples published, {total:.0f} J: as one daemon "
          f"has them; modelled energies within {worst:.1e}")
    alone.stop()


def one_key_everywhere(cluster, robot):
    """A request sent to all daemons at once under one key is done once, and answered alike."""
    ended = lambda: [m for m in cluster.nodes["alpha"].missions(robot) if m["state"] != "open"]
    wait_until(ended, 40, "a mission to diagnose has ended")
    for key in ("one", "two", "three"):
        before = int(cluster.server.rows("SELECT count(*) FROM diagnosis")[0][0])
        with concurrent.futures.ThreadPoolExecutor(len(NODES)) as pool:
            answers = list(pool.map(lambda node: node.post("/v1/diagnoses", {"robot_id": robot}, {"Idempotency-Key": key}),
                                    cluster.nodes.values()))
        made = int(cluster.server.rows("SELECT count(*) FROM diagnosis")[0][0]) - before
        check(made == 1 and len({answer["id"] for answer in answers}) == 1, f"{made} diagnoses for one key: {answers}")


def settings_are_checked(arguments):
    for settings, field in ((["--cluster-name", "x"], "cluster.name"), (["--cluster-node", "x"], "cluster.node")):
        done = subprocess.run([arguments.daemon, "--check-config", *settings], capture_output=True, text=True)
        check(done.returncode == 2 and field + ":" in done.stderr, f"{settings}: {done.returncode}, {done.stderr}")


def main():
    arguments = options()
    settings_are_checked(arguments)
    need_multicast()
    server = Server(arguments.source)
    start_postgresql(server)
    server.add_standby()
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
        wait_until(lambda: cluster.is_spread(arguments.robots), 40, "every daemon has some of the robots")
        say({name: len(cluster.of(name)) for name in NODES})
        robots = sorted(cluster.keepers())
        live_everywhere(cluster, robots)
        models_everywhere(cluster, robots[0])
        faults = Faults(cluster, arguments.robots, LONG_AWAY_S if arguments.hours else AWAY_S)
        draw = random.Random(arguments.seed)
        for fault, node in EACH:
            faults.must_be_in_time(fault, node)
        until = time.monotonic() + 3600 * arguments.hours
        while time.monotonic() < until:
            faults.must_be_in_time(draw.choice(EACH)[0], draw.choice(NODES))
            time.sleep(draw.uniform(0, 5))
        for what, took_s in faults.took_s.items():
            print(f"{what}: {len(took_s)} times, median {statistics.median(took_s):.2f} s, longest {max(took_s):.2f} s")
        live_everywhere(cluster, robots)
        one_key_everywhere(cluster, robots[0])
        state = alpha.get("/v1/cluster")
        document = json.loads(pathlib.Path(arguments.source, "schemas", "openapi.json").read_text())
        jsonschema.validate(state, {"components": document["components"], "$ref": "#/components/schemas/cluster"})
        check({n["node"] for n in state["nodes"]} == set(NODES) and len(state["leases"]) == arguments.robots, f"/v1/cluster: {state}")
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
        server.end()


main()
