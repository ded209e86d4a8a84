#!/usr/bin/env python3
"""A store that accepts no data for some time, or is removed under the running daemon: metering and reading continue, requests
answered with 503 are not done, the watchdog is fed, SIGTERM ends the daemon within 15 s, and accepted data is not lost."""
import errno
import json
import os
import pathlib
import shutil
import socket
import sqlite3
import subprocess
import threading
import time
import urllib.error
import urllib.request

from harness import Programs, arguments, check, need_multicast, wait_until
from host_faults import WRITES, HostFaults

STALL_S = 12
ROBOTS = 8
READ_S = 1.0  # a read, while the store is stalled
REFUSE_S = 4.0  # a write: SQLite waits 2 s for the lock
STOP_S = 15.0


def status_of(programs, path, document=None):
    """(HTTP status, seconds) of a GET or, with a document, a PUT."""
    began = time.monotonic()
    try:
        programs.put(path, document) if document else urllib.request.urlopen(programs.url + path, timeout=30).read()
        status = 200
    except urllib.error.HTTPError as error:
        status = error.code
    return status, time.monotonic() - began


class Watchdog:
    """Counts the daemon's messages to systemd's watchdog."""

    def __init__(self, programs):
        self.beats = 0
        path = programs.path("notify")
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(path)
        os.environ.update(NOTIFY_SOCKET=path, WATCHDOG_USEC="3000000")
        threading.Thread(target=self.count, daemon=True).start()

    def count(self):
        while True:
            self.beats += b"WATCHDOG=1" in self.socket.recv(4096)


def lock(programs):
    store = sqlite3.connect(programs.store, isolation_level=None)
    store.execute("BEGIN EXCLUSIVE")
    return store


def stalled(programs, options):
    """The store is locked by another program for some seconds."""
    model = json.load(open(os.path.join(options.source, "deploy/robots/amr.json")))
    programs.put("/v1/robots/amr", model)
    watchdog = Watchdog(programs)
    programs.stop()
    programs.start()
    fleet = subprocess.Popen([options.client, "simulate", "--robots", str(ROBOTS), "--lcm-url", programs.lcm_url, "--server",
                              programs.url, "--rate", "50", "--mission-duration", "20", "--quiet"])
    try:
        wait_until(lambda: programs.metric("joulecast_robots_live") == ROBOTS, 30, "robots are live")
        holder = lock(programs)
        began = time.monotonic()
        model["idle_power_w"] += 10
        beats = watchdog.beats
        samples = programs.metric("joulecast_ingest_samples_total")
        worst_read = 0
        refused = []
        while time.monotonic() - began < STALL_S:
            for path in ("/v1/missions", "/v1/robots", "/healthz"):
                status, took = status_of(programs, path)
                check(status == 200, f"GET {path} while stalled: {status}")
                worst_read = max(worst_read, took)
            if len(refused) < 4:
                refused.append(status_of(programs, "/v1/robots/amr", model))
                check(refused[-1][0] == 503 and refused[-1][1] < REFUSE_S, f"PUT while stalled: {refused[-1]}")
            time.sleep(0.2)
        check(worst_read < READ_S, f"a read took {worst_read:.2f} s")
        check(status_of(programs, "/readyz")[0] == 503, "readyz reports ready")
        accounted = programs.metric("joulecast_ingest_samples_total") - samples
        expected = ROBOTS * 50 * STALL_S
        check(accounted > 0.9 * expected, f"{accounted} samples accounted for of {expected}")
        check(watchdog.beats - beats >= STALL_S - 3, f"{watchdog.beats - beats} beats of the watchdog in {STALL_S} s")
        commands = programs.metric("joulecast_store_queue_commands")
        print(f"stalled for {STALL_S} s: {accounted:.0f} samples accounted for, {commands:.0f} commands and "
              f"{programs.metric('joulecast_store_queue_bytes') / 1e6:.1f} MB wait, worst read {worst_read:.2f} s, "
              f"PUT refused within {max(took for _, took in refused):.2f} s")
        check(commands < 100 * ROBOTS, f"{commands} commands wait: checkpoints were not merged")
        holder.close()
        wait_until(lambda: status_of(programs, "/readyz")[0] == 200, 10, "ready again")
        robot = programs.get("/v1/robots/amr")
        check(robot["model_version"] == 1, f"a rejected PUT was done: {robot}")
        with sqlite3.connect(f"file:{programs.store}?mode=ro", uri=True) as store:
            check(store.execute("SELECT count(*) FROM model WHERE robot_id = 'amr'").fetchone()[0] == 1, "model versions")

        # Stop while the store is stalled again.
        holder = lock(programs)
        time.sleep(3)
        began = time.monotonic()
        check(programs.stop() == 0, "the daemon did not stop in order")
        took = time.monotonic() - began
        check(took < STOP_S, f"SIGTERM took {took:.1f} s")
        check(os.path.exists(programs.store + ".spool"), "no spool")
        print(f"SIGTERM while stalled: ended within {took:.1f} s, spool of {os.path.getsize(programs.store + '.spool')} bytes")
        holder.close()
    finally:
        fleet.terminate()
        fleet.wait()
        for name in ("NOTIFY_SOCKET", "WATCHDOG_USEC"):
            os.environ.pop(name, None)
    programs.start()
    check(not os.path.exists(programs.store + ".spool"), "the spool was not imported")
    programs.stop()
    with sqlite3.connect(f"file:{programs.store}?mode=ro", uri=True) as store:
        check(store.execute("PRAGMA integrity_check").fetchone()[0] == "ok", "the history is damaged")
        rows = store.execute("SELECT robot_id, sum(samples), sum(telemetry_samples) FROM mission WHERE robot_id <> 'amr' "
                             "GROUP BY robot_id").fetchall()
    for robot, accounted, stored in rows:
        check(stored == accounted and stored > 50 * STALL_S, f"{robot}: {stored} samples stored of {accounted} accounted for")
    check(len(rows) == ROBOTS, f"robots: {rows}")


