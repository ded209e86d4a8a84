#!/usr/bin/env python3
"""Attacks over HTTP. Clients without a token and of each role repeat every endpoint's request: those that may change nothing add a
bounded number of bytes to the audit, and nothing to any other table; the others change nothing without an entry in the audit. Prints
the growth of each table in a day. Then clients without a token send bodies of the greatest size to every endpoint with one, which
leave /healthz as fast as without them, within a factor. With --seconds N each attack lasts so long, with --roles only those attack;
a finding of a daemon that is built with sanitizers is a failure."""
import argparse
import collections
import concurrent.futures
import http.client
import json
import math
import pathlib
import sqlite3
import subprocess
import threading
import time
import urllib.parse

from harness import Programs, check

ROLES = ("nobody", "read", "plan", "operate", "admin")
CLIENTS = 8
FACTOR, ALWAYS_S = 10, 0.05  # of the 99 % point of /healthz: of the one without an attack, and what is always allowed
# Of refusals, sign-ins and sign-outs: 60 a minute of all clients, or of a token; 2 kB an entry.
ENTRIES_A_MINUTE, ENTRY_BYTES = 60 + 2 * 60, 2000
DAY_S = 86400
FLOOR_PLAN = '<svg xmlns="http://www.w3.org/2000/svg" width="600" height="400"/>'


def arguments():
    parser = argparse.ArgumentParser()
    for name in ("daemon", "client", "source", "shared"):
        parser.add_argument("--" + name, required=name != "shared")
    parser.add_argument("--seconds", type=float, default=6)
    parser.add_argument("--roles", nargs="+", choices=ROLES, default=ROLES)
    return parser.parse_args()


def ask(connection, method, path, body=None, token=None, kind="application/json"):
    """The status and the body, or 0 if the connection was closed."""
    headers = {"Content-Type": kind} | ({"Authorization": f"Bearer {token}"} if token else {})
    try:
        connection.request(method, path, body, headers)
        reply = connection.getresponse()
        return reply.status, reply.read()
    except (http.client.HTTPException, OSError):
        connection.close()
        return 0, b""


class Attack:
    """Clients that repeat `turn(connection, number of the client)` for some seconds; a failed check of one fails the test."""

    def __init__(self, url, turn, clients=CLIENTS):
        address = urllib.parse.urlparse(url).netloc
        self.ended, self.failure, self.threads = False, None, []
        for k in range(clients):
            self.threads.append(threading.Thread(target=self.run, args=(http.client.HTTPConnection(address, timeout=20), turn, k)))

    def run(self, connection, turn, number):
        try:
            while not self.ended:
                turn(connection, number)
        except BaseException as failure:  # a failed check is a SystemExit, which would end this thread only
            self.failure = failure
        connection.close()

    def __enter__(self):
        for thread in self.threads:
            thread.start()

    def __exit__(self, *_):
        self.ended = True
        for thread in self.threads:
            thread.join()
        if self.failure:
            raise self.failure


def slow_healthz_s(url, seconds):
    """The 99 % point of the times of /healthz."""
    connection = http.client.HTTPConnection(urllib.parse.urlparse(url).netloc, timeout=20)
    times, until = [], time.monotonic() + seconds
    while time.monotonic() < until:
        began = time.monotonic()
        status, _ = ask(connection, "GET", "/healthz")
        times.append(time.monotonic() - began)
        check(status == 200, f"/healthz {status}")
        time.sleep(0.005)
    return sorted(times)[int(0.99 * len(times))]


Endpoint = collections.namedtuple("Endpoint", "method path body kind may_change")


def endpoints(document):
    """Every endpoint with the example of its body, or None."""
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            kind, content = next(iter(operation.get("requestBody", {}).get("content", {}).items()), ("application/json", None))
            body = None
            if content is not None:
                body = json.dumps(content["example"]) if kind == "application/json" else FLOOR_PLAN
                kind = kind if kind == "application/json" else "image/svg+xml"
            named = path.replace("{id}", "amr" if "/robots/" in path else "1").replace("{map}", "hall").replace("{level}", "1")
            role = next(iter((operation.get("security") or [{}])[0].values()), ["none"])[0]
            yield Endpoint(method.upper(), named, body, kind, role in ("operate", "admin") and method != "get")


def sizes(store):
    """Rows and bytes of each table."""
    with sqlite3.connect(f"file:{store}?mode=ro", uri=True) as database:
        found = {}
        for (table,) in database.execute("SELECT name FROM sqlite_schema WHERE type = 'table' AND name NOT LIKE 'sqlite_%'").fetchall():
            columns = [column[1] for column in database.execute(f"PRAGMA table_info({table})")]
            length = " + ".join(f"coalesce(length(\"{column}\"), 0)" for column in columns)
            found[table] = database.execute(f"SELECT count(*), coalesce(sum({length}), 0) FROM {table}").fetchone()
        return found


