#!/usr/bin/env python3
"""Latency of autonomy answers over HTTP: one robot with a plan of 20 legs, and a fleet in one call.

  autonomy_latency.py --daemon build/server/joulecastd --source . [--robots 1000] [--legs 20] [--port 0]

Starts a daemon with an empty store and ROBOTS robots of the shipped kinds. The bounds are 2 ms for the single query
and 300 ms for the fleet. Exits with 1 if a median is above its bound.
"""
import argparse
import http.client
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time


class Daemon:
    def __init__(self, program, port):
        self.folder = tempfile.TemporaryDirectory()
        self.process = subprocess.Popen(
            [program, "--http-port", str(port), "--store-path", self.folder.name + "/store.db", "--log-format", "json",
             "--lcm-url", "memq://"], stderr=subprocess.PIPE, text=True)
        for line in self.process.stderr:
            event = json.loads(line)
            if event["message"] == "ready":
                self.port = int(event["http"].rsplit(":", 1)[1])
                return
        raise SystemExit("the daemon did not become ready")

    def stop(self):
        self.process.terminate()
        self.process.stderr.close()
        self.process.wait(timeout=20)
        self.folder.cleanup()


def plan(legs, moved):
    tasks = [{"task_id": f"leg {k}", "distances_m": [0, 4 + (k * 13 + moved) % 29], "turns_rad": [0.6 + 0.1 * (k % 7)],
              "payload_kg": 2.0 * (k % 4), "dwell_s": 5} for k in range(legs)]
    return {"state_of_charge": 0.35, "state_of_charge_sd": 0.02, "reserve_fraction": 0.2, "tasks": tasks,
            "charger": {"x_m": 3, "y_m": -4}, "start_pose": {"x_m": 0, "y_m": 0, "heading_rad": 0},
            "payload_kg": 0}


def ask(connection, path, body):
    text = json.dumps(body)
    begun = time.perf_counter()
    connection.request("POST", path, text, {"Content-Type": "application/json"})
    reply = connection.getresponse()
    content = reply.read()
    took = time.perf_counter() - begun
    if reply.status != 200:
        raise SystemExit(f"{path}: {reply.status}: {content[:500]!r}")
    return took, content


def told(name, seconds, bound_ms=None):
    ordered = sorted(1e3 * s for s in seconds)
    p50, p95, last = statistics.median(ordered), ordered[int(0.95 * (len(ordered) - 1))], ordered[-1]
    verdict = "" if bound_ms is None else f"   bound {bound_ms} ms: {'met' if p50 <= bound_ms else 'MISSED'}"
    print(f"{name:<58} median {p50:8.2f}  p95 {p95:8.2f}  worst {last:8.2f} ms{verdict}")
    return bound_ms is None or p50 <= bound_ms


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--daemon", required=True)
    arguments.add_argument("--source", required=True, type=pathlib.Path)
    arguments.add_argument("--robots", type=int, default=1000)
    arguments.add_argument("--legs", type=int, default=20)
    arguments.add_argument("--port", type=int, default=0)
    given = arguments.parse_args()
    daemon = Daemon(given.daemon, given.port)
    try:
        connection = http.client.HTTPConnection("127.0.0.1", daemon.port)
        kinds = [json.loads((given.source / "deploy" / "robots" / f"{kind}.json").read_text())
                 for kind in ("amr", "nomad", "p3dx", "tug")]
        for k in range(given.robots):
            robot = dict(kinds[k % 4], robot_id=f"robot-{k:04}")
            connection.request("PUT", f"/v1/robots/{robot['robot_id']}", json.dumps(robot),
                               {"Content-Type": "application/json"})
            reply = connection.getresponse()
            reply.read()
            if reply.status != 200:
                raise SystemExit(f"PUT robot: {reply.status}")
        met = True
        single = "/v1/robots/robot-0000/autonomy"
        ask(connection, single, plan(given.legs, 0))
        met &= told(f"{given.legs} legs, a different plan each time",
                    [ask(connection, single, plan(given.legs, k))[0] for k in range(200)], 2)
        alone = [ask(connection, single, dict(plan(given.legs, k), compare_minimum_energy=False))[0]
                 for k in range(200)]
        told(f"{given.legs} legs without the minimum-energy comparison", alone)
        told("no plan", [ask(connection, single, {"state_of_charge": 0.5})[0] for _ in range(200)])
        first, content = ask(connection, "/v1/autonomy", {"request": {"state_of_charge": 0.5}})
        print(f"first call of the fleet after start: {1e3 * first:.1f} ms; {len(content)} bytes")
        told(f"fleet of {given.robots}, no plan",
             [ask(connection, "/v1/autonomy", {"request": {"state_of_charge": 0.5}})[0] for _ in range(9)], 300)
        met &= told(f"fleet of {given.robots}, one plan of {given.legs} legs for all",
                    [ask(connection, "/v1/autonomy", {"request": plan(given.legs, k)})[0] for k in range(9)], 300)
        own = [{"robot_id": f"robot-{k:04}", "request": plan(given.legs, k)} for k in range(given.robots)]
        told(f"fleet of {given.robots}, each its own {given.legs} legs",
             [ask(connection, "/v1/autonomy", {"robots": own})[0] for _ in range(5)])
        return 0 if met else 1
    finally:
        daemon.stop()


if __name__ == "__main__":
    sys.exit(main())
