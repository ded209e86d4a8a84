"""Runs every example that `joulecast COMMAND --help` prints, on files and against a daemon made for them.

Ends with 77 where LCM multicast is missing.
"""

import argparse
import json
import math
import re
import subprocess
import sys
from pathlib import Path

from sandbox import SKIP, Sandbox, multicast_here


def help_of(client, *command):
    return subprocess.run([client, *command, "--help"], check=True, capture_output=True, text=True).stdout


def subcommands(text):
    block = re.search(r"^Subcommands:\n((?:  \S.*\n|   +.*\n)*)", text, re.M)
    return re.findall(r"^  (\w+)", block.group(1), re.M) if block else []


def examples(client, *command):
    """(command, example) of the command and of those below it."""
    text = help_of(client, *command)
    block = re.search(r"^Examples:\n((?:  .*\n)+)", text, re.M)
    below = subcommands(text)
    if command and not below and not block:
        raise SystemExit(f"joulecast {' '.join(command)} --help has no examples")
    found = [line.strip() for line in block.group(1).splitlines()] if block else []
    for name in below:
        found += examples(client, *command, name)
    return found


def battery_recordings(home):
    """A cell of 2.6 Ah with a straight open-circuit voltage and 40 mOhm, as the tests that identify cells record it."""
    def write(name, rows):
        (home / name).write_text("t_s,I_A,V_V,T_C,cycle\n" + "".join(f"{t:.1f},{i:.4f},{v:.4f},25.0,1\n" for t, i, v in rows))

    def discharge(current, step_s, begin=1.0, rest_every_s=None):
        rows, t, charge = [(0.0, 0.0, 3.0 + 1.2 * begin)], 0.0, begin
        while True:
            i = current(t)
            v = 3.0 + 1.2 * charge - 0.04 * i
            if v < 3.02 or charge <= 0:
                return rows
            rows.append((t + step_s, i, v))
            t += step_s
            charge -= i * step_s / (2.6 * 3600)

    write("cell_c20_data.csv", discharge(lambda t: 0.13, 60))
    write("cell_1c_data.csv", discharge(lambda t: 2.6, 5))
    write("cell_pulses_data.csv", discharge(lambda t: 2.6 if t % 1800 < 360 else 0.0, 5))
    write("cell_rw.csv", discharge(lambda t: 1.5 + math.sin(t / 40) + 0.4 * math.sin(t / 7), 5))


def foreign_table(home):
    """Ten seconds of a straight drive as another system's table, and the mapping that names its columns."""
    rows = [f"{0.02 * k:.2f},{min(0.1 * k, 10):.2f},{min(0.1 * k, 10):.2f},25.6,{1 + 0.02 * min(k, 100):.2f}\n" for k in range(500)]
    (home / "runs.csv").write_text("t,right,left,volt,ampere\n" + "".join(rows))
    (home / "mapping.json").write_text(json.dumps({
        "robot_id": "amr", "mission_id": "{stem}", "time": {"column": "t", "unit": "s"},
        "fields": {"wheel_velocity": [{"column": "right"}, {"column": "left"}],
                   "battery_voltage": {"column": "volt"}, "battery_current": {"column": "ampere"}}}))


def tasks(home):
    stations = [{"task_id": f"t{k}", "pickup": {"x_m": 5.0 * k, "y_m": 2.0}, "dropoff": {"x_m": 3.0, "y_m": 9.0},
                 "payload_kg": 10.0 * k} for k in range(1, 4)]
    (home / "tasks.json").write_text(json.dumps(
        {"robots": [{"robot_id": "amr", "pose": {"x_m": 0.0, "y_m": 0.0}}], "tasks": stations}))


def prepare(sandbox):
    tasks(sandbox.home)
    battery_recordings(sandbox.home)
    foreign_table(sandbox.home)
    for command in (
            "cp deploy/robots/amr.json .",
            "joulecast simulate --robots 1 --robot amr.json --seed 7 --missions 3 --mission-duration 40 --speed 0 "
            "--effect load_rolling_resistance=0.02 --log amr.lcmlog --quiet",
            "joulecast simulate --robots 1 --robot amr.json --seed 8 --missions 3 --mission-duration 40 --speed 0 "
            "--effect load_rolling_resistance=0.02 --log fresh.lcmlog --quiet",
            "joulecast replay amr.lcmlog --into daemon.db --robot amr.json",
            "joulecast replay fresh.lcmlog --into daemon.db --robot amr.json",
            "joulecastd --store-path daemon.db --robots-directory deploy/robots > joulecastd.log 2>&1 &",
            "curl -sf --retry 9 --retry-connrefused http://127.0.0.1:8080/readyz",
            "joulecast simulate --robots 1 --robot amr.json --mission-duration 20 --duration 6 --speed 4"):
        output, code = sandbox.run(command)
        if code != 0:
            raise SystemExit(f"{command}\n" + "\n".join(output))


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--daemon", type=Path, required=True)
    arguments.add_argument("--client", type=Path, required=True)
    arguments.add_argument("--source", type=Path, required=True)
    options = arguments.parse_args()
    if not multicast_here():
        print("skipped: no route for LCM multicast")
        return SKIP
    lines = examples(str(options.client.resolve()))
    faults = 0
    with Sandbox(options.daemon, options.client, options.source) as sandbox:
        prepare(sandbox)
        for line in lines:
            output, code = sandbox.run(line)
            if code != 0:
                faults += 1
                print(f"$ {line}\n" + "\n".join(output) + f"\n(exit code {code})\n")
    print(f"{len(lines)} examples, {faults} at fault")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
