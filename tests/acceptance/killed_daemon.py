#!/usr/bin/env python3
"""A daemon killed while robots drive: at most a second is lost, nothing is corrupt, the mission continues. Then its live
interfaces: the energy state on LCM at 1 Hz, the event stream, an orderly stop."""
import json
import sqlite3
import subprocess
import time
import urllib.request

from harness import Listener, Programs, arguments, check, need_multicast

RATE_HZ = 50
LOST_S = 1.0  # maximum loss of a crash
SLACK_S = 0.3  # one tick of the session and the look-ahead of the meter


def open_missions(programs):
    return {m["mission_id"]: m for m in programs.get("/v1/missions?state=open")["missions"]}


def live_duration(programs, robot):
    return programs.get(f"/v1/robots/{robot}/state")["mission"]["energy"]["duration_s"]


def main():
    options = arguments()
    need_multicast()
    programs = Programs(options)
    programs.start()
    fleet = subprocess.Popen(
        [options.client, "simulate", "--robots", "2", "--lcm-url", programs.lcm_url, "--server", programs.url,
         "--rate", str(RATE_HZ), "--missions", "1", "--mission-duration", "25", "--quiet"])
    try:
        time.sleep(8)
        robots = sorted({m["robot_id"] for m in open_missions(programs).values()})
        check(len(robots) == 2, f"two robots drive, heard: {robots}")
        started = {m["robot_id"]: m["start_utime_us"] for m in open_missions(programs).values()}
        killed_utime_us = time.time() * 1e6
        programs.kill()
        with sqlite3.connect(f"file:{programs.store}?mode=ro", uri=True) as store:
            check(store.execute("PRAGMA integrity_check").fetchone()[0] == "ok", "the history is damaged")
            rows = store.execute("SELECT robot_id, end_utime_us FROM mission WHERE state = 'open'").fetchall()
        for robot, last_utime_us in rows:
            lost_s = (killed_utime_us - last_utime_us) * 1e-6
            print(f"{robot}: {lost_s:.2f} s of {(killed_utime_us - started[robot]) * 1e-6:.1f} s lost by SIGKILL")
            check(lost_s <= LOST_S + SLACK_S, f"{robot} lost {lost_s} s")
        check(len(rows) == 2, f"both missions are stored: {rows}")

        began = time.monotonic()
        programs.start()
        print(f"restarted within {time.monotonic() - began:.2f} s")
        check(len(open_missions(programs)) == 2, "the missions continue after the restart")

        # Energy state on LCM: one per second and robot.
        states = {}
        for at, channel, _ in Listener(programs.lcm_port).messages(6):
            if channel.startswith("ENERGY_STATE."):
                states.setdefault(channel.split(".", 1)[1], []).append(at)
        check(sorted(states) == robots, f"energy states received of {sorted(states)}")
        for robot, times in states.items():
            check(5 <= len(times) <= 7, f"{len(times)} energy states of {robot} in 6 s")

        # Live events of both robots, and the end of each mission.
        heard, ended, kind = set(), [], ""
        with urllib.request.urlopen(programs.url + "/v1/events", timeout=10) as stream:
            check(stream.headers.get_content_type() == "text/event-stream", "events are no event stream")
            until = time.monotonic() + 60
            while time.monotonic() < until and len(ended) < 2:
                name, _, value = stream.readline().decode().strip().partition(": ")
                heard |= {robot for robot in robots if f'"{robot}"' in value}
                if name == "data" and kind == "mission":
                    ended.append(json.loads(value))
                kind = value if name == "event" else kind
        check(len(heard) == 2, f"live events of {heard}")
        check(sorted(m["robot_id"] for m in ended) == robots, f"events of ended missions: {ended}")
        for event in ended:
            stored = programs.get(f"/v1/missions/{event['id']}")
            check(event["state"] == "finished" and event["samples"] == stored["samples"], f"{event} is stored as {stored}")

        for robot in robots:
            mission, = programs.wait_for(robot, 1, 60)
            energy = mission["energy"]
            print(f"{robot}: {mission['state']}, {energy['duration_s']:.1f} s, {mission['gap_count']} gaps of "
                  f"{mission['gap_s']:.2f} s, {mission['samples']} samples, {energy['battery_j']:.0f} J")
            check(mission["state"] == "finished", f"{robot}: the mission ended {mission['state']}")
            span_s = (mission["end_utime_us"] - mission["start_utime_us"]) * 1e-6
            # Missing telemetry is a gap or is bridged; nothing is counted twice.
            check(energy["duration_s"] <= span_s + 1e-3, f"{robot}: {energy['duration_s']} s of {span_s} s metered")
            check(energy["duration_s"] + mission["gap_s"] >= span_s - LOST_S - SLACK_S,
                  f"{robot}: {energy['duration_s']} s and gaps of {mission['gap_s']} s do not add up to {span_s} s")
    finally:
        fleet.terminate()
        fleet.wait()
    before = {robot: programs.get(f"/v1/robots/{robot}/state") for robot in robots}
    check(programs.stop() == 0, "the daemon did not stop in order")
    programs.start()
    for robot, state in before.items():
        silent = programs.get(f"/v1/robots/{robot}/state")
        for name in ("state_of_charge", "state_of_charge_sd"):
            check(abs(silent[name] - state[name]) < 1e-3, f"{robot}: {name} {state[name]}, after a restart {silent[name]}")
    began = time.monotonic()
    check(programs.stop() == 0, "the daemon did not stop in order")
    print(f"stopped within {time.monotonic() - began:.2f} s")
    with sqlite3.connect(f"file:{programs.store}?mode=ro", uri=True) as store:
        check(store.execute("PRAGMA integrity_check").fetchone()[0] == "ok", "the history is damaged after the stop")


main()
