#!/usr/bin/env python3
"""Every practice log over LCM into a daemon: measured battery energies against a quadrature of the log's own samples."""
import json
import struct

from harness import Programs, accounts_twice, arguments, check, close_to, need_multicast, shared_folder


def events(path):
    """(channel, payload) of an lcm-logger file."""
    with open(path, "rb") as file:
        while header := file.read(28):
            _, _, _, channel_length, data_length = struct.unpack(">IqqII", header)
            yield file.read(channel_length).decode(), file.read(data_length)


def text(data, at):
    length = struct.unpack_from(">i", data, at)[0]
    return data[at + 4:at + 3 + length].decode(), at + 4 + length


def energies(path):
    """Battery energy [J] and samples of each mission of a log, by the trapezoid rule on V I."""
    result, mission, last = {}, None, None
    for channel, data in events(path):
        if channel.startswith("MISSION_EVENT."):
            _, at = text(data, 16)
            name, at = text(data, at)
            mission, last = (name, None) if data[at] == 1 else (None, None)
        elif channel.startswith("ROBOT_TELEMETRY.") and mission:
            utime, = struct.unpack_from(">q", data, 8)
            _, at = text(data, 24)
            volts, amperes = struct.unpack_from(">dd", data, at + 6 * 8)
            joules, samples = result.get(mission, (0.0, 0))
            if last:
                joules += (utime - last[0]) * 1e-6 * (volts * amperes + last[1]) / 2
            last = utime, volts * amperes
            result[mission] = joules, samples + 1
    return result


def main():
    options = arguments()
    logs = sorted(shared_folder(options, "practice").glob("*/telemetry.lcmlog"))
    need_multicast()
    programs = Programs(options)
    programs.start()
    check(len(logs) == 8, f"{len(logs)} practice logs")
    print(f"{'log':<22} {'missions':>8} {'samples':>9} {'measured J':>12} {'worst difference':>17} {'lost':>6}")
    for log in logs:
        robot = log.parent / "robot.json"
        model = json.loads(robot.read_text())
        programs.put("/v1/robots/" + model["robot_id"], model)
        programs.run("replay", log, "--lcm-url", programs.lcm_url, "--speed", 0, "--max-rate", 4000)
        expected = energies(log)
        missions = programs.wait_for(model["robot_id"], len(expected))
        check({m["mission_id"] for m in missions} == set(expected), f"{log}: other missions than in the log")
        direct = {m["mission_id"]: m for m in accounts_twice(programs, [log], [robot])}
        worst, lost = 0.0, 0
        for mission in missions:
            name, energy = mission["mission_id"], mission["energy"]
            joules, _ = expected[name]
            check(mission["state"] == "finished" and not mission["incomplete"], f"{log}: {name} is {mission}")
            missing = mission["sample_faults"].get("missing", 0)
            lost += missing
            close_to(energy["measured_j"], joules, 1e-3, f"{log}: {name}")
            check(missing > 0 or direct[name]["energy"] == energy,
                  f"{log}: {name}: over LCM and directly the accounts differ")
            worst = max(worst, abs(energy["measured_j"] / joules - 1))
        # A busy machine may drop datagrams; every one of them must have been noticed.
        heard, sent = sum(m["samples"] for m in missions), sum(samples for _, samples in expected.values())
        check(heard + lost == sent, f"{log}: {heard} of {sent} samples are accounted for, {lost} are known to be lost")
        print(f"{log.parent.name:<22} {len(missions):>8} {heard:>9} "
              f"{sum(m['energy']['measured_j'] for m in missions):>12.1f} {worst:>17.2e} {lost:>6}")
    check(programs.stop() == 0, "the daemon did not stop in order")


main()
