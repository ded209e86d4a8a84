#!/usr/bin/env python3
"""Daemons of one cluster on one PostgreSQL under the telemetry of many robots, for scale.md.

  scale.py --daemon joulecastd --client joulecast --source . [--robots 2000] [--rate 10] [--seconds 30] [--daemons 1 2 4]

Each run has a separate PostgreSQL, the given number of daemons, and a log of the robots' telemetry that is replayed in real time
to every daemon. Prints samples received and stored, the processor time of the daemons and of PostgreSQL, and commit delays.
Needs multicast on loopback; bounded by --seconds."""
import argparse
import os
import pathlib
import re
import socket
import subprocess
import tempfile
import time
import urllib.request

CLOCK_HZ = os.sysconf("SC_CLK_TCK")


def options():
    parser = argparse.ArgumentParser()
    for name in ("daemon", "client", "source"):
        parser.add_argument("--" + name, required=True)
    parser.add_argument("--robots", type=int, default=2000)
    parser.add_argument("--rate", type=int, default=10)
    parser.add_argument("--seconds", type=int, default=30)
    parser.add_argument("--daemons", type=int, nargs="+", default=[1, 2, 4])
    return parser.parse_args()


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def stat(pid):
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return int(fields[1]), (int(fields[11]) + int(fields[12])) / CLOCK_HZ


def cpu_of_server(folder):
    """Processor time of PostgreSQL's present processes [s]."""
    postmaster = int(pathlib.Path(folder, "data", "postmaster.pid").read_text().split()[0])
    total = 0
    for entry in os.listdir("/proc"):
        if entry.isdigit():
            try:
                parent, cpu_s = stat(entry)
            except OSError:
                continue
            if parent == postmaster:
                total += cpu_s
    return total


def metrics(port):
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=30) as reply:
        text = reply.read().decode()
    return {name: float(value) for name, value in re.findall(r"^(joulecast_\S+) (\S+)$", text, re.M)}


def rows(folder, sql):
    done = subprocess.run(["psql", "-h", folder, "-U", "joulecast", "-d", "postgres", "-XAtc", sql], check=True, capture_output=True,
                          text=True)
    return done.stdout.strip()


def wait_until(condition, seconds, what):
    until = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > until:
            raise SystemExit(f"not within {seconds} s: {what}")
        time.sleep(0.2)


def is_ready(port):
    try:
        urllib.request.urlopen(f"http://127.0.0.1:{port}/readyz", timeout=5)
        return True
    except OSError:
        return False


class Run:
    def __init__(self, arguments, count, log):
        self.arguments, self.count, self.log = arguments, count, log

    def tell(self, what):
        script = pathlib.Path(self.arguments.source, "tests", "support", "postgresql.sh")
        subprocess.run([str(script), what, self.folder], check=True)

    def start(self, work):
        url = f"postgresql://joulecast@/postgres?host={self.folder}"
        lcm = f"udpm://239.255.76.67:{free_port()}?ttl=0&recv_buf_size=8388608"
        self.ports = [free_port() for _ in range(self.count)]
        self.daemons = []
        for k, port in enumerate(self.ports):
            self.daemons.append(subprocess.Popen(
                [self.arguments.daemon, "--store-url", url, "--store-path", f"{work}/{k}.db", "--cluster-name", "scale", "--cluster-node",
                 f"node-{k}", "--http-port", str(port), "--lcm-url", lcm, "--log-level", "error"]))
            wait_until(lambda: is_ready(port), 60, f"daemon {k} answers")
        subprocess.run([self.arguments.client, "simulate", "--robots", str(self.arguments.robots), "--seed", "5", "--duration", "0.1",
                        "--lcm-url", lcm, "--server", f"http://127.0.0.1:{self.ports[0]}", "--quiet"], check=True)
        kept = "SELECT count(*) FROM cluster_lease JOIN cluster_node USING (node)"
        wait_until(lambda: int(rows(self.folder, kept)) == self.arguments.robots, 60, "every robot has a daemon")
        time.sleep(5)
        return lcm

    def measure(self, lcm):
        before = [metrics(port) for port in self.ports]
        cpu = [stat(daemon.pid)[1] for daemon in self.daemons]
        server, began = cpu_of_server(self.folder), time.monotonic()
        stored = int(rows(self.folder, "SELECT coalesce(sum(samples), 0) FROM mission"))
        player = subprocess.Popen([self.arguments.client, "replay", self.log, "--lcm-url", lcm, "--speed", "0", "--max-rate",
                                   str(self.arguments.robots * self.arguments.rate)], stdout=subprocess.DEVNULL)
        latest = 0
        while player.poll() is None:
            time.sleep(1)
            latest = max(latest, *(metrics(port)["joulecast_store_oldest_wait_seconds"] for port in self.ports))
        played_s = time.monotonic() - began
        taken, settled_s = self.settled(stored)
        after = [metrics(port) for port in self.ports]
        spent = [stat(daemon.pid)[1] - c for daemon, c in zip(self.daemons, cpu)]
        server = cpu_of_server(self.folder) - server
        received = sum(a["joulecast_ingest_messages_total"] - b["joulecast_ingest_messages_total"] for a, b in zip(after, before))
        faults = sorted({name for a in after for name in a if name.startswith("joulecast_ingest_faults_total")})
        grown = {re.search('"(.*)"', name)[1]: sum(a.get(name, 0) - b.get(name, 0) for a, b in zip(after, before)) for name in faults}
        faults = ", ".join(f"{reason} {count:.0f}" for reason, count in grown.items() if count) or "none"
        print(f"{self.count} daemon(s): {taken} samples stored in {played_s + settled_s:.0f} s, played in {played_s:.0f} s; received in all "
              f"{received:.0f}, faults: {faults}; processor time per stored sample: "
              f"daemons {1e6 * sum(spent) / taken:.1f} us ({', '.join(f'{s:.1f} s' for s in spent)}), PostgreSQL "
              f"{1e6 * server / taken:.1f} us; oldest commit waited {latest:.2f} s", flush=True)

    def settled(self, stored):
        """Samples stored once their number is constant, and the time until then [s]."""
        began, last, since = time.monotonic(), -1, time.monotonic()
        while time.monotonic() - since < 8 and time.monotonic() - began < 90:
            now = int(rows(self.folder, "SELECT coalesce(sum(samples), 0) FROM mission"))
            if now != last:
                last, since = now, time.monotonic()
            time.sleep(0.5)
        return last - stored, since - began

    def run(self):
        with tempfile.TemporaryDirectory() as self.folder, tempfile.TemporaryDirectory() as work:
            self.tell("start")
            try:
                self.measure(self.start(work))
            finally:
                for daemon in self.daemons:
                    daemon.terminate()
                for daemon in self.daemons:
                    daemon.wait()
                self.tell("stop")


def main():
    arguments = options()
    with tempfile.TemporaryDirectory() as folder:
        log = f"{folder}/fleet.lcmlog"
        subprocess.run([arguments.client, "simulate", "--robots", str(arguments.robots), "--seed", "5", "--rate", str(arguments.rate),
                        "--duration", str(arguments.seconds), "--log", log, "--truth", f"{folder}/truth.json", "--quiet"], check=True)
        for count in arguments.daemons:
            Run(arguments, count, log).run()


if __name__ == "__main__":
    main()
