#!/usr/bin/env python3
"""Loads a real joulecastd over LCM UDP on loopback and prints its cost.

  daemon_load.py --daemon joulecastd --client joulecast [--rate 20000] [--seconds 60]

Publishes telemetry of many robots in real time at a fixed rate, bounded in count and time, from a log written beforehand. No
message may be lost according to the daemon's counters. Reports the daemon's share of one core, the time from sample to queryable state,
and the profile and mission endpoints under that load. Needs multicast on loopback.
"""
import argparse
import http.client
import json
import os
import re
import socket
import statistics
import subprocess
import tempfile
import time


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def cpu_seconds(pid):
    fields = open(f"/proc/{pid}/stat").read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Api:
    def __init__(self, port):
        self.connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)

    def call(self, method, path, body=None):
        headers = {"Content-Type": "application/json"} if body is not None else {}
        self.connection.request(method, path, None if body is None else json.dumps(body), headers)
        reply = self.connection.getresponse()
        return reply.status, reply.read()


def counters(api):
    text = api.call("GET", "/metrics")[1].decode()
    found = {}
    for name, value in re.findall(r"^(joulecast_ingest_\S+) (\S+)$", text, re.M):
        found[name] = float(value)
    return found


def quantile(values, q):
    return sorted(values)[min(len(values) - 1, int(q * len(values)))]


def timed_calls(api, method, path, body, seconds):
    times = []
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        began = time.perf_counter()
        status, _ = api.call(method, path, body)
        assert status == 200, status
        times.append(time.perf_counter() - began)
    return times


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--daemon", required=True)
    arguments.add_argument("--client", required=True)
    arguments.add_argument("--rate", type=int, default=20000)
    arguments.add_argument("--seconds", type=int, default=60)
    options = arguments.parse_args()
    rate_hz = 200
    options.robots = max(1, options.rate // rate_hz)
    lcm = f"udpm://239.255.76.67:{free_port()}?ttl=0&recv_buf_size=4194304"
    with tempfile.TemporaryDirectory() as folder:
        log = f"{folder}/load.lcmlog"
        port = free_port()
        daemon = subprocess.Popen([options.daemon, "--store-path", f"{folder}/h.db", "--http-port", str(port), "--lcm-url", lcm,
                                   "--log-level", "warning"])
        try:
            api = Api(port)
            for _ in range(100):
                try:
                    if api.call("GET", "/readyz")[0] == 200:
                        break
                except OSError:
                    api = Api(port)
                time.sleep(0.05)
            seed_robots(options, lcm, port)
            # Later than the initial telemetry, so that no clock steps back.
            start = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(time.time() + 1))
            subprocess.run([options.client, "simulate", "--robots", str(options.robots), "--seed", "5", "--rate", str(rate_hz), "--duration",
                            str(options.seconds), "--start", start, "--log", log, "--truth", f"{folder}/truth.json", "--quiet"], check=True)
            before = counters(api)
            cpu, began = cpu_seconds(daemon.pid), time.monotonic()
            replay = subprocess.Popen([options.client, "replay", log, "--lcm-url", lcm, "--speed", "0", "--max-rate", str(options.rate)],
                                      stdout=subprocess.DEVNULL)
            time.sleep(min(5, options.seconds / 4))
            robot = json.loads(api.call("GET", "/v1/robots")[1])["robots"][0]["robot_id"]
            mission = json.loads(api.call("GET", "/v1/missions?limit=1")[1])["missions"][0]["id"]
            profile = timed_calls(api, "POST", f"/v1/robots/{robot}/profile", {"path": [{"kind": "straight", "length_m": 10}]}, 5)
            summary = timed_calls(api, "GET", f"/v1/missions/{mission}", None, 5)
            replay.wait()
            wall = time.monotonic() - began
            time.sleep(1.5)
            spent = cpu_seconds(daemon.pid) - cpu
            after = counters(api)
        finally:
            daemon.terminate()
            daemon.wait()
    received = after["joulecast_ingest_messages_total"] - before["joulecast_ingest_messages_total"]
    samples = after["joulecast_ingest_samples_total"] - before["joulecast_ingest_samples_total"]
    missing = after['joulecast_ingest_faults_total{reason="missing"}'] - before['joulecast_ingest_faults_total{reason="missing"}']
    print(f"messages received {received:.0f} in {wall:.1f} s ({received / wall:.0f} a second), samples {samples:.0f}, missing {missing:.0f}")
    print(f"daemon: {100 * spent / wall:.0f} % of one core, {1e6 * spent / received:.2f} us a message, ceiling about {received / spent:.0f} a second")
    for name, times in (("profile", profile), ("mission", summary)):
        print(f"{name}: {len(times)} calls, median {1e3 * statistics.median(times):.2f} ms, p99 {1e3 * quantile(times, 0.99):.2f} ms")


def seed_robots(options, lcm, port):
    """Registers the robots of the load: the simulator sends its robot files to the daemon."""
    subprocess.run([options.client, "simulate", "--robots", str(options.robots), "--seed", "5", "--duration", "0.1", "--lcm-url", lcm,
                    "--server", f"http://127.0.0.1:{port}", "--quiet"], check=True)


if __name__ == "__main__":
    main()