def late_spool(programs, options):
    """A spool for which the disk has no room is kept for the next start. One that comes back after the store has moved on changes
    nothing, and is kept."""
    programs.start()
    fleet = subprocess.Popen([options.client, "simulate", "--robots", "2", "--lcm-url", programs.lcm_url, "--server", programs.url,
                              "--rate", "20", "--mission-duration", "30", "--quiet"])
    try:
        wait_until(lambda: programs.metric("joulecast_robots_live") == 2, 30, "robots are live")
        holder = lock(programs)
        time.sleep(2)
        check(programs.stop() == 0, "the daemon did not stop in order")
        holder.close()
    finally:
        fleet.terminate()
        fleet.wait()
    spool, saved = programs.store + ".spool", programs.path("late.spool")
    start = [options.daemon, "--http-port", "0", "--store-path", programs.store, "--lcm-url", programs.lcm_url]
    content, disk = pathlib.Path(spool).read_bytes(), HostFaults(programs.folder.name)
    disk.fail_disk(WRITES, errno.ENOSPC)
    done = subprocess.run(start, capture_output=True, text=True, timeout=30, env=os.environ | disk.environment)
    check(done.returncode not in (0, None) and done.returncode > 0, f"a daemon runs although the disk has no room for its spool: {done}")
    check(pathlib.Path(spool).read_bytes() == content, "the spool was changed")
    os.rename(spool, saved)

    def missions_after_start():
        programs.start()
        check(programs.stop() == 0, "stop")
        with sqlite3.connect(f"file:{programs.store}?mode=ro", uri=True) as store:
            return store.execute("SELECT mission_key, state, samples, telemetry_samples FROM mission").fetchall()

    before = missions_after_start()
    shutil.copy(saved, spool)
    check(missions_after_start() == before, "a late spool changed missions")
    check(not os.path.exists(spool) and os.path.exists(spool + ".refused-1"), "a late spool is not kept")
    os.mkdir(spool)  # cannot be read
    done = subprocess.run(start, capture_output=True, text=True, timeout=30)
    check(done.returncode != 0 and "spool" in done.stderr, f"a daemon runs beside a spool that it cannot read: {done}")
    os.rmdir(spool)


def taken_away(programs, options, how):
    """The database file is deleted, replaced or made read-only under the idle daemon."""
    model = json.load(open(os.path.join(options.source, "deploy/robots/amr.json")))
    programs.start()
    wait_until(lambda: status_of(programs, "/readyz")[0] == 200, 10.0, "readyz after the start")
    if how == "deleted":
        for suffix in ("", "-wal", "-shm"):
            os.remove(programs.store + suffix)
    elif how == "replaced":
        shutil.copy(programs.store, programs.store + ".copy")
        os.replace(programs.store + ".copy", programs.store)
    began = time.monotonic()
    wait_until(lambda: status_of(programs, "/readyz")[0] == 503, 2.0, f"readyz of a store that was {how}")
    print(f"{how}: detected within {time.monotonic() - began:.2f} s")
    check(programs.metric("joulecast_store_healthy") == 0, "joulecast_store_healthy")
    model["idle_power_w"] += 20
    check(status_of(programs, "/v1/robots/amr", model)[0] == 503, "a PUT was acknowledged")
    check(programs.stop() == 0, "stop")
    programs.log.seek(0)
    check(f"was {how} under the running program" in programs.log.read(), "the log does not report it")


def main():
    options = arguments()
    need_multicast()
    programs = Programs(options)
    programs.start()
    stalled(programs, options)
    late_spool(programs, options)
    for how in ("replaced", "deleted"):
        taken_away(programs, options, how)


main()
