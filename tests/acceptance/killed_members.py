#!/usr/bin/env python3
"""One of three daemons on a PostgreSQL is killed at each statement that it sends while it makes a change under an idempotency key:
repeated under that key at both others at once, the change is done exactly once, with its event and one answer, and the audit stays a
chain. --changes N makes the first N kinds of changes."""
import argparse
import concurrent.futures
import json
import pathlib
import shutil
import subprocess
import time

from cluster_parts import Cluster, Server
from harness import PATIENCE, check, skip, start_postgresql, wait_until
from killed_changes import ask, kill_at

MOST_STATEMENTS = int(60 * PATIENCE)  # of one change, and of others during it; the loop ends where a change survives
FINISHED = ("INSERT INTO mission (mission_key, robot_id, mission_id, start_utime_us, end_utime_us, state, implicit, incomplete, "
            "incomplete_reason, note, model_version, samples, sample_faults, gap_count) SELECT k, 'amr', 'm' || k, k * 10000000::bigint, "
            "k * 10000000::bigint + 8000000, 'finished', 0, 0, '', '', 1, 0, '{}', 0 FROM generate_series(1, %d) AS k")


def options_of():
    parser = argparse.ArgumentParser()
    for name in ("daemon", "client", "source", "shared"):
        parser.add_argument("--" + name, required=name != "shared")
    parser.add_argument("--changes", type=int, default=4)
    return parser.parse_args()


def changes(model):
    """(name, request of the number, query of how often it is done, its result after n requests) of each kind of change."""
    return [
        ("annul", lambda k: ("POST", f"/v1/missions/{k}/annul", {"reason": "test"}),
         "SELECT (SELECT count(*) FROM event WHERE kind = 'mission_annulled'), count(*) FROM mission WHERE findings_json LIKE '%annulled%'",
         lambda n: (n, n)),
        ("put", lambda k: ("PUT", f"/v1/robots/put-{k}", model | {"robot_id": f"put-{k}"}),
         "SELECT count(*), max(version) FROM model WHERE robot_id LIKE 'put-%'", lambda n: (n, 1)),
        ("diagnose", lambda k: ("POST", "/v1/diagnoses", {"robot_id": "amr", "missions": [k]}),
         "SELECT count(*) FROM diagnosis", lambda n: (n,)),
        ("remove", lambda k: ("DELETE", f"/v1/robots/gone-{k}?history=purge", None),
         "SELECT count(*) FROM event WHERE kind = 'robot_removed'", lambda n: (n,)),
    ]


def run(cluster, name, request, count, expected):
    """Kills at the first, second, ... statement, until the change survives; how often it was killed."""
    alpha, *others = cluster.nodes.values()
    kills = 0
    for number in range(1, MOST_STATEMENTS):
        method, path, document = request(number)
        key, text = f"{name}-{number}", f"{name}, killed at statement {number}"
        tracer = kill_at(alpha, "sendto", number)
        first = ask(alpha, method, path, key, document)
        tracer.kill()
        tracer.wait()
        with concurrent.futures.ThreadPoolExecutor(len(others)) as pool:
            again = list(pool.map(lambda node: ask(node, method, path, key, document), others))
        check(all(each is not None and each[0] < 300 and each == again[0] for each in again), f"{text}: repeated {again}")
        found = tuple(int(value) for value in cluster.server.rows(count)[0])
        check(found == expected(number), f"{text}: {found}, must be {expected(number)}")
        if first is not None:
            check(again[0] == first, f"{text}: {again} after {first}")
            return kills
        kills += 1
        alpha.process.wait(timeout=10)
        alpha.start()
    check(False, f"{name}: {MOST_STATEMENTS} statements")


def main():
    options = options_of()
    if shutil.which("strace") is None or subprocess.run(["strace", "-o", "/dev/null", "true"]).returncode != 0:
        skip("strace cannot trace here")
    server = Server(options.source)
    start_postgresql(server)
    server.standby = None
    cluster = Cluster(options, server)
    try:
        for node in cluster.nodes.values():
            node.lcm_url = "memq://"
            node.start()
        alpha = cluster.nodes["alpha"]
        model = json.loads(pathlib.Path(options.source, "deploy/robots/amr.json").read_text())
        alpha.put("/v1/robots/amr", model)
        for k in range(1, MOST_STATEMENTS):
            alpha.put(f"/v1/robots/gone-{k}", model | {"robot_id": f"gone-{k}"})
        server.rows(FINISHED % MOST_STATEMENTS)
        wait_until(lambda: all(node.get("/v1/robots")["robots"] for node in cluster.nodes.values()), 20, "all daemons have the model")
        for name, *change in changes(model)[:options.changes]:
            began = time.monotonic()
            kills = run(cluster, name, *change)
            print(f"{name}: killed at {kills} statements, each time done once; {time.monotonic() - began:.0f} s", flush=True)
            check(kills > 3, f"{name}: killed {kills} times")
        print(alpha.run("audit", "verify", "--store", server.url).splitlines()[0])
        for node in cluster.nodes.values():
            check(node.stop() == 0, f"{node.name} did not stop in order")
    finally:
        for node in cluster.nodes.values():
            node.end()
        server.end()


main()
