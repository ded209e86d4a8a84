#!/usr/bin/env python3
"""Forty-two live robots, 25 of them with a planted fault: each of these is on the attention list with its reason within a
minute of the data that prove it, and no other robot is. Faults of telemetry, silence and charge count from the first
sample with the fault; drift, outlier, cause and proposal from the end of the robot's last mission before the listing,
or the start of the daemon. Prints the table of faults, reasons and times."""
import json
import math
import os
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time

from harness import GROUP, Listener, Programs, arguments, check, free_port, need_multicast

RATE_HZ = 10
MISSION_S = 30
LIMIT_S = 60
HEALTHY = 17
AMR_GEAR, AMR_WHEEL_M = 21, 0.08


def scaled(field, factor):
    def alter(m):
        value = getattr(m, field)
        setattr(m, field, [factor * v for v in value] if isinstance(value, (list, tuple)) else factor * value)
    return alter


def held(field, value):
    return lambda m: setattr(m, field, value)


def swapped(m):
    m.wheel_velocity = list(reversed(m.wheel_velocity))


def heading_in_degrees(m):
    m.pose = [*m.pose[:2], math.degrees(m.pose[2])]


def an_hour_ahead(m):
    m.utime += 3_600_000_000


def in_milliseconds(m):
    m.utime //= 1000


# Mistakes of publishers, and words that the reason contains.
TELEMETRY = {
    "current-reversed": (scaled("battery_current", -1), "revers"),
    "current-in-ma": (scaled("battery_current", 1000), "mA"),
    "voltage-in-mv": (scaled("battery_voltage", 1000), "battery_voltage"),
    "wheels-in-rpm": (scaled("wheel_velocity", 60 / math.tau), "wheel"),
    "wheels-of-motors": (scaled("wheel_velocity", AMR_GEAR), "wheel"),
    "wheels-in-m-s": (scaled("wheel_velocity", AMR_WHEEL_M), "wheel"),
    "sides-exchanged": (swapped, "left"),
    "gyro-in-degrees": (scaled("yaw_rate", 180 / math.pi), "yaw_rate"),
    "heading-in-degrees": (heading_in_degrees, "pose"),
    "current-dead": (held("battery_current", 0.0), "battery_current"),
    "current-held": (held("battery_current", 3.0), "battery_current"),
    "motors-dead": (held("motor_voltage", [0.0, 0.0]), "motor_voltage"),
    "clock-ahead": (an_hour_ahead, "clock"),
    "stamps-in-ms": (in_milliseconds, "stamped"),
    "sequence-held": (held("sequence", 1), "sequence"),
    "other-id": (held("robot_id", "impostor"), "impostor"),
}
# Other faults by robot: the kind of the reason.
OTHERS = {"two-senders": "contradicted", "no-file": "no_robot_file", "slow-file": "contradicted", "lost": "silent",
          "empty": "charge_low", "worn": "drift", "heavy-draw": "stands_out", "diagnosed": "gap_diagnosed",
          "ill-fitted": "proposal"}
CAUSES = {"diagnosed": "coulomb friction", "ill-fitted": "friction torque"}


class Relay(threading.Thread):
    """Passes the messages of one multicast port on to another, with the telemetry of some robots altered."""

    def __init__(self, telemetry_type, to_port):
        super().__init__(daemon=True)
        self.type, self.port, self.to = telemetry_type, free_port(), (GROUP, to_port)
        self.out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        self.first = {}  # time of the first altered message of each robot
        self.listener = Listener(self.port)

    def run(self):
        count = 0
        while True:
            for _, channel, payload in self.listener.messages(60):
                kind, _, robot = channel.partition(".")
                if kind == "ROBOT_TELEMETRY":
                    message = self.type.decode(payload)
                    TELEMETRY[robot][0](message)
                    payload = message.encode()
                    self.first.setdefault(robot, time.monotonic())
                count += 1
                self.out.sendto(b"LC02" + struct.pack(">I", count) + channel.encode() + b"\0" + payload, self.to)


class Fleet:
    def __init__(self, programs):
        self.programs, self.running, self.began = programs, {}, {}
        with open(programs.options.source + "/deploy/robots/amr.json", encoding="utf-8") as file:
            self.kind = json.load(file)

    def model(self, robot_id, **change):
        return {**self.kind, "robot_id": robot_id, **change}

    def file(self, robot_id):
        path = self.programs.path(robot_id + ".json")
        with open(path, "w", encoding="utf-8") as file:
            json.dump(self.model(robot_id), file)
        return path

    def drive(self, robot_id, seed, *options, lcm_url=None):
        self.began.setdefault(robot_id, time.monotonic())
        process = subprocess.Popen(
            [self.programs.options.client, "simulate", "--robots", "1", "--robot", self.file(robot_id), "--seed", str(seed), "--rate",
             str(RATE_HZ), "--mission-duration", str(MISSION_S), "--lcm-url", lcm_url or self.programs.lcm_url, "--quiet", *options])
        self.running.setdefault(robot_id, []).append(process)
        return process

    def record(self, robot_id, *parts):
        """Missions of the past, in the daemon's history."""
        logs = []
        for k, (seed, missions, options) in enumerate(parts):
            logs.append(self.programs.path(f"{robot_id}-{k}.lcmlog"))
            self.programs.run("simulate", "--robots", 1, "--robot", self.file(robot_id), "--seed", seed, "--missions", missions,
                              "--mission-duration", MISSION_S, "--rate", RATE_HZ, "--speed", 0, "--log", logs[-1], "--quiet",
                              "--start", f"2023-11-{14 + k}T08:00:00Z", *options)
        self.programs.run("replay", *logs, "--into", self.programs.store, "--robot", self.file(robot_id))

    def end(self):
        for process in (p for each in self.running.values() for p in each):
            process.kill()
            process.wait()


