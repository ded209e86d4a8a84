#!/usr/bin/env python3
"""Sends forged LCM datagrams of every systematic kind at a running joulecastd, along with an honest robot, in a network
namespace of its own. The daemon lives, counts each of them by its reason, and the robot's mission is complete.

  forged_datagrams.py --daemon joulecastd --source .
"""
import argparse
import importlib
import itertools
import json
import math
import os
import random
import re
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request

SKIP = 77
GROUP, PORT = "239.255.76.67", 7667
CHANNEL = b"ROBOT_TELEMETRY.amr-07"


def skip(why):
    print("skipped:", why)
    sys.exit(SKIP)


def check(truth, text):
    if not truth:
        print("FAILED:", text)
        sys.exit(1)


def enter_namespace():
    """Runs this script again in an isolated network namespace."""
    if os.environ.get("FORGED_DATAGRAMS_NAMESPACE"):
        for command in ("ip link set lo up", "ip link set lo multicast on", "ip route add 224.0.0.0/4 dev lo"):
            if subprocess.run(command.split(), capture_output=True).returncode != 0:
                skip(command)
        return
    unshare = ["unshare", "-n"] if os.geteuid() == 0 else ["unshare", "-rn"]
    if shutil.which("unshare") is None or subprocess.run(unshare + ["true"], capture_output=True).returncode != 0:
        skip("no network namespaces here")
    os.environ["FORGED_DATAGRAMS_NAMESPACE"] = "1"
    os.execvp(unshare[0], unshare + [sys.executable, "-B"] + sys.argv)


class Sender:
    def __init__(self, address):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        self.socket.bind((address, 0))
        self.sent = 0

    def send(self, datagram, to=GROUP):
        self.socket.sendto(datagram, (to, PORT))
        self.sent += 1
        if self.sent % 50 == 0:
            time.sleep(0.002)  # the flood must not be lost in the receive buffer: each datagram is counted

    def publish(self, channel, data):
        self.send(b"LC02" + struct.pack(">I", self.sent) + channel + b"\0" + data)


def fragment(sequence, size, offset, number, count, payload, channel=CHANNEL):
    return (b"LC03" + struct.pack(">IIIHH", sequence & 0xffffffff, size, offset, number, count)
            + (channel + b"\0" if number == 0 else b"") + payload)


def forged():
    """Every datagram that a liar may think of."""
    payload = b"z" * 600
    yield from (b"", b"LC02", b"LC03", b"LC02\0\0\0\1", b"LC03" + b"\0" * 15, b"LC02\0\0\0\1" + b"x" * 100, b"LC04" + b"\0" * 100)
    extremes = (0, 1, 599, 600, 601, 1000, 65535, 65536, 65537, 2**31 - 1, 2**31, 2**32 - 600, 2**32 - 599, 2**32 - 1)
    sequence = 0
    for size, offset in itertools.product(extremes, extremes):
        for number, count in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (255, 256), (256, 257), (65534, 65535), (65535, 0)):
            sequence += 1
            yield fragment(sequence, size, offset, number, count, payload)
    for offset, number, count in itertools.product(extremes, (0, 1, 2, 65535), (0, 1, 2, 3, 65535)):
        sequence += 1
        yield fragment(sequence, 1200, 0, 0, 2, payload)  # a good beginning
        yield fragment(sequence, 1200, offset, number, count, payload)
        yield fragment(sequence, 60000, offset, number, count, payload)
    for channel in (b"", b"x" * 64, b"ROBOT_TELEMETRY.", b"POSE", b"ROBOT_TELEMETRY.\xff", b"ENERGY_STATE.amr-07"):
        yield fragment(sequence, 600, 0, 0, 1, payload, channel)
        yield b"LC02\0\0\0\1" + channel + b"\0" + payload
    yield from (fragment(sequence + k, 65536, 0, 0, 256, payload) for k in range(500))  # never completed
    rng = random.Random(5)
    for _ in range(3000):
        yield rng.choice((b"", b"LC02", b"LC03", b"LC03" + struct.pack(">I", sequence))) + rng.randbytes(rng.randrange(200))


class Robot:
    """Publishes a mission at 50 Hz from a thread of its own."""

    def __init__(self, types, address="127.0.0.1"):
        self.types = types
        self.sender = Sender(address)
        self.samples = 0
        self.stopping = threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def event(self, kind):
        message = self.types["mission_event_t"]()
        message.utime, message.robot_id, message.mission_id = time.time_ns() // 1000, "amr-07", "honest"
        message.event, message.payload_mass, message.note = kind, 0.0, ""
        self.sender.publish(b"MISSION_EVENT.amr-07", message.encode())

    def run(self):
        self.event(1)
        while not self.stopping.is_set():
            self.sender.publish(CHANNEL, telemetry(self.types, self.samples))
            self.samples += 1
            time.sleep(0.02)
        self.event(2)

    def stop(self):
        self.stopping.set()
        self.thread.join()


def telemetry(types, sequence, current_a=2.0):
    message = types["robot_telemetry_t"]()
    message.utime, message.sequence, message.robot_id = time.time_ns() // 1000, sequence, "amr-07"
    message.wheel_velocity = [5.0, 5.0]
    for name in ("motor_voltage", "motor_current", "motor_temperature"):
        setattr(message, name, [math.nan] * 2)
    message.battery_voltage, message.battery_current = 26.0, current_a
    message.velocity_command, message.yaw_rate, message.pitch = [0.4, 0.0], 0.0, math.nan
    message.pose, message.payload_mass = [math.nan] * 3, 0.0
    return message.encode()


