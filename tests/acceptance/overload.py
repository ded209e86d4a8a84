#!/usr/bin/env python3
"""Robots that send three times what the daemon can account, which runs on one core next to a busy loop: no mission event is lost, no
mission is merged with another, each mission's energy is within the error of the samples that were left out, and the log reports it
once a minute. First measures what is accounted. With --seconds N --nice 0 the overload lasts N seconds at the priority of the loop."""
import argparse
import json
import math
import os
import pathlib
import re
import signal
import socket
import struct
import subprocess
import sys
import time
import urllib.request

from harness import GROUP, Programs, check, need_multicast, skip, wait_until

VOLTAGE_V, CURRENT_A, SWING_A, TURN_RAD_S = 24.0, 2.0, 1.0, 0.5  # of the current: a sine
LEAST_COVERED = 0.8  # of the missions' time: other programs may take the core for a moment
LOG_LINE = "accounting is slower than the robots send"


def options_of():
    parser = argparse.ArgumentParser()
    for name in ("daemon", "client", "source", "shared"):
        parser.add_argument("--" + name, required=name != "shared")
    parser.add_argument("--seconds", type=float, default=15)
    parser.add_argument("--mission", type=float, default=6, help="duration of each robot's missions [s]")
    parser.add_argument("--robots", type=int, default=60)
    parser.add_argument("--queue", type=int, default=10_000, help="ingest.queue_messages")
    parser.add_argument("--nice", type=int, default=10, help="of the daemon; the busy loop has 0")
    return parser.parse_args()


class Robot:
    """Its messages, encoded once; times, sequences and currents are written into them."""

    def __init__(self, types, name, index):
        self.name, self.sequence, self.count = name, 0, 0
        self.mission, self.energy_j, self.first_us, self.last, self.step_s = None, 0.0, None, None, 0.0
        self.phase_s = index * 0.37
        sample = types.robot_telemetry_t()
        sample.utime, sample.sequence, sample.robot_id = 0x0102030405060708, 0x1112131415161718, name
        sample.battery_voltage, sample.battery_current = VOLTAGE_V, 123456.789
        sample.wheel_velocity = [654321.987, 5.0]
        nothing = math.nan
        sample.motor_voltage = sample.motor_current = sample.velocity_command = sample.motor_temperature = [nothing, nothing]
        sample.yaw_rate = sample.pitch = sample.payload_mass = nothing
        sample.pose = [nothing] * 3
        self.datagram = bytearray(b"LC02\0\0\0\0ROBOT_TELEMETRY." + name.encode() + b"\0" + sample.encode())
        self.time_at = self.datagram.index(struct.pack(">qq", sample.utime, sample.sequence))
        self.current_at = self.datagram.index(struct.pack(">d", 123456.789))
        self.speed_at = self.datagram.index(struct.pack(">d", 654321.987))
        self.types = types

    def sample(self, utime_us):
        current_a = CURRENT_A + SWING_A * math.sin(TURN_RAD_S * (utime_us * 1e-6 + self.phase_s) % (2 * math.pi))
        self.sequence += 1
        struct.pack_into(">qq", self.datagram, self.time_at, utime_us, self.sequence)
        struct.pack_into(">d", self.datagram, self.current_at, current_a)
        struct.pack_into(">d", self.datagram, self.speed_at, 5.0 + 0.01 * (self.sequence % 7))
        if self.mission and self.last:
            step_s = (utime_us - self.last[0]) * 1e-6
            self.energy_j += step_s * VOLTAGE_V * 0.5 * (current_a + self.last[1])
            self.step_s = max(self.step_s, step_s)
        if self.mission:
            self.first_us = self.first_us or utime_us
            self.last = (utime_us, current_a)
        return self.datagram

    def event(self, utime_us, kind):
        event = self.types.mission_event_t()
        event.utime, event.robot_id, event.event, event.payload_mass, event.note = utime_us, self.name, kind, math.nan, ""
        if kind == event.STARTED:
            self.count += 1
            self.mission, self.energy_j, self.first_us, self.last, self.step_s = f"m{self.count}", 0.0, None, None, 0.0
        event.mission_id = self.mission
        if kind == event.FINISHED:
            self.mission = None
        return b"LC02\0\0\0\0MISSION_EVENT." + self.name.encode() + b"\0" + event.encode()


