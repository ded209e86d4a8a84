#!/usr/bin/env python3
"""The drivetrain recordings of FRC team 3314: imported, replayed over LCM into a daemon, compared, calibrated.

The energies come from the CSV files by a quadrature that shares no code with joulecast. The calibration's errors on
held-out runs are printed without a limit: they are a finding about the robot and its instruments."""
import csv
import json
import math
import struct

from harness import Programs, accounts_twice, arguments, check, close_to, need_multicast, shared_folder

PREFIX = "network_table:///SmartDashboard/"
SPEED = " NEO Encoder Speed Inches"
MOTORS = (" Master Current", " Slave 1 Current", " Slave 2 Current")


def energies(path):
    """Motor energy of a recording [J], right and left: V and I linear between rows, and the trapezoid rule on V I.

    The recorded currents are unsigned: driven motors push in the voltage's direction, shorted ones (0 V) brake. The right
    side is recorded backwards."""
    with open(path, newline="") as file:
        rows = csv.reader(file)
        header = next(rows)
        names = [side + what for side in ("Right", "Left") for what in (" Voltage", SPEED, *MOTORS)]
        columns = {name: header.index(PREFIX + name) for name in names}
        held, points = {}, []
        for row in rows:
            for name, column in columns.items():
                if row[column] and (name.endswith((" Voltage", SPEED)) or 0 <= float(row[column]) <= 200):
                    held[name] = float(row[column])
            sides = []
            for side, facing in (("Right", -1), ("Left", 1)):
                volts, speed = facing * held[side + " Voltage"], facing * held[side + SPEED]
                amperes = sum(held[side + m] for m in MOTORS)
                sides.append((volts, math.copysign(amperes, volts or -speed or 1)))
            points.append((float(row[0]) / 1e3, sides))
    linear, trapezoid = [0.0, 0.0], [0.0, 0.0]
    for (t0, before), (t1, after) in zip(points, points[1:]):
        for side in range(2):
            (v0, i0), (v1, i1) = before[side], after[side]
            linear[side] += (t1 - t0) * (2 * v0 * i0 + 2 * v1 * i1 + v0 * i1 + v1 * i0) / 6
            trapezoid[side] += (t1 - t0) * (v0 * i0 + v1 * i1) / 2
    return linear, trapezoid


def samples_in(path):
    """Messages of telemetry in an lcm-logger file."""
    samples = 0
    with open(path, "rb") as file:
        while header := file.read(28):
            channel_length, data_length = struct.unpack_from(">II", header, 20)
            samples += file.read(channel_length).startswith(b"ROBOT_TELEMETRY.")
            file.seek(data_length, 1)
    return samples


def main():
    options = arguments()
    recordings = shared_folder(options, "real", "frc3314_drivetrain")
    need_multicast()
    programs = Programs(options)
    programs.start()
    gears = ("high", "low")
    for gear in gears:
        tables = sorted(recordings.glob(f"*_{gear}.csv"))
        check(len(tables) == 4, f"{len(tables)} recordings in {gear} gear")
        programs.run("import", *tables, "--mapping", f"{options.source}/deploy/import/frc3314_{gear}.json",
                     "--start", "2019-02-16T10:00:00Z", "--out", programs.path(gear + ".lcmlog"))
        with open(f"{options.source}/deploy/robots/frc3314-{gear}.json") as file:
            programs.put(f"/v1/robots/frc3314-{gear}", json.load(file))
        programs.run("replay", programs.path(gear + ".lcmlog"), "--lcm-url", programs.lcm_url, "--speed", 50)

    print(f"{'mission':<28} {'measured J':>11} {'quadrature J':>13} {'difference':>11} {'trapezoid':>10}")
    stored = {}
    for gear in gears:
        missions = programs.wait_for(f"frc3314-{gear}", 4)
        check(len(missions) == 4, f"{len(missions)} missions of the {gear} gear are stored")
        again = accounts_twice(programs, [programs.path(gear + ".lcmlog")],
                               [f"{options.source}/deploy/robots/frc3314-{gear}.json"])
        for mission in sorted(missions, key=lambda m: m["mission_id"]):
            name = mission["mission_id"]
            check(mission["state"] == "finished" and not mission["incomplete"], f"{name} is {mission}")
            linear, trapezoid = energies(recordings / (name + ".csv"))
            for side in range(2):
                close_to(mission["energy"]["measured_motor_j"][side], linear[side], 1e-3, f"{name}, side {side}")
            measured = sum(mission["energy"]["measured_motor_j"])
            stored[name] = measured
            print(f"{name:<28} {measured:>11.3f} {sum(linear):>13.3f} {measured / sum(linear) - 1:>+11.1e} "
                  f"{measured / sum(trapezoid) - 1:>+10.2%}")
            direct = next(m for m in again if m["mission_id"] == name)
            check(direct["energy"] == mission["energy"], f"{name}: the ledgers differ between LCM and direct import")
        # A busy machine may drop datagrams; all of them must be counted.
        sent, heard = samples_in(programs.path(gear + ".lcmlog")), sum(m["samples"] for m in missions)
        lost = sum(m["sample_faults"].get("missing", 0) for m in missions)
        check(heard + lost == sent, f"{gear}: {heard} of {sent} samples are metered, {lost} are counted as lost")
    check(len(stored) == 8, "eight missions are stored")

    splits = {"forward": lambda n: "forward" in n, "quasi-static": lambda n: n.startswith("quasi-static")}
    for gear in gears:
        names = [n for n in stored if n.endswith(gear)]
        for split, chosen in splits.items():
            for method in ("steady", "whole"):
                fit = json.loads(programs.run(
                    "calibrate", "drive", programs.path(gear + ".lcmlog"), "--method", method, "--json", "--robot",
                    f"{options.source}/deploy/robots/frc3314-{gear}.json", "--train",
                    ",".join(n for n in names if chosen(n)), "--out", programs.path("fitted.json"), "--force"))
                unused = [m for m in fit["missions"] if not m["trained_on"]]
                check(len(unused) == 2, f"{len(unused)} runs are left for the test")
                missed = sum(abs(m["calibrated_j"] - m["measured_j"]) for m in unused)
                total = sum(m["measured_j"] for m in unused)
                for mission in fit["missions"]:
                    close_to(mission["measured_j"], stored[mission["mission_id"]], 1e-4, "calibrate's measured energy")
                print(f"\n{gear} gear, fitted to {split} runs, {method}: {missed / total:.1%} of the energy of the "
                      "other runs is missed")
                for mission in unused:
                    print(f"  {mission['mission_id']:<28} {mission['measured_j']:>9.1f} J measured, "
                          f"{mission['calibrated_j']:>9.1f} J modelled ({mission['calibrated_error']:+.1%}; "
                          f"data sheet {mission['file_error']:+.1%})")
                for p in fit["parameters"]:
                    error = f"+- {p['standard_error']:.2g}" if p["fitted"] else "held: " + p["note"]
                    print(f"  {p['name']:<26} {p['value']:>10.4g} {p['unit']:<9} {error}")
    check(programs.stop() == 0, "the daemon did not stop in order")


main()
