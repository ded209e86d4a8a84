#!/usr/bin/env python3
"""A daemon with honest robots, hostile ones and writing clients, under random faults from a seeded list, and a check of the
result: every acknowledged write is stored and in force, every rejected write was not done, every accepted sample is in exactly
one mission, every ledger closes, the store is intact. Every fault occurs once, in any order, and repeatedly with --hours N."""
import argparse
import collections
import contextlib
import errno
import http.client
import json
import os
import pathlib
import random
import shutil
import socket
import sqlite3
import struct
import subprocess
import threading
import time
import urllib.error
import urllib.request

import harness
from harness import GROUP, Programs, check, need_multicast
from host_faults import READS, SYNCS, WRITES, HostFaults

ROBOTS, RATE_HZ = 4, 20
LOST_S = 1.3  # of each robot's samples: by a kill, or by a replaced store in addition to the samples during the copy
READY_S = 30
TERMS = ("accessories driver copper brush friction_internal friction_rolling friction_scrub friction_zone friction_slip drag "
         "kinetic potential braking recovered sensor unexplained").split()


def options_of():
    parser = argparse.ArgumentParser()
    for name in ("daemon", "client", "source", "shared"):
        parser.add_argument("--" + name, required=name != "shared")
    parser.add_argument("--hours", type=float, default=0)
    parser.add_argument("--seed", type=int, default=1)
    return parser.parse_args()


class Party(threading.Thread):
    """Repeats `turn` until it is ended; `finish` raises its failure."""

    def __init__(self):
        super().__init__(daemon=True)
        self.ended, self.failure = False, None

    def run(self):
        try:
            while not self.ended:
                self.turn()
        except BaseException as failure:  # a failed check is a SystemExit, which would end this thread only
            self.failure = failure

    def finish(self):
        self.ended = True
        self.join()
        if self.failure:
            raise self.failure


class Writers(Party):
    """Sends new models of robots one after the other and stores the answers."""

    def __init__(self, programs, model):
        super().__init__()
        self.programs, self.model = programs, model
        self.pause = threading.Lock()  # held during a write
        self.written = {f"written-{k}": [] for k in range(3)}  # robot -> [(idle power, outcome)]
        self.count = 0

    def turn(self):
        for robot, history in self.written.items():
            with self.pause:
                self.count += 1
                power = 10 + self.count / 64  # W: always a new one, within one hour below the battery's limit
                history.append((power, self.put(robot, power)))
            time.sleep(0.05)

    def put(self, robot, power):
        try:
            self.programs.put(f"/v1/robots/{robot}", self.model | {"robot_id": robot, "idle_power_w": power})
            return "done"
        except urllib.error.HTTPError as error:
            check(error.code == 503, f"PUT of {robot}: {error.code}")
            return "not done"
        except (OSError, http.client.HTTPException):
            return "unknown"  # no answer or a partial one: both outcomes are valid


class Hostile(Party):
    """Sends invalid packets, and corrupted copies of messages under its own robot ids. Never as an honest robot."""

    def __init__(self, programs, seed):
        super().__init__()
        self.random = random.Random(seed)
        self.port, self.sent = programs.lcm_port, 0
        self.heard = collections.deque(maxlen=50)
        self.listener = harness.Listener(self.port)
        self.sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)

    def turn(self):
        for _, channel, payload in self.listener.messages(0.05):
            if channel.startswith("ROBOT_") and "hostile" not in channel:
                self.heard.append((channel.split(".")[0], payload))
                break
        for _ in range(10):
            self.sender.sendto(self.packet(), (GROUP, self.port))
            self.sent += 1
        time.sleep(0.02)

    def packet(self):
        r = self.random
        kind = r.randrange(4)
        if kind == 0 or not self.heard:
            return r.randbytes(r.randrange(1, 200))
        subject, payload = r.choice(self.heard)
        if kind == 1:  # a fragment with a false header
            return (b"LC03" + struct.pack(">IIIHH", r.getrandbits(32), r.choice([1000, 2**31, 2**32 - 1]),
                                          r.choice([0, 999, 2**32 - 1]), r.randrange(3), r.randrange(3))
                    + f"{subject}.hostile\0".encode() + payload[:r.randrange(1, 200)])
        payload = bytearray(payload)
        for _ in range(r.randrange(1, 20)):
            payload[r.randrange(len(payload))] = r.randrange(256)
        name = r.choice(["hostile", f"hostile-{r.randrange(5000)}", "../x", ""])
        return b"LC02" + struct.pack(">I", r.getrandbits(32)) + f"{subject}.{name}\0".encode() + bytes(payload)


