#!/usr/bin/env python3
"""joulecast answers the same JSON from a robot file as through a daemon that holds it; faults have their exit codes."""
import json
import subprocess
import xml.etree.ElementTree

from harness import Programs, arguments, check


def main():
    options = arguments()
    programs = Programs(options)
    programs.lcm_url = "memq://"
    programs.start()
    robot = f"{options.source}/deploy/robots/amr.json"
    with open(robot) as file:
        programs.put("/v1/robots/amr", json.load(file))
    with open(programs.path("motion.json"), "w") as file:
        json.dump({"profile": {"time_s": [0, 2, 6, 8], "speed_m_s": [0, 1, 1, 0]}, "payload_kg": 3}, file)
    questions = [
        ["profile", "--length", "8", "--payload", "5"],
        ["profile", "--length", "8", "--deadline", "14", "--pareto", "3"],
        ["profile", "--turn", "1.57", "--length", "3", "--value-of-time", "20", "--regeneration", "0.5"],
        ["estimate", "--length", "12", "--start-speed", "0.2", "--end-speed", "0.1"],
        ["estimate", "--request", programs.path("motion.json")],
        ["autonomy", "--charge", "0.6", "--payload", "10"],
    ]
    for question in questions:
        here = programs.run(*question, "--robot", robot, "--json")
        there = programs.run(*question, "--server", programs.url, "--robot-id", "amr", "--json")
        check(here.strip() == there.strip(), f"{question}: from the file\n{here}\nby the daemon\n{there}")
        table = programs.run(*question, "--robot", robot)
        check("amr (model version 1)" in table, f"{question} prints\n{table}")
    # A motion that the robot cannot drive has a price all the same, and a warning.
    with open(programs.path("fast.json"), "w") as file:
        json.dump({"profile": {"time_s": [0, 2, 6, 8], "speed_m_s": [0, 3, 3, 0]}}, file)
    warned = subprocess.run([options.client, "estimate", "--robot", robot, "--request", programs.path("fast.json")],
                            capture_output=True, text=True, check=True)
    check("speed reaches 3 m/s, its limit is 1.5" in warned.stderr, warned.stderr)
    with open(programs.path("errands.json"), "w") as file:
        json.dump({"robots": [{"robot_id": "amr", "pose": {"x_m": 1, "y_m": 2, "heading_rad": 3}}],
                   "tasks": [{"task_id": "near", "payload_kg": 10, "pickup": {"x_m": 3, "y_m": 4}, "dropoff": {"x_m": 9, "y_m": 4}},
                             {"task_id": "heavy", "payload_kg": 1000, "empty": {"distance_m": 3}, "loaded": {"distance_m": 3}}]}, file)
    matrix = ["matrix", programs.path("errands.json")]
    here = programs.run(*matrix, "--robot", robot, "--json")
    check(here.strip() == programs.run(*matrix, "--server", programs.url, "--json").strip(), f"{matrix}: {here}")
    row = json.loads(here)["rows"][0]
    check(row["energy_j"][0] > 0 and row["energy_j"][1] is None and row["infeasible"][0]["tasks"] == [1], row)
    table = programs.run(*matrix, "--robot", robot)
    check("near" in table and "none can do it" in table, f"{matrix} prints\n{table}")

    for question in (questions[0], questions[4]):
        picture = programs.path("plot.svg")
        programs.run(*question, "--robot", robot, "--plot", picture)
        lines = xml.etree.ElementTree.parse(picture).getroot().findall(".//{http://www.w3.org/2000/svg}polyline")
        check(len(lines) >= 3, f"{question} draws {len(lines)} lines")

    page = json.loads(programs.run("missions", "--server", programs.url, "--robot-id", "amr", "--json"))
    check(page == {"missions": [], "next_cursor": None}, f"a fresh daemon knows missions: {page}")

    faults = {
        2: [["profile", "--length", "8"], ["estimate", "--server", programs.url], ["profile", "--length", "many"],
            ["profile", "--robot", robot], ["autonomy", "--robot", robot], ["missions", "--server", programs.url, "--state", "lost"]],
        1: [["profile", "--robot", programs.path("no-such-file.json"), "--length", "8"],
            ["profile", "--robot", robot, "--length", "-8"],
            ["profile", "--server", programs.url, "--robot-id", "nobody", "--length", "8"],
            ["missions", "--server", programs.url, "--limit", "many"]],
        3: [["profile", "--server", "http://127.0.0.1:1", "--robot-id", "amr", "--length", "8"]],
        4: [["profile", "--robot", robot, "--length", "80", "--deadline", "1"]],
    }
    for code, commands in faults.items():
        for command in commands:
            done = subprocess.run([options.client, *command], capture_output=True, text=True)
            check(done.returncode == code, f"{command} ends with {done.returncode}, not {code}: {done.stderr}")
            check(done.stderr, f"{command} fails without a word")
    check(programs.stop() == 0, "the daemon did not stop in order")


main()