class Load:
    def __init__(self, programs, types, robots):
        self.robots = robots
        self.types = types
        self.sent, self.missions = 0, {}  # (robot, mission) -> (energy [J], duration [s], longest step [s])
        self.address = (GROUP, programs.lcm_port)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)

    def send(self, datagram):
        self.socket.sendto(datagram, self.address)

    def end_mission(self, robot, utime_us):
        if robot.mission:
            self.missions[robot.name, robot.mission] = (robot.energy_j, 1e-6 * (robot.last[0] - robot.first_us), robot.step_s)
            self.send(robot.event(utime_us, self.types.mission_event_t.FINISHED))

    def run(self, seconds, rate_hz, mission_s):
        """Sends samples of all robots in turn at that rate of messages, as far as this process can; returns the rate."""
        began, sent_before = time.monotonic(), self.sent
        ends = {robot: began + mission_s * k / len(self.robots) for k, robot in enumerate(self.robots)}
        while (now := time.monotonic()) < began + seconds:
            ahead_s = (self.sent - sent_before) / rate_hz - (now - began)
            if ahead_s > 0:
                time.sleep(ahead_s)
            for robot in self.robots:
                utime_us = time.time_ns() // 1000
                if mission_s and now >= ends[robot]:
                    ends[robot] = now + mission_s
                    self.end_mission(robot, utime_us - 1)
                    if now + mission_s < began + seconds:
                        self.send(robot.event(utime_us, self.types.mission_event_t.STARTED))
                self.send(robot.sample(utime_us))
            self.sent += len(self.robots)
        for robot in self.robots:
            self.end_mission(robot, time.time_ns() // 1000)
        return (self.sent - sent_before) / (time.monotonic() - began)


def faults(programs):
    with urllib.request.urlopen(programs.url + "/metrics", timeout=60) as reply:
        text = reply.read().decode()
    return {reason: int(float(count)) for reason, count in
            re.findall(r'^joulecast_(?:ingest_faults|lcm_datagrams_dropped)_total\{reason="(\w+)"\} (\S+)', text, re.M) if float(count) > 0}


def accounted(programs):
    return programs.metric("joulecast_ingest_samples_total")


def main():
    options = options_of()
    need_multicast()
    programs = Programs(options)
    generated = programs.path("generated")
    types = [str(path) for path in pathlib.Path(options.source, "lcmtypes").glob("*.lcm")]
    if subprocess.run(["lcm-gen", "-p", "--ppath", generated, *types], capture_output=True).returncode != 0:
        skip("lcm-gen does not run")
    sys.path.insert(0, generated)
    import joulecast
    programs.settings = ["--ingest-queue-messages", str(options.queue), "--http-request-deadline-s", "60"]
    programs.start()
    model = json.loads(pathlib.Path(options.source, "deploy/robots/amr.json").read_text())
    names = [f"amr-{k}" for k in range(options.robots)]
    for name in names:
        programs.put(f"/v1/robots/{name}", model | {"robot_id": name})
    core = min(os.sched_getaffinity(0))
    for thread in os.listdir(f"/proc/{programs.process.pid}/task"):
        os.sched_setaffinity(int(thread), {core})
        os.setpriority(os.PRIO_PROCESS, int(thread), options.nice)
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"], preexec_fn=lambda: os.sched_setaffinity(0, {core}))
    try:
        overload(options, programs, Load(programs, joulecast, [Robot(joulecast, name, k) for k, name in enumerate(names)]))
    finally:
        busy.send_signal(signal.SIGKILL)
        busy.wait()
    check(programs.stop() == 0, "stop")


def overload(options, programs, load):
    # What it accounts: while the queue is never empty.
    load.run(3, 1e9, 0)
    samples, began = accounted(programs), time.monotonic()
    most_hz = load.run(5, 1e9, 0)
    capacity_hz = (accounted(programs) - samples) / (time.monotonic() - began)
    wait_until(lambda: programs.metric("joulecast_ingest_queue_messages") < options.robots, 120, "the queue is empty")
    before = faults(programs)
    offered_hz = load.run(options.seconds, 3 * capacity_hz, options.mission)
    print(f"accounts {capacity_hz:.0f} samples a second of {most_hz:.0f}; offered {offered_hz:.0f} for {options.seconds:.0f} s, "
          f"{offered_hz / capacity_hz:.1f} times as many", flush=True)
    counted = sum(robot.count for robot in load.robots)
    found = {}

    def all_ended():
        found.clear()
        for robot in load.robots:
            for mission in programs.missions(robot.name):
                if mission["mission_id"] in (f"m{k}" for k in range(1, robot.count + 1)):
                    found[robot.name, mission["mission_id"]] = mission
        return len(found) == counted and all(mission["state"] != "open" for mission in found.values())
    until = time.monotonic() + 60
    while not all_ended() and time.monotonic() < until:
        time.sleep(1)
    wrong = {key: found[key]["state"] if key in found else "absent" for key in load.missions
             if key not in found or found[key]["state"] == "open"}
    counts = {reason: count - before.get(reason, 0) for reason, count in faults(programs).items() if count > before.get(reason, 0)}
    check(not wrong, f"{len(wrong)} of {counted} missions are open or absent: {wrong}; faults {counts}")
    worst, longest_s, covered_s, all_s = 0, 0, 0, 0
    for key, (energy_j, duration_s, step_s) in load.missions.items():
        mission = found[key]
        check(mission["state"] == "finished", f"{key}: {mission}")
        # Between two samples the rule of the trapezoid errs by |P''| step^3 / 12 at most; where nothing is measured, by all of the power.
        times_us = programs.get(f"/v1/missions/{mission['id']}/telemetry?limit=100000")["utime_us"]
        steps_s = [1e-6 * (later - earlier) for earlier, later in zip(times_us, times_us[1:])]
        measured_s = mission["energy"]["measured_s"]
        bound_j = (sum(VOLTAGE_V * SWING_A * TURN_RAD_S**2 * step**3 / 12 for step in steps_s)
                   + (max(0, duration_s - measured_s) + step_s) * VOLTAGE_V * (CURRENT_A + SWING_A))
        error_j = abs(mission["energy"]["measured_j"] - energy_j)
        check(error_j <= bound_j, f"{key}: {error_j:.1f} J from {energy_j:.1f} J, at most {bound_j:.1f} J; {duration_s:.1f} s, measured "
                                  f"{measured_s:.1f} s")
        worst, longest_s = max(worst, error_j / bound_j), max(longest_s, *steps_s)
        covered_s, all_s = covered_s + measured_s, all_s + duration_s
    check(covered_s > LEAST_COVERED * all_s, f"{covered_s:.0f} s of {all_s:.0f} s of missions are measured")
    lines = pathlib.Path(programs.path("daemon.log")).read_text().count(LOG_LINE)
    print(f"{counted} missions of {counted}, none merged; {100 * covered_s / all_s:.1f} % of their time is measured, at steps up to {longest_s:.2f} s; energies "
          f"within {100 * worst:.0f} % of their bound; faults {counts}, {lines} log lines", flush=True)
    check(counts.get("queue_full", 0) > 0, "the daemon accounted everything: no overload")
    check(1 <= lines <= 2 + (options.seconds + 30) // 60, f"{lines} log lines")


main()
