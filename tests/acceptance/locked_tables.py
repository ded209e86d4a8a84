#!/usr/bin/env python3
"""Each table of the history in PostgreSQL is locked by another client while every documented GET and a PUT are requested: probes and
the metrics answer, so does every request that does not read that table, and the others end as 200 or 503 before the deadline. While
missions begin and end, the telemetry of robots is accounted at the rate at which it is sent. In SQLite one lock has all tables: reads
are answered as without it, changes are refused."""
import contextlib
import json
import pathlib
import sqlite3
import subprocess
import threading
import time
import urllib.error
import urllib.request

from harness import Programs, arguments, check, need_multicast, start_postgresql, wait_until
from postgresql_history import Server, is_ready

TABLES = "SELECT relname FROM pg_class WHERE relkind IN ('r', 'p') AND NOT relispartition AND relnamespace = 'public'::regnamespace ORDER BY 1"
PROBE_S = 1.0  # /healthz, /readyz and /metrics, on a machine shared with other tests
READ_S = 8.0  # two workers, each of which waits 1 s for a lock, for the requests that wait before this one
CHANGE_S = 8.0  # a change waits 2 s for a lock, twice
ROBOTS, RATE_HZ, LOCK_S = 20, 20, 15  # of the robots with missions
IDENTIFIERS = {"id": "amr", "key": "1", "mission": "1", "version": "1"}


def status_of(url, path, document=None):
    """Status and time [s] of a GET or, with a document, a PUT."""
    began = time.monotonic()
    request = urllib.request.Request(url + path, method="PUT" if document else "GET", headers={"Content-Type": "application/json"},
                                     data=json.dumps(document).encode() if document else None)
    try:
        with urllib.request.urlopen(request, timeout=40) as reply:
            reply.read(1 << 16)
            return reply.status, time.monotonic() - began
    except urllib.error.HTTPError as error:
        return error.code, time.monotonic() - began


def paths_of(document):
    """One path of each GET without a stream."""
    for path, methods in document["paths"].items():
        if "get" in methods and path != "/v1/events":
            for name in [part[1:-1] for part in path.split("/") if part.startswith("{")]:
                path = path.replace("{" + name + "}", IDENTIFIERS.get(name, "1"))
            yield path


def sqlite_is_locked(options):
    """One lock of another program on all tables."""
    programs = Programs(options)
    programs.lcm_url = "memq://"
    programs.start()
    model = json.load(open(f"{options.source}/deploy/robots/amr.json"))
    programs.put("/v1/robots/amr", model)
    usual = {path: status_of(programs.url, path)[0] for path in paths_of(programs.get("/openapi.json"))}
    check(len(usual) > 20, f"{usual}")
    with contextlib.closing(sqlite3.connect(programs.store, isolation_level=None)) as locker:
        locker.execute("BEGIN EXCLUSIVE")
        model["idle_power_w"] += 1
        status, seconds = status_of(programs.url, "/v1/robots/amr", model)
        check(status == 503 and seconds < CHANGE_S, f"SQLite locked: a change {status} after {seconds:.2f} s")
        for path, expected in usual.items():
            status, seconds = status_of(programs.url, path)
            check(status == (503 if path == "/readyz" else expected), f"SQLite locked: {path} {status}, usually {expected}")
            check(seconds < PROBE_S, f"SQLite locked: {path} after {seconds:.2f} s")
    wait_until(lambda: is_ready(programs), 20, "ready after SQLite is free again")
    check(programs.get("/v1/robots/amr")["model_version"] == 1, "a refused change was done")
    check(status_of(programs.url, "/v1/robots/amr", model)[0] == 200, "a change after the lock")
    check(programs.stop() == 0, "stop")
    print(f"SQLite locked: {len(usual)} requests answered as usual, a change refused", flush=True)