def largest_bodies(url, document, seconds, probe):
    usual_s = probe.submit(slow_healthz_s, url, 2).result()
    with_body = [(each.method, each.path) for each in endpoints(document) if each.body]
    check(("POST", "/v1/session") in with_body and len(with_body) > 8, f"{with_body}")
    body = ('{"token": [' + ",".join(["{}"] * 1_390_000) + "]}").encode()[:4 * 1024 * 1024 - 1]
    for method, path in with_body:
        def turn(connection, _, method=method, path=path):
            status, _ = ask(connection, method, path, body)
            check(status in (0, 401, 403, 413, 429, 503), f"{method} {path}: {status}")
        most_s = max(ALWAYS_S, FACTOR * usual_s)
        with Attack(url, turn):
            for _ in range(5):  # other tests may delay one of them
                attacked_s = probe.submit(slow_healthz_s, url, max(1.0, seconds / len(with_body))).result()
                if attacked_s < most_s:
                    break
        print(f"{method} {path}: /healthz {1e3 * attacked_s:.1f} ms, usually {1e3 * usual_s:.1f} ms", flush=True)
        check(attacked_s < most_s, f"{method} {path} delays /healthz by {attacked_s:.3f} s")


def growth(programs, document, tokens, roles, seconds):
    everything = list(endpoints(document))
    check(sum(each.may_change for each in everything) > 8, f"{everything}")
    marks = "%22" * 3000
    for role in roles:
        may_change = role in ("operate", "admin")
        before, began = sizes(programs.store), time.monotonic()
        answers, changes = collections.Counter(), collections.Counter()  # by status; of clients, each by its own thread

        def turn(connection, number, role=role, answers=answers, changes=changes):
            sign_in = json.dumps({"token": tokens.get(role, "wrong")})
            for k, each in enumerate(everything):
                if each.path.endswith("/events") or (k + number) % 3 == 0:
                    continue
                for query in ("", f"?note={marks}"):
                    status, _ = ask(connection, each.method, each.path + query, sign_in if each.path == "/v1/session" else each.body,
                                    tokens.get(role), each.kind)
                    answers[status] += 1
                    changes[number] += each.may_change and 200 <= status < 300
            for _ in range(30):
                ask(connection, "POST", "/v1/session", sign_in)
                ask(connection, "DELETE", "/v1/session", None, tokens.get(role))
            ask(connection, "GET", f"/v1/robots/{marks}", None, tokens.get(role))
            ask(connection, "PUT", f"/v1/robots/{marks}", "{}", tokens.get(role))
        with Attack(programs.url, turn):
            time.sleep(seconds)
        time.sleep(1)  # for the writer
        took_s = time.monotonic() - began
        minutes = took_s // 60 + 2  # that were touched
        after = sizes(programs.store)
        grown = {table: (after[table][0] - before[table][0], after[table][1] - before[table][1]) for table in after
                 if after[table] != before[table]}
        a_day = DAY_S / (took_s if may_change else 60 * math.ceil(took_s / 60))  # the audit has its limits by the minute
        print(f"{role}: {dict(answers)}, rows and bytes of tables grown: {grown}; MB a day: "
              + ", ".join(f"{table} {1e-6 * a_day * grown[table][1]:.1f}" for table in sorted(grown)), flush=True)
        check(sum(answers.values()) > 100 and 200 <= max(answers), f"{role}: {answers}")
        entries = grown.get("audit", (0, 0))[0]
        if may_change:
            check(sum(changes.values()) > 10, f"{role} changed nothing: {answers}")
            check(entries >= 2 * sum(changes.values()), f"{role}: {entries} entries of the audit for {sum(changes.values())} changes")
        else:
            check(sum(changes.values()) == 0 and set(grown) <= {"audit", "joulecast_store"}, f"{role}: {grown}")
            check(entries <= minutes * ENTRIES_A_MINUTE, f"{role}: {grown} in {minutes} minutes")
    with sqlite3.connect(f"file:{programs.store}?mode=ro", uri=True) as database:
        longest = database.execute("SELECT max(length(detail_json)) FROM audit").fetchone()[0]
    check(longest < ENTRY_BYTES, f"an entry of the audit has {longest} bytes")


def main():
    options = arguments()
    programs = Programs(options)
    programs.lcm_url = "memq://"
    tokens = {role: subprocess.run([options.client, "token", "create", "--file", programs.path("tokens.json"), "--name", role, "--role", role],
                                   check=True, capture_output=True, text=True).stdout.strip() for role in ROLES[1:]}
    programs.settings = ["--auth-token-file", programs.path("tokens.json")]
    programs.start()
    connection = http.client.HTTPConnection(urllib.parse.urlparse(programs.url).netloc, timeout=20)
    robot = (pathlib.Path(options.source) / "deploy/robots/amr.json").read_text()
    check(ask(connection, "PUT", "/v1/robots/amr", robot, tokens["admin"])[0] in (200, 201), "PUT of the robot")
    document = json.loads(ask(connection, "GET", "/openapi.json", None, tokens["admin"])[1])
    connection.close()
    growth(programs, document, tokens, options.roles, options.seconds)  # first: the refusals of a minute are in the audit once
    if "nobody" in options.roles:
        with concurrent.futures.ProcessPoolExecutor(1) as probe:  # the attackers take turns in one interpreter
            largest_bodies(programs.url, document, options.seconds, probe)
    check(programs.stop() == 0, "stop")


main()