def telemetry_type(source):
    folder = tempfile.mkdtemp(prefix="joulecast-planted-")
    subprocess.run(["lcm-gen", "-p", "--ppath", folder, source + "/lcmtypes/robot_telemetry_t.lcm"], check=True)
    sys.path.insert(0, folder)
    from joulecast import robot_telemetry_t
    return robot_telemetry_t


WORN = ["--effect", "coulomb_friction=0.6"]
DRAW = ["--effect", "accessory_load=9"]
EFFECTS = {"worn": WORN, "diagnosed": WORN, "heavy-draw": DRAW, "ill-fitted": WORN}


def main():
    programs = Programs(arguments())
    need_multicast()
    fleet = Fleet(programs)
    healthy = [f"healthy-{k + 1:02}" for k in range(HEALTHY)]
    fleet.record("worn", (1, 9, []), (2, 1, WORN))
    fleet.record("diagnosed", (3, 9, []), (4, 1, WORN))
    fleet.record("ill-fitted", (6, 6, WORN))
    programs.start()
    started = time.monotonic()
    relay = Relay(telemetry_type(programs.options.source), programs.lcm_port)
    relay.start()
    faulty = {**{robot: "contradicted" for robot in TELEMETRY}, **OTHERS}
    check(len(faulty) + len(healthy) == 42 and len(faulty) == 25, f"{len(faulty)} faults")
    changes = {"slow-file": {"limits": {**fleet.kind["limits"], "speed_m_s": 0.05}},
               "empty": {"battery": {**fleet.kind["battery"], "reserve_fraction": 0.95}}}
    for robot in [*faulty, *healthy]:
        if robot != "no-file":
            programs.put(f"/v1/robots/{robot}", fleet.model(robot, **changes.get(robot, {})))

    listed, last_end = {}, {}

    def look():
        """Notes the time at which each reason is first listed, and the end of the robot's last mission before."""
        now = time.monotonic()
        for entry in programs.get("/v1/attention")["attention"]:
            for reason in entry["reasons"]:
                key = entry["robot_id"], reason["kind"]
                if key in listed:
                    continue
                ended = [m["end_utime_us"] for m in programs.missions(entry["robot_id"]) if m["state"] == "finished"]
                listed[key] = now, reason["message"], time.time() - max(ended, default=0) * 1e-6

    try:
        relayed = f"udpm://{GROUP}:{relay.port}?ttl=0"
        for k, robot in enumerate([*faulty, *healthy]):
            fleet.drive(robot, 200 + k, *EFFECTS.get(robot, []), lcm_url=relayed if robot in TELEMETRY else None)
            if robot == "two-senders":
                fleet.drive(robot, 900)
        until = time.monotonic() + 600
        lost_at = None
        while time.monotonic() < until and not all((robot, kind) in listed for robot, kind in faulty.items()):
            look()
            if lost_at is None and programs.get("/v1/robots/lost/state")["mission"] and time.monotonic() - fleet.began["lost"] > 20:
                os.kill(fleet.running["lost"][0].pid, signal.SIGKILL)
                lost_at = time.monotonic()
            time.sleep(0.5)

        late = []
        print(f"{'fault':<20} {'kind':<14} {'s':>6}  reason")
        for robot, kind in faulty.items():
            at, message, since_end_s = listed.get((robot, kind), (math.inf, "NOT LISTED", math.inf))
            if kind in ("drift", "stands_out", "gap_diagnosed", "proposal"):
                seconds = min(since_end_s, at - started)
            else:
                seconds = at - (lost_at if robot == "lost" else relay.first.get(robot, fleet.began[robot]))
            words = TELEMETRY[robot][1] if robot in TELEMETRY else CAUSES.get(robot, "")
            if seconds > LIMIT_S or words not in message:
                late.append(robot)
            print(f"{robot:<20} {kind:<14} {seconds:6.1f}  {message}")
        others = sorted({str(robot) for robot, _ in listed} - set(faulty))
        for robot in others:
            print(f"{robot:<20} is listed without a fault: {[key[1] + ': ' + value[1] for key, value in listed.items() if key[0] == robot]}")
        check(not late, f"late, absent or without the cause: {late}")
        check(not others, f"listed without a fault: {others}")
    finally:
        fleet.end()
    check(programs.stop() == 0, "the daemon ends")


main()