class Daemon:
    def __init__(self, options, folder):
        self.log = open(os.path.join(folder, "daemon.log"), "a+")
        self.process = subprocess.Popen([options.daemon, "--http-port", "0", "--store-path", os.path.join(folder, "history.db"),
                                         "--log-format", "json", "--lcm-accept-from", "127.0.0.0/24, 0.0.0.0", "--lcm-url",
                                         f"udpm://{GROUP}:{PORT}?ttl=0&recv_buf_size=4194304"], stderr=self.log)
        until = time.monotonic() + 30
        self.url = None
        while self.url is None and time.monotonic() < until and self.process.poll() is None:
            time.sleep(0.05)
            for line in self.lines():
                self.url = line["http"] if line.get("message") == "ready" else self.url
        self.log.seek(0)
        check(self.url, "the daemon did not become ready:\n" + self.log.read())

    def lines(self):
        self.log.seek(0)
        return [json.loads(line) for line in self.log if line.startswith("{") and line.endswith("\n")]

    def get(self, path):
        with urllib.request.urlopen(self.url + path, timeout=10) as reply:
            return reply.read().decode()

    def counts(self, name):
        return {reason: int(float(value)) for reason, value in
                re.findall(r"^" + name + r'\{reason="(\w+)"\} (\S+)$', self.get("/metrics"), re.M)}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--daemon", required=True)
    parser.add_argument("--source", required=True)
    options = parser.parse_args()
    enter_namespace()
    if shutil.which("lcm-gen") is None:
        skip("no lcm-gen")
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["lcm-gen", "-p", "--ppath", folder] +
                       [os.path.join(options.source, "lcmtypes", f"{name}.lcm") for name in ("robot_telemetry_t", "mission_event_t")],
                       check=True, stdout=subprocess.DEVNULL)
        sys.path.insert(0, folder)
        types = {name: getattr(importlib.import_module("joulecast." + name), name) for name in ("robot_telemetry_t", "mission_event_t")}
        daemon = Daemon(options, folder)
        try:
            attack(daemon, types, options)
        finally:
            daemon.process.kill()
            daemon.process.wait()


def attack(daemon, types, options):
    with open(os.path.join(options.source, "deploy/robots/amr.json")) as file:
        model = json.load(file) | {"robot_id": "amr-07"}
    urllib.request.urlopen(urllib.request.Request(daemon.url + "/v1/robots/amr-07", method="PUT", data=json.dumps(model).encode(),
                                                  headers={"Content-Type": "application/json"}), timeout=10)
    robot = Robot(types)
    time.sleep(1)
    liar, stranger, twin = Sender("127.0.0.2"), Sender("127.1.0.1"), Sender("127.0.0.3")
    for datagram in forged():
        liar.send(datagram)
        if daemon.process.poll() is not None:
            check(False, f"the daemon ended with {daemon.process.returncode} after {liar.sent} datagrams, the last {datagram[:40]!r}")
    for datagram in itertools.islice(forged(), 500):
        stranger.send(datagram)
    unicast = Sender("127.0.0.1")
    for datagram in itertools.islice(forged(), 100):
        unicast.send(datagram, to="127.0.0.1")
    for k in range(100):  # a second robot of the same id
        twin.publish(CHANNEL, telemetry(types, 70_000 + k, current_a=100.0))
        time.sleep(0.01)
    state = json.loads(daemon.get("/v1/robots/amr-07/state"))
    robot.stop()
    time.sleep(1.5)

    check(daemon.process.poll() is None, "the daemon ended")
    dropped, faults = daemon.counts("joulecast_lcm_datagrams_dropped_total"), daemon.counts("joulecast_ingest_faults_total")
    received = int(float(re.search(r"^joulecast_lcm_datagrams_total (\S+)$", daemon.get("/metrics"), re.M)[1]))
    print("sent", liar.sent + stranger.sent + twin.sent + robot.sender.sent, "received", received, dropped)
    own = len([line for line in daemon.lines() if line.get("message") == "ready"])
    check(own == 1, "the daemon was started again")
    check(dropped["kernel"] == 0, f"the kernel dropped {dropped['kernel']}")
    sent = liar.sent + stranger.sent + twin.sent + robot.sender.sent
    check(0 <= received - sent <= 60, f"{received} datagrams received of {sent} and the daemon's own ENERGY_STATE")
    check(dropped["foreign_sender"] == stranger.sent, "datagrams of senders that are not accepted")
    for reason in ("malformed", "other_channel", "too_large", "bad_fragment", "incomplete"):
        check(dropped[reason] > 0, f"none dropped as {reason}")
    check(faults["second_sender"] >= 90, f"only {faults['second_sender']} of the second sender refused")
    check("127.0.0.3" in state["fault_notes"]["second_sender"], state["fault_notes"])
    missions = json.loads(daemon.get("/v1/missions"))["missions"]
    check(len(missions) == 1, f"{len(missions)} missions")
    mission = missions[0]
    check(mission["mission_id"] == "honest" and mission["state"] == "finished" and not mission["incomplete"], mission)
    check(mission["samples"] == robot.samples, f"{mission['samples']} of {robot.samples} samples")
    power_w = mission["energy"]["measured_j"] / mission["energy"]["measured_s"]
    check(abs(power_w - 52.0) < 0.01, f"measured power {power_w} W")
    daemon.process.terminate()
    check(daemon.process.wait(timeout=30) == 0, "the daemon did not stop cleanly")


if __name__ == "__main__":
    main()