def accounting_continues(programs, server):
    """With the table of missions locked while robots begin and end missions. Of a robot that sends for the first time meanwhile nothing
    can be read: its mission is accounted for afterwards."""
    programs.start()
    late = json.load(open(f"{programs.options.source}/deploy/robots/amr.json")) | {"robot_id": "late"}
    programs.put("/v1/robots/late", late)
    pathlib.Path(programs.path("late.json")).write_text(json.dumps(late))
    fleet = subprocess.Popen([programs.options.client, "simulate", "--robots", str(ROBOTS), "--lcm-url", programs.lcm_url, "--server",
                              programs.url, "--rate", str(RATE_HZ), "--mission-duration", "5", "--quiet"])
    try:
        wait_until(lambda: programs.metric("joulecast_robots_live") == ROBOTS, 60, "robots are live")
        with subprocess.Popen(["psql", server.url, "-XqtA"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as locker:
            locker.stdin.write("BEGIN; LOCK mission IN ACCESS EXCLUSIVE MODE; SELECT 'locked';\n")
            locker.stdin.flush()
            check(locker.stdout.readline() == "locked\n", "mission is not locked")
            before, began = programs.metric("joulecast_ingest_samples_total"), time.monotonic()
            programs.run("simulate", "--robot", programs.path("late.json"), "--robots", 1, "--missions", 1, "--mission-duration", 5,
                         "--lcm-url", programs.lcm_url, "--rate", RATE_HZ, "--quiet")
            check(not programs.get("/v1/robots/late/state")["live"], "the state of a robot was read from a locked table")
            time.sleep(max(0, began + LOCK_S - time.monotonic()))
            share = (programs.metric("joulecast_ingest_samples_total") - before) / (ROBOTS * RATE_HZ * (time.monotonic() - began))
            locker.stdin.write("ROLLBACK;\n")
            locker.stdin.close()
        check(share > 0.8, f"with locked missions {100 * share:.0f} % of the telemetry was accounted")
        print(f"with locked missions {100 * share:.0f} % of the telemetry was accounted in time")
        late_one = next(m for m in programs.wait_for("late", 1) if not m["implicit"])
        check(late_one["state"] == "finished" and not late_one["incomplete"] and late_one["samples"] > 4 * RATE_HZ, f"{late_one}")
        check("missing" not in programs.get("/v1/robots/late/state")["faults"], "samples of the robot are missing")
    finally:
        fleet.terminate()
        fleet.wait()
    check(programs.stop() == 0, "stop")


def main():
    options = arguments()
    sqlite_is_locked(options)
    need_multicast()
    server = Server(options.source)
    start_postgresql(server)
    programs = Programs(options)
    multicast, programs.lcm_url = programs.lcm_url, "memq://"
    programs.settings = ["--store-url", server.url]
    try:
        programs.start()
        model = json.load(open(f"{options.source}/deploy/robots/amr.json"))
        programs.put("/v1/robots/amr", model)
        paths = list(paths_of(programs.get("/openapi.json")))
        check(len(paths) > 20, f"{paths}")
        tables = server.sql(TABLES).split()
        check({"audit", "event", "mission", "robot", "telemetry_chunk"} < set(tables), f"{tables}")
        for table in tables:
            with subprocess.Popen(["psql", server.url, "-XqtA"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as locker:
                locker.stdin.write(f"BEGIN; LOCK {table} IN ACCESS EXCLUSIVE MODE; SELECT 'locked';\n")
                locker.stdin.flush()
                check(locker.stdout.readline() == "locked\n", f"{table} is not locked")
                answers = {}
                threads = [threading.Thread(target=lambda k=k: answers.__setitem__(k, status_of(programs.url, "/v1/missions")))
                           for k in range(6)]
                for thread in threads:
                    thread.start()
                for path in ("/metrics", "/readyz", "/healthz", "/metrics", "/readyz"):
                    status, seconds = status_of(programs.url, path)
                    check(status == 200 and seconds < PROBE_S, f"{table} locked: {path} {status} after {seconds:.2f} s")
                status, seconds = status_of(programs.url, "/v1/robots")
                check(status in (200, 503) and seconds < READ_S, f"{table} locked: /v1/robots {status} after {seconds:.2f} s")
                for thread in threads:
                    thread.join()
                check(all(status in (200, 503) for status, _ in answers.values()), f"{table} locked: {answers}")
                refused = []
                for path in paths:
                    status, seconds = status_of(programs.url, path)
                    check(status in (200, 400, 404, 409, 503), f"{table} locked: {path} {status}")
                    check(seconds < READ_S, f"{table} locked: {path} {status} after {seconds:.2f} s")
                    refused += [path] if status == 503 else []
                check(table != "mission" or "/v1/missions" in refused, f"{table} locked: no request needed it: {refused}")
                model["idle_power_w"] += 1
                changed, seconds = status_of(programs.url, "/v1/robots/amr", model)
                check(changed in (200, 503) and seconds < CHANGE_S, f"{table} locked: a change {changed} after {seconds:.2f} s")
                print(f"{table} locked: {len(refused)} of {len(paths)} refused, a change {changed} in {seconds:.1f} s", flush=True)
                locker.stdin.write("ROLLBACK;\n")
                locker.stdin.close()
            wait_until(lambda: is_ready(programs), 20, f"ready after {table} is free again")
            in_force = programs.get("/v1/robots/amr")["model"]["idle_power_w"]
            check((in_force == model["idle_power_w"]) == (changed == 200), f"{table}: {in_force} W after {changed}")
            for path in paths:
                status, _ = status_of(programs.url, path)
                check(status in (200, 400, 404, 409), f"{table} free again: {path} {status}")
        check(programs.stop() == 0, "stop")
        programs.lcm_url = multicast
        accounting_continues(programs, server)
    finally:
        server.tell("stop")


if __name__ == "__main__":
    main()
