#!/usr/bin/env python3
"""The history in PostgreSQL: missions of simulated robots are stored; during their drive the daemon's connections are terminated
and the server is restarted, without loss. Then the daemon is killed and continues, and the history is copied to SQLite and
back without a difference."""
import json
import os
import pathlib
import subprocess
import tempfile
import time
import urllib.error
import urllib.request

from harness import Programs, arguments, check, need_multicast, start_postgresql, wait_until

ROBOTS = 3
RATE_HZ = 50
MISSION_S = 30
DOWN_S = 6  # of the server


class Server:
    def __init__(self, source):
        self.folder = tempfile.TemporaryDirectory()
        self.script = pathlib.Path(source, "tests", "support", "postgresql.sh")
        self.url = f"postgresql://joulecast@/postgres?host={self.folder.name}"

    def tell(self, what):
        return subprocess.run([self.script, what, self.folder.name]).returncode

    def sql(self, text):
        done = subprocess.run(["psql", self.url, "-XqtAc", text], capture_output=True, text=True)
        check(done.returncode == 0, f"psql: {done.stderr}")
        return done.stdout.strip()


def is_ready(programs):
    try:
        urllib.request.urlopen(programs.url + "/readyz", timeout=10)
    except urllib.error.HTTPError:
        return False
    return True


def checksums(programs, store):
    return json.loads(programs.run("store", "stats", "--store", store, "--json"))["tables"]


def main():
    options = arguments()
    need_multicast()
    server = Server(options.source)
    start_postgresql(server)
    programs = Programs(options)
    programs.settings = ["--store-url", server.url]
    fleet = None
    try:
        programs.start()
        check(not os.path.exists(programs.store), "the daemon made an SQLite file")
        fleet = subprocess.Popen(
            [options.client, "simulate", "--robots", str(ROBOTS), "--lcm-url", programs.lcm_url, "--server", programs.url,
             "--rate", str(RATE_HZ), "--missions", "1", "--mission-duration", str(MISSION_S), "--quiet"])
        open_now = lambda: programs.get("/v1/missions?state=open")["missions"]
        wait_until(lambda: len(open_now()) == ROBOTS, 30, "every robot drives")
        robots = [m["robot_id"] for m in open_now()]
        ended = server.sql("SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE application_name LIKE 'joulecast-%'")
        check(int(ended) >= 2, f"the daemon has {ended} connections")
        wait_until(lambda: is_ready(programs), 10, "the daemon connects again")

        check(server.tell("stop") == 0, "PostgreSQL did not stop")
        wait_until(lambda: not is_ready(programs), 10, "the daemon reports the lost store")
        time.sleep(DOWN_S)
        check(server.tell("start") == 0, "PostgreSQL did not start again")
        wait_until(lambda: is_ready(programs), 20, "the daemon uses its store again")

        samples = {}
        for robot in robots:
            mission, = programs.wait_for(robot, 1, 90)
            samples[robot] = mission["samples"]
            span_s = (mission["end_utime_us"] - mission["start_utime_us"]) * 1e-6
            print(f"{robot}: {mission['state']}, {mission['samples']} samples in {span_s:.1f} s, {mission['gap_count']} gaps")
            check(mission["state"] == "finished", f"{robot}: the mission ended {mission['state']}")
            check(mission["gap_count"] == 0, f"{robot}: {mission['gap_s']} s without samples")
            telemetry = programs.get(f"/v1/missions/{mission['id']}/telemetry?limit=10000")
            stored = telemetry["sequence"]
            check(len(stored) == mission["samples"], f"{robot}: {len(stored)} of {mission['samples']} samples are stored")
            check(stored == list(range(stored[0], stored[0] + len(stored))), f"{robot}: samples are missing or twice")
        fleet.wait(timeout=60)

        # A killed daemon leaves no lock that blocks the next one.
        programs.kill()
        programs.start()
        check({r: programs.missions(r)[0]["samples"] for r in robots} == samples, "the restarted daemon has other missions")
        check(programs.stop() == 0, "the daemon did not stop in order")

        programs.run("store", "verify", "--store", server.url)
        there, back = programs.path("there.db"), f"{server.url}&options=-csearch_path%3Dback"
        server.sql("CREATE SCHEMA back")
        programs.run("store", "copy", "--from", server.url, "--to", there)
        programs.run("store", "copy", "--from", "sqlite:" + there, "--to", back)
        check(checksums(programs, server.url) == checksums(programs, back), "the history came back different")
        print({t["table"]: t["rows"] for t in checksums(programs, there)})
    finally:
        if fleet:
            fleet.terminate()
            fleet.wait()
        programs.end()
        server.tell("stop")


if __name__ == "__main__":
    main()
