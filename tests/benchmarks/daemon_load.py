#!/usr/bin/env python3
"""Loads a real joulecastd over LCM UDP on loopback and over HTTP, and prints its cost.

  daemon_load.py --daemon joulecastd --client joulecast --generator load_generator [--rate 20000] [--seconds 60] [--requests 1000]

Publishes telemetry of many robots in real time at a fixed rate, bounded in count and time, from a log written beforehand, and requests
profiles and a mission meanwhile. No message may be lost according to the daemon's counters. Reports the load, its own cost, and
the daemon's CPU time by thread. Needs multicast on loopback.
"""
import argparse
import json
import os
import re
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def cpu_seconds(pid):
    """CPU time of each thread, in user space and in the kernel."""
    found = {}
    for thread in os.listdir(f"/proc/{pid}/task"):
        fields = open(f"/proc/{pid}/task/{thread}/stat").read().rsplit(")", 1)[1].split()
        found[thread] = [int(ticks) / os.sysconf("SC_CLK_TCK") for ticks in fields[11:13]]
    return found


def get(port, path):
    return urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=10).read()


def counters(port):
    text = get(port, "/metrics").decode()
    found = {}
    for name, value in re.findall(r"^(joulecast_ingest_\S+) (\S+)$", text, re.M):
        found[name] = float(value)
    return found


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--daemon", required=True)
    arguments.add_argument("--client", required=True)
    arguments.add_argument("--generator", required=True)
    arguments.add_argument("--rate", type=int, default=20000)
    arguments.add_argument("--seconds", type=int, default=60)
    arguments.add_argument("--requests", type=int, default=1000, help="a second")
    options = arguments.parse_args()
    rate_hz = 200
    options.robots = max(1, options.rate // rate_hz)
    lcm_port = free_port()
    lcm = f"udpm://239.255.76.67:{lcm_port}?ttl=0&recv_buf_size=4194304"
    with tempfile.TemporaryDirectory() as folder:
        log = f"{folder}/load.lcmlog"
        port = free_port()
        daemon = subprocess.Popen([options.daemon, "--store-path", f"{folder}/h.db", "--http-port", str(port), "--lcm-url", lcm,
                                   "--log-level", "warning"])
        try:
            for _ in range(100):
                try:
                    get(port, "/readyz")
                    break
                except OSError:
                    time.sleep(0.05)
            seed_robots(options, lcm, port)
            # Later than the initial telemetry, so that no clock steps back.
            start = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(time.time() + 1))
            subprocess.run([options.client, "simulate", "--robots", str(options.robots), "--seed", "5", "--rate", str(rate_hz), "--duration",
                            str(options.seconds), "--start", start, "--log", log, "--truth", f"{folder}/truth.json", "--quiet"], check=True)
            before = counters(port)
            cpu, began = cpu_seconds(daemon.pid), time.monotonic()
            sender = subprocess.Popen([options.generator, "send", log, str(lcm_port), str(options.rate)])
            time.sleep(1)
            robot = json.loads(get(port, "/v1/robots"))["robots"][0]["robot_id"]
            mission = json.loads(get(port, "/v1/missions?limit=1"))["missions"][0]["id"]
            subprocess.run([options.generator, "request", str(port), str(options.requests), str(options.seconds - 2), robot, str(mission)],
                           check=True)
            assert sender.wait() == 0
            wall = time.monotonic() - began
            time.sleep(1.5)
            spent = {thread: [now - before for now, before in zip(used, cpu.get(thread, [0, 0]))]
                     for thread, used in cpu_seconds(daemon.pid).items()}
            after = counters(port)
        finally:
            daemon.terminate()
            daemon.wait()
    grown = {name: count - before.get(name, 0) for name, count in after.items()}
    received = grown["joulecast_ingest_messages_total"]
    lost = sum(grown[f'joulecast_ingest_faults_total{{reason="{reason}"}}'] for reason in ("missing", "queue_full"))
    print(f"messages received {received:.0f} in {wall:.1f} s ({received / wall:.0f} a second), "
          f"samples {grown['joulecast_ingest_samples_total']:.0f}, lost or left out {lost:.0f}")
    whole = sum(map(sum, spent.values()))
    print(f"daemon: {100 * whole / wall:.0f} % of one core, {1e6 * whole / received:.2f} us a message")
    for thread, used in sorted(spent.items(), key=lambda each: -sum(each[1])):
        if sum(used) >= 0.002 * whole:
            print(f"  thread {thread}: {1e6 * sum(used) / received:6.2f} us, in the kernel {1e6 * used[1] / received:.2f}")
    return 1 if lost else 0


def seed_robots(options, lcm, port):
    """Registers the robots of the load: the simulator sends its robot files to the daemon."""
    subprocess.run([options.client, "simulate", "--robots", str(options.robots), "--seed", "5", "--duration", "0.1", "--lcm-url", lcm,
                    "--server", f"http://127.0.0.1:{port}", "--quiet"], check=True)


if __name__ == "__main__":
    sys.exit(main())
