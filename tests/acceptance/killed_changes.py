#!/usr/bin/env python3
"""A daemon killed at each write of its store while it makes a change under an idempotency key: repeated under that key after
a restart, the change is done exactly once, with its event, its audit and one answer."""
import hashlib
import json
import os
import shutil
import sqlite3
import subprocess
import time
import urllib.error
import urllib.request

from harness import Programs, arguments, check, skip, wait_until

MOST_WRITES = 40  # of one change; the loop ends where a change survives


def ask(programs, method, path, key, document=None):
    """(status, body), or None where the daemon died."""
    headers = {"Idempotency-Key": key} | ({"Content-Type": "application/json"} if document is not None else {})
    data = json.dumps(document).encode() if document is not None else None
    request = urllib.request.Request(programs.url + path, method=method, data=data, headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=30) as reply:
            return reply.status, json.load(reply)
    except urllib.error.HTTPError as error:
        return error.code, json.load(error)
    except (urllib.error.URLError, OSError):
        return None


def kill_at(programs, call, number):
    """strace that kills the daemon at the call of that number, of any of its threads; ready when this returns."""
    log = open(programs.path("strace.log"), "w+")
    tracer = subprocess.Popen(["strace", "-f", "-p", str(programs.process.pid), "-e", f"trace={call}",
                               "-e", f"inject={call}:signal=KILL:when={number}"], stderr=log, stdout=log)

    def attached():
        log.seek(0)
        return "attached" in log.read() or tracer.poll() is not None

    wait_until(attached, 20, "strace attaches")
    return tracer


def rows(programs, sql):
    with sqlite3.connect(f"file:{programs.store}?mode=ro", uri=True) as store:
        return store.execute(sql).fetchall()


def is_chained(programs):
    """Whether each entry's hash covers the one before."""
    previous = "0" * 64
    for *members, entry_hash in rows(programs, "SELECT audit_id, utime_us, actor, address, request_id, action, detail_json, hash "
                                               "FROM audit ORDER BY audit_id"):
        covered = b"".join(b"%d:%s," % (len(text), text) for text in (str(member).encode() for member in (previous, *members)))
        previous = hashlib.sha256(covered).hexdigest()
        if previous != entry_hash:
            return False
    return True


def restore(programs, saved):
    for suffix in ("", "-wal", "-shm"):
        if os.path.exists(programs.store + suffix):
            os.remove(programs.store + suffix)
    shutil.copy(saved, programs.store)


def run(programs, saved, call, name, method, path, document, done):
    """Kills at the first, second, ... write of the change, until it survives; how often it was killed."""
    kills = 0
    for number in range(1, MOST_WRITES):
        restore(programs, saved)
        programs.start()
        tracer = kill_at(programs, call, number)
        first = ask(programs, method, path, "key", document)
        survived = first is not None
        tracer.kill()
        tracer.wait()
        if survived:
            check(first[0] < 300, f"{name}: {first}")
            programs.stop()
        else:
            programs.process.wait(timeout=10)
            kills += 1
        programs.start()
        again = ask(programs, method, path, "key", document)
        check(again is not None and again[0] < 300, f"{name}, killed at {call} {number}: repeated {again}")
        thrice = ask(programs, method, path, "key", document)
        check(thrice == again, f"{name}, killed at {call} {number}: {thrice} after {again}")
        check(not survived or again[1] == first[1], f"{name}: {again} after {first}")
        check(programs.stop() == 0, "stop")
        done(f"{name}, killed at {call} {number}")
        if survived:
            return kills
    check(False, f"{name}: {MOST_WRITES} writes")


def main():
    options = arguments()
    if shutil.which("strace") is None or subprocess.run(["strace", "-o", "/dev/null", "true"]).returncode != 0:
        skip("strace cannot trace here")
    programs = Programs(options)
    model = json.load(open(os.path.join(options.source, "deploy/robots/amr.json")))
    programs.start()
    programs.put("/v1/robots/amr", model)
    check(programs.stop() == 0, "stop")
    with sqlite3.connect(programs.store, isolation_level=None) as store:
        store.execute("INSERT INTO mission (mission_key, robot_id, mission_id, start_utime_us, end_utime_us, state, implicit, incomplete, "
                      "incomplete_reason, note, model_version, samples, sample_faults, gap_count) "
                      "VALUES (1, 'amr', 'm', 1000000, 9000000, 'finished', 0, 0, '', '', 1, 0, '{}', 0)")
        store.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    saved = programs.path("saved.db")
    shutil.copy(programs.store, saved)
    model["idle_power_w"] += 10

    def counts(sql, expected):
        def done(text):
            found = rows(programs, sql)
            check(found == expected, f"{text}: {found}, must be {expected}")
            entries = rows(programs, "SELECT count(*) FROM audit WHERE detail_json = '{\"status\":200}' OR detail_json = '{\"status\":202}'")
            check(entries[0][0] >= 2, f"{text}: the audit has {entries} answers")  # of the PUT before and of this
            check(is_chained(programs), f"{text}: the audit's chain is broken")
        return done

    changes = [
        ("annul", "POST", "/v1/missions/1/annul", {"reason": "test"},
         counts("SELECT (SELECT count(*) FROM event WHERE kind = 'mission_annulled'), findings_json LIKE '%annulled%' FROM mission", [(1, 1)])),
        ("diagnose", "POST", "/v1/diagnoses", {"robot_id": "amr", "missions": [1]},
         counts("SELECT count(*) FROM diagnosis", [(1,)])),
        ("put", "PUT", "/v1/robots/amr", model, counts("SELECT count(*) FROM model", [(2,)])),
        ("remove", "DELETE", "/v1/robots/amr?history=purge", None,
         counts("SELECT (SELECT count(*) FROM robot), count(*) FROM event WHERE kind = 'robot_removed'", [(0, 1)])),
    ]
    began = time.monotonic()
    for name, *change in changes:
        kills = [run(programs, saved, call, name, *change) for call in ("pwrite64", "fdatasync")]
        print(f"{name}: killed at {kills[0]} writes and {kills[1]} syncs, each time done once")
        check(kills[0] > 0, f"{name}: never killed")
    print(f"{time.monotonic() - began:.0f} s")


if __name__ == "__main__":
    main()