class Nemesis:
    def __init__(self, options):
        self.options = options
        self.random = random.Random(options.seed)
        self.programs = Programs(options)
        self.faults = collections.Counter()
        self.accepted = 0  # samples of ended daemons
        self.losses = 0    # number of losses of up to LOST_S
        self.worst_ready_s = 0
        self.worst_copy_s = 0  # from the start of a copy of the store until the removal of the store
        self.volume = self.programs.path("volume")
        os.mkdir(self.volume)
        room = f"size={96 + 2048 * options.hours:.0f}m"  # twice the writers' need
        self.mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", room, "tmpfs", self.volume],
                                      capture_output=True).returncode == 0
        self.programs.store = os.path.join(self.volume, "history.db")
        self.host = HostFaults(self.programs.folder.name)
        self.programs.environment = self.host.environment
        self.kinds = (["kill", "pause", "lock", "term", "replaced", "deleted", "read_only", "broken", "clock"]
                      + ["full"] * self.mounted)

    def ready(self):
        try:
            with urllib.request.urlopen(self.programs.url + "/readyz", timeout=5):
                return True
        except (OSError, http.client.HTTPException):
            return False

    def wait(self, truth, text, seconds=READY_S):
        until = time.monotonic() + seconds
        while not truth():
            check(self.programs.process.poll() is None, f"the daemon ended ({self.programs.process.poll()}): {text}")
            check(time.monotonic() < until, f"not within {seconds} s: {text}")
            time.sleep(0.05)

    def start(self):
        began = time.monotonic()
        self.programs.start()
        self.wait(self.ready, "ready after a start")
        self.worst_ready_s = max(self.worst_ready_s, time.monotonic() - began)

    def count(self):
        self.accepted += self.programs.metric("joulecast_ingest_samples_total")

    def kill(self):
        self.count()
        self.programs.kill()
        self.losses += 1
        self.start()

    def term(self):
        check(self.programs.stop() == 0, "stop")
        self.start()

    def pause(self):
        self.programs.process.send_signal(19)
        time.sleep(self.random.uniform(0.5, 3))
        self.programs.process.send_signal(18)

    def lock(self):
        holder = sqlite3.connect(self.programs.store, isolation_level=None, timeout=READY_S)
        holder.execute("BEGIN EXCLUSIVE")
        time.sleep(self.random.uniform(1, 5))
        holder.close()

    def full(self):
        ballast = os.path.join(self.volume, "ballast")
        with open(ballast, "wb", buffering=0) as file:
            try:
                while True:
                    file.write(bytes(1 << 16))
            except OSError:
                pass
        # An older store has free pages and a journal, which hold new data for a while.
        if self.options.hours < 0.1:
            self.wait(lambda: not self.ready(), "a full disk is detected")
        else:
            time.sleep(5)
        time.sleep(self.random.uniform(0, 3))
        os.remove(ballast)

    def broken(self):
        """Accesses to the store's files fail with EIO, for some time or in short bursts."""
        what = self.random.choice([WRITES, WRITES | SYNCS, SYNCS, READS, WRITES | READS | SYNCS])
        for _ in range(self.random.choice([1, 1, 10])):
            self.host.fail_disk(what, errno.EIO)
            time.sleep(self.random.uniform(0.01, 2))
            self.host.fail_disk(0)
            time.sleep(self.random.uniform(0, 0.2))

    def clock(self):
        """The host's clock is set wrong, and corrected."""
        self.host.set_clock(self.random.choice([-86400, -3600, -30, 30, 3600, 60 * 86400]))
        time.sleep(self.random.uniform(0.5, 4))
        self.host.set_clock(0)

    def read_only(self):
        """The folder is mounted read-only over itself: shortly, during commits, and then until the daemon detects it."""
        for detected in [False] * 20 + [True]:
            time.sleep(self.random.uniform(0, 0.1))
            while True:
                if subprocess.run(["mount", "--bind", self.volume, self.volume], capture_output=True).returncode != 0:
                    return
                if subprocess.run(["mount", "-o", "remount,ro,bind", self.volume], capture_output=True).returncode == 0:
                    break
                # The daemon opened a file for writing in between.
                subprocess.run(["umount", "-l", self.volume], check=True)
            if detected:
                self.wait(lambda: not self.ready(), "a read-only store is detected")
                time.sleep(self.random.uniform(0, 2))
            subprocess.run(["umount", "-l", self.volume], check=True)

    def replaced(self, deleted=False):
        """The store is replaced by a copy, or deleted and restored after the daemon has ended."""
        store, copy = self.programs.store, self.programs.path("copy.db")
        with self.writers.pause:
            began = time.monotonic()
            with (contextlib.closing(sqlite3.connect(store, timeout=READY_S)) as source,
                  contextlib.closing(sqlite3.connect(copy)) as target):
                source.backup(target)
            for suffix in ("", "-wal", "-shm"):
                pathlib.Path(store + suffix).unlink(missing_ok=True)
            self.worst_copy_s = max(self.worst_copy_s, time.monotonic() - began)
            if not deleted:
                shutil.copy(copy, store)
        self.losses += 1
        self.wait(lambda: not self.ready(), "a missing store is detected")
        time.sleep(0.5)
        self.count()
        check(self.programs.stop() == 0, "stop")
        if deleted:
            shutil.copy(copy, store)
        os.remove(copy)
        self.start()

    def deleted(self):
        self.replaced(deleted=True)

    def run(self):
        model = json.load(open(os.path.join(self.options.source, "deploy/robots/amr.json")))
        self.start()
        self.programs.put("/v1/robots/hostile", model | {"robot_id": "hostile"})
        fleet = subprocess.Popen([self.options.client, "simulate", "--robots", str(ROBOTS), "--lcm-url", self.programs.lcm_url,
                                  "--server", self.programs.url, "--rate", str(RATE_HZ), "--mission-duration", "8", "--quiet"])
        self.writers = Writers(self.programs, model)
        hostile = Hostile(self.programs, self.options.seed)
        try:
            self.wait(lambda: self.programs.metric("joulecast_robots_live") >= ROBOTS, "robots are live", 60)
            self.writers.start()
            hostile.start()
            began = time.monotonic()
            until = began + 3600 * self.options.hours
            left = []
            while left or not self.faults or time.monotonic() < until:
                time.sleep(self.random.uniform(1, 4))
                left = left or self.random.sample(self.kinds, len(self.kinds))
                kind = left.pop()
                print(f"{time.monotonic() - began:6.1f} s {kind}", flush=True)  # shows the progress of a failed run
                if kind == "term":
                    self.count()
                getattr(self, kind)()
                self.faults[kind] += 1
                self.wait(self.ready, f"ready after {kind}")
        finally:
            fleet.terminate()
            fleet.wait()
        self.writers.finish()
        hostile.finish()
        check(fleet.returncode in (0, -15, 130, 143), f"simulate ended {fleet.returncode}")
        self.count()
        self.term()
        print(f"seed {self.options.seed}: {dict(self.faults)}, {hostile.sent} hostile packets, worst restart "
              f"{self.worst_ready_s:.2f} s, worst copy {self.worst_copy_s:.2f} s")

    def check_writes(self):
        outcomes = collections.Counter()
        for robot, history in self.writers.written.items():
            outcomes.update(outcome for _, outcome in history)
            versions = []
            cursor = ""
            while cursor is not None:
                page = self.programs.get(f"/v1/robots/{robot}/models?limit=1000{cursor and '&cursor='}{cursor}")
                versions += page["models"]
                cursor = page["next_cursor"]
            stored = {v["model"]["idle_power_w"] for v in versions}
            for power, outcome in history:
                check(outcome != "done" or power in stored, f"{robot}: acknowledged {power} W is not stored")
                check(outcome != "not done" or power not in stored, f"{robot}: rejected {power} W is stored")
            last = max(k for k, (_, outcome) in enumerate(history) if outcome == "done")
            possible = {history[last][0]} | {power for power, outcome in history[last:] if outcome == "unknown"}
            now = self.programs.get(f"/v1/robots/{robot}")["model"]["idle_power_w"]
            check(now in possible, f"{robot}: {now} W is in force, acknowledged was {possible}")
        print(f"writes: {dict(outcomes)}")

    def check_samples(self):
        stored = in_missions = cut = 0
        robots = [r["robot_id"] for r in self.programs.get("/v1/robots")["robots"]]
        for robot in robots:
            if robot.startswith("written"):
                continue
            missions, cursor = [], ""
            while cursor is not None:
                page = self.programs.get(f"/v1/missions?limit=1000&robot_id={robot}{cursor and '&cursor='}{cursor}")
                missions += page["missions"]
                cursor = page["next_cursor"]
            seen = {}
            for mission in missions:
                telemetry = self.programs.get(f"/v1/missions/{mission['id']}/telemetry?limit=100000")
                in_missions += mission["samples"]
                stored += len(telemetry["sequence"])
                missing = mission["samples"] - len(telemetry["sequence"])
                cut += missing > 0
                check(0 <= missing <= (LOST_S + self.worst_copy_s) * RATE_HZ,
                      f"{robot} {mission['mission_id']}: {len(telemetry['sequence'])} samples of {mission['samples']} stored")
                for sample in zip(telemetry["utime_us"], telemetry["sequence"]):
                    check(sample not in seen, f"{robot}: sample {sample} is in {mission['id']} and {seen.get(sample)}")
                    seen[sample] = mission["id"]
        # Samples committed after the copy that replaced the store; the mission's ledger continues.
        replaced = self.faults["replaced"] + self.faults["deleted"]
        check(cut <= ROBOTS * replaced, f"{cut} missions have samples that are not stored, the store was replaced {replaced} times")
        lost = self.accepted - stored
        allowed = self.losses * (LOST_S + self.worst_copy_s) * ROBOTS * RATE_HZ
        print(f"samples: {self.accepted:.0f} accepted, {stored} stored once, {self.losses} times some may be lost")
        check(stored > 0 and lost <= allowed, f"{lost} samples are lost, {allowed:.0f} may be")

    def check_store(self):
        check(self.programs.stop() == 0, "stop")
        ledger = " + ".join(("-" if term == "recovered" else "") + f"coalesce(ledger_{term}_j, 0)" for term in TERMS)
        with sqlite3.connect(f"file:{self.programs.store}?mode=ro", uri=True) as store:
            check(store.execute("PRAGMA integrity_check").fetchone()[0] == "ok", "the history is damaged")
            check(not store.execute("PRAGMA foreign_key_check").fetchall(), "a foreign key is violated")
            missions, = store.execute("SELECT count(*) FROM mission").fetchone()
            open_ = store.execute(f"SELECT mission_id, battery_j, {ledger} FROM mission WHERE abs(battery_j - ({ledger})) > "
                                  "1e-6 * (1 + abs(battery_j))").fetchall()
            check(not open_, f"ledgers do not close: {open_[:5]}")
        done = subprocess.run([self.options.daemon, "--store-path", self.programs.store, "--check-store"],
                              capture_output=True, text=True)
        check(done.returncode == 0, f"--check-store: {done.stdout}{done.stderr}")
        print(done.stdout.strip(), f"({missions} missions)")


def main():
    options = options_of()
    need_multicast()
    nemesis = Nemesis(options)
    try:
        nemesis.run()
        nemesis.check_writes()
        nemesis.check_samples()
        nemesis.check_store()
    finally:
        nemesis.programs.end()
        if nemesis.mounted:
            subprocess.run(["umount", "-l", nemesis.volume])


main()
