#!/usr/bin/env python3
"""spy, check and replay state their address, what other channels carry and the next step; the end of another mission is named at once."""
import json
import struct
import subprocess

from harness import Programs, arguments, check, need_multicast, wait_until


def events_of(log):
    """(time, channel, body) of each event of an LCM log."""
    data, at = open(log, "rb").read(), 0
    while at < len(data):
        _, _, utime, channel, length = struct.unpack_from(">IQQII", data, at)
        at += 28
        yield utime, data[at:at + channel].decode(), data[at + channel:at + channel + length]
        at += channel + length


def write_log(path, events):
    with open(path, "wb") as file:
        for number, (utime, channel, body) in enumerate(events):
            file.write(struct.pack(">IQQII", 0xEDA1DA01, number, utime, len(channel), len(body)) + channel.encode() + body)
    return path


def hears_other_channels(options, programs):
    """A stream without robots: replay publishes it while spy and check listen."""
    log = write_log(programs.path("foreign.lcmlog"), [(k * 100_000, channel, bytes(8)) for k in range(40) for channel in ("ODOM", "CAMERA")])
    address = ["--lcm-url", programs.lcm_url]
    heard = [subprocess.Popen([options.client, *command, *address, "--seconds", "6"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
             for command in (["spy"], ["check", "--robot-id", "amr"])]
    replayed = subprocess.run([options.client, "replay", log, *address], capture_output=True, text=True)
    check(replayed.returncode == 1 and f"publishing on {programs.lcm_url}" in replayed.stderr, f"replay: {replayed}")
    for told in (replayed.stderr, *(" ".join(process.communicate(timeout=60)[0].split()) for process in heard)):
        for words in (programs.lcm_url, "CAMERA, ODOM", "Robots publish ROBOT_TELEMETRY.<robot_id>"):
            check(words in told, f"'{words}' is missing:\n{told}")
    silent = subprocess.run([options.client, "spy", *address, "--seconds", "0.5"], capture_output=True, text=True)
    for words in (f"listening on {programs.lcm_url}", f"no robot has been heard on {programs.lcm_url}; nothing arrived", "--lcm-url or JOULECAST_LCM_URL"):
        check(words in silent.stdout + silent.stderr, f"'{words}' is missing:\n{silent}")


def names_end_of_another_mission(options, programs, robot):
    log, other = programs.path("amr.lcmlog"), programs.path("other.lcmlog")
    programs.run("simulate", "--robots", "1", "--robot", robot, "--seed", "7", "--missions", "1", "--mission-duration", "20", "--speed", "0", "--log", log, "--quiet")
    events = list(events_of(log))
    last = max(k for k, (_, channel, _) in enumerate(events) if channel.startswith("MISSION_EVENT."))
    utime, channel, body = events[last]
    check(b"-m1\0" in body, f"the end of the mission: {body}")
    events[last] = utime, channel, body.replace(b"-m1\0", b"-m9\0")
    write_log(other, events[:last + 1])
    sentence = "amr-s7-m9 ends, and its start was not received: STARTED and FINISHED must name one mission_id"
    replayed = subprocess.run([options.client, "replay", other, "--into", programs.path("into.db"), "--robot", robot], capture_output=True, text=True)
    check(sentence in replayed.stderr, f"replay --into: {replayed}")
    programs.start()
    programs.put("/v1/robots/amr", json.load(open(robot)))
    programs.run("replay", other, "--lcm-url", programs.lcm_url, "--speed", "0")
    wait_until(lambda: sentence in programs.get("/v1/robots/amr/state")["fault_notes"].get("bad_event", ""), 2, "the state names the mission that ends")
    state = programs.run("state", "amr", "--server", programs.url)
    check(f"fault      1 bad_event: mission {sentence}" in state, f"the printed state names the mission that ends:\n{state}")
    check(sentence in open(programs.path("daemon.log")).read(), "the daemon's log names the mission that ends")
    mission, = programs.missions("amr")
    check(mission["mission_id"] == "amr-s7-m1" and mission["state"] == "superseded" and "holds mission amr-s7-m9 too" in mission["note"], f"{mission}")
    check(programs.stop() == 0, "the daemon did not stop in order")


def states_missing_route(options):
    """A network namespace has the loopback interface alone, and no route."""
    if subprocess.run(["unshare", "--net", "true"], capture_output=True).returncode != 0:
        return
    told = subprocess.run(["unshare", "--net", options.client, "spy", "--seconds", "0.5"], capture_output=True, text=True)
    check(told.returncode == 3 and "`ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo`" in told.stderr, f"spy without a route: {told}")


def main():
    options = arguments()
    need_multicast()
    programs = Programs(options)
    hears_other_channels(options, programs)
    states_missing_route(options)
    names_end_of_another_mission(options, programs, f"{options.source}/deploy/robots/amr.json")


main()
