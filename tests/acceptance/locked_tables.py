#!/usr/bin/env python3
"""Each table of the history in PostgreSQL is locked by another client while every documented GET is requested: probes and the
metrics answer, so does every request that does not read that table, and the others end as 200 or 503 before the deadline."""
import json
import subprocess
import threading
import time
import urllib.error
import urllib.request

from harness import Programs, arguments, check, start_postgresql
from postgresql_history import Server

TABLES = ("mission", "telemetry_chunk", "event", "robot")
PROBE_S = 1.0  # /healthz, /readyz and /metrics, on a machine shared with other tests
READ_S = 8.0  # two workers, each of which waits 1 s for a lock, for the requests that wait before this one
IDENTIFIERS = {"id": "amr", "key": "1", "mission": "1", "version": "1"}


def status_of(url, path):
    began = time.monotonic()
    try:
        with urllib.request.urlopen(url + path, timeout=40) as reply:
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


def main():
    options = arguments()
    server = Server(options.source)
    start_postgresql(server)
    programs = Programs(options)
    programs.lcm_url = "memq://"
    programs.settings = ["--store-url", server.url]
    try:
        programs.start()
        programs.put("/v1/robots/amr", json.load(open(f"{options.source}/deploy/robots/amr.json")))
        paths = list(paths_of(programs.get("/openapi.json")))
        check(len(paths) > 20, f"{paths}")
        for table in TABLES:
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
                print(f"{table} locked: {len(refused)} of {len(paths)} refused", flush=True)
                locker.stdin.write("ROLLBACK;\n")
                locker.stdin.close()
            for path in paths:
                status, _ = status_of(programs.url, path)
                check(status in (200, 400, 404, 409), f"{table} free again: {path} {status}")
        check(programs.stop() == 0, "stop")
    finally:
        server.tell("stop")


if __name__ == "__main__":
    main()
