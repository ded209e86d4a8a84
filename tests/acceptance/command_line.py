#!/usr/bin/env python3
"""joulecast prints the same JSON from a robot file and through a daemon with this file; faults have their exit codes."""
import json
import os
import pty
import sqlite3
import subprocess
import xml.etree.ElementTree

from harness import Programs, arguments, check


def on_a_terminal(command):
    """What a command prints to a terminal."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=theirs, stderr=subprocess.DEVNULL)
    os.close(theirs)
    printed = b""
    try:
        while part := os.read(ours, 65536):
            printed += part
    except OSError:  # EIO: the program has ended
        pass
    os.close(ours)
    check(process.wait(timeout=20) == 0, f"{command} exited with {process.returncode}")
    return printed


def read_history(options, programs):
    """robots, state, ledger, export, proposals and adopt, with a daemon that starts on a stored history."""
    robot = f"{options.source}/deploy/robots/amr.json"
    log, store = programs.path("amr.lcmlog"), programs.path("past.db")
    programs.run("simulate", "--robots", "1", "--robot", robot, "--seed", "7", "--missions", "3", "--mission-duration", "30", "--speed", "0", "--log", log, "--quiet")
    programs.run("replay", log, "--into", store, "--robot", robot)
    with sqlite3.connect(store) as rows:
        check(rows.execute("UPDATE mission SET note = ?", ("\x1b[2J\x9b2J",)).rowcount == 3, "missions with a note")
        rows.execute("DELETE FROM telemetry_chunk WHERE mission_key = 2")  # as the retention does
    rows.close()
    process = subprocess.Popen([options.daemon, "--http-port", "0", "--store-path", store, "--lcm-url", "memq://", "--log-format", "json"],
                               stderr=subprocess.PIPE, text=True)
    url = next(event["http"] for event in map(json.loads, process.stderr) if event["message"] == "ready")
    server = ["--server", url.removeprefix("http://")]
    fleet = programs.run("robots", *server)
    done = subprocess.run([options.client, "robots"], capture_output=True, text=True, env=os.environ | {"JOULECAST_SERVER": server[1]})
    check(done.returncode == 0 and "amr" in done.stdout, f"JOULECAST_SERVER: {done.stdout}{done.stderr}")
    check(fleet.splitlines()[1].startswith("amr ") and "charge %" in fleet, fleet)
    check(json.loads(programs.run("robots", *server, "--json"))["robots"][0]["robot_id"] == "amr", fleet)
    state = programs.run("state", *server, "--robot-id", "amr")
    check(state.startswith("amr: silent for ") and "  charge " in state and "km (at least " in state and "in 19 of 20 cases" in state, state)
    check(programs.run("state", "amr", *server).startswith("amr: silent for "), "a robot as argument")
    ledger = programs.run("ledger", "1", "--unit", "J", *server)
    parts = [float(line.split()[1]) for line in ledger.splitlines()[1:]]
    whole = float(ledger.splitlines()[0].split(": ")[1].split()[0])
    check(len(parts) > 4 and abs(sum(parts) - whole) < 0.05, ledger)
    check(programs.run("ledger", "amr-s7-m1", *server).startswith(f"amr-s7-m1 of amr (model version 1): {whole / 3600:.4f} Wh "), "in Wh, by the mission's id")
    for name, least, title in (("missions", 3, "id,robot_id"), ("telemetry", 500, "utime_us,sequence"), ("trace", 10, "start_utime_us,covered_s")):
        out = programs.path(f"{name}.csv")
        of = [] if name == "missions" else ["--mission", "1"]
        programs.run("export", name, *server, *of, "--out", out)
        rows = open(out, newline="").read().split("\r\n")
        check(rows[0].startswith(title) and len(rows) > least and rows.count(rows[0]) == 1, f"{name}: {len(rows)} rows, {rows[0]}")
        check(programs.run("export", name, *server, *of).replace("\r", "").split("\n") == "\n".join(rows).replace("\r", "").split("\n"), f"{name} differs on standard output")
        done = subprocess.run([options.client, "export", name, *server, *of, "--out", out], capture_output=True, text=True)
        check(done.returncode == 1 and "--out" in done.stderr, f"{name} was written over: {done}")
    done = subprocess.run([options.client, "export", "telemetry", *server, "--mission", "2"], capture_output=True, text=True)
    check(done.returncode == 0 and done.stdout.count("\n") == 1 and "the store has 0 of the mission's 1" in done.stderr, f"removed telemetry: {done}")
    # Controls in a text of another user reach a file unchanged, a terminal in writing.
    for command in (["export", "missions"], ["missions", "--json"], ["missions"]):
        printed = on_a_terminal([options.client, *command, *server])
        check(b"\x1b" not in printed and b"\xc2\x9b" not in printed and (command == ["missions"] or b"\\u001b[2J\\u009b2J" in printed), f"{command}: {printed}")
    check("\x1b[2J\x9b2J" in programs.run("export", "missions", *server), "a file has the note as stored")
    # Pages are followed: three missions with the server's default page size are three lines.
    check("no proposal" in programs.run("proposals", *server) and json.loads(programs.run("proposals", *server, "--json"))["proposals"] == [], "proposals")
    changed = json.load(open(robot))
    changed["idle_power_w"] += 1
    with open(programs.path("changed.json"), "w") as file:
        json.dump(changed, file)
    adopt = ["adopt", *server, "--robot-id", "amr"]
    tested = programs.run(*adopt, "--model", programs.path("changed.json"), "--dry-run")
    check("back-test on " in tested and "nothing changed, version 1 stays in force (dry run)" in tested, tested)
    check("model version 2 is in force (was 1)" in programs.run(*adopt, "--model", programs.path("changed.json"), "--force", "--note", "a camera"), "adopt")
    check("model version 1 is in force" in programs.run(*adopt, "--version", "1"), "back to version 1")
    for command, code, words in (([*adopt, "--version", "9"], 1, "--version"), ([*adopt, "--version", "1", "--proposal", "1"], 2, "--help"),
                                 (["ledger", "99", *server], 1, "mission"), (["state", *server, "--robot-id", "nobody"], 1, "--robot-id"),
                                 (["export", "missions", *server, "--from", "yesterday"], 2, "--from"), (["robot", *server], 2, "did you mean robots")):
        done = subprocess.run([options.client, *command], capture_output=True, text=True)
        check(done.returncode == code and words in done.stderr, f"{command}: {done}")
    process.terminate()
    check(process.wait(timeout=20) == 0, "the daemon did not stop in order")
    process.stderr.close()


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
    # A motion that the robot cannot drive still has a cost, and a warning.
    with open(programs.path("fast.json"), "w") as file:
        json.dump({"profile": {"time_s": [0, 2, 6, 8], "speed_m_s": [0, 3, 3, 0]}}, file)
    warned = subprocess.run([options.client, "estimate", "--robot", robot, "--request", programs.path("fast.json")],
                            capture_output=True, text=True, check=True)
    check("speed reaches 3 m/s, its limit is 1.5" in warned.stderr, warned.stderr)
    with open(programs.path("errands.json"), "w") as file:
        json.dump({"robots": [{"robot_id": "amr", "pose": {"x_m": 1, "y_m": 2, "heading_rad": 3}}],
                   "tasks": [{"task_id": "near", "payload_kg": 10, "pickup": {"x_m": 3, "y_m": 4}, "dropoff": {"x_m": 9, "y_m": 4}},
                             {"task_id": "heavy", "payload_kg": 1000, "empty": {"distances_m": [3]}, "loaded": {"distances_m": [3]}}]}, file)
    matrix = ["matrix", programs.path("errands.json")]
    here = programs.run(*matrix, "--robot", robot, "--json")
    check(here.strip() == programs.run(*matrix, "--server", programs.url, "--json").strip(), f"{matrix}: {here}")
    row = json.loads(here)["rows"][0]
    check(row["energy_j"][0] > 0 and row["energy_j"][1] is None and row["infeasible"][0]["task_ids"] == ["heavy"], row)
    table = programs.run(*matrix, "--robot", robot)
    check("near" in table and "none can do it" in table, f"{matrix} prints\n{table}")

    for question in (questions[0], questions[4]):
        picture = programs.path("plot.svg")
        programs.run(*question, "--robot", robot, "--plot", picture, "--force")
        lines = xml.etree.ElementTree.parse(picture).getroot().findall(".//{http://www.w3.org/2000/svg}polyline")
        check(len(lines) >= 3, f"{question} draws {len(lines)} lines")

    # Time that the robot cannot save is not offered.
    drive = ["profile", "--robot", robot, "--length", "8"]
    free = json.loads(programs.run(*drive, "--json"))
    shortest_s = free["certificate"]["shortest_time_s"]
    check(shortest_s < free["duration_s"] < shortest_s + 1 and free["certificate"]["time_multiplier_w"] == 0, free["certificate"])
    check(f"this duration needs the least energy; the robot's limits allow {shortest_s:.2f} s at best" in programs.run(*drive), programs.run(*drive))
    for deadline_s, words in ((shortest_s * 1.0002, "no shorter time is possible: the robot is at its limits"),
                              ((shortest_s + 3 * free["duration_s"]) / 4, "less time would cost ")):
        output = programs.run(*drive, "--deadline", f"{deadline_s:.5f}")
        check(words in output and "one second less would cost at least 0" not in output, output)

    read_history(options, programs)
    page = json.loads(programs.run("missions", "--server", programs.url, "--robot-id", "amr", "--json"))
    check(page == {"missions": [], "next_cursor": None}, f"a new daemon has missions: {page}")

    asked_by = ["--robot", robot], ["--server", programs.url, "--robot-id", "amr"]
    faults = {
        2: [["profile", "--length", "8"], ["estimate", "--server", programs.url], ["profile", "--length", "many"],
            ["profile", "--robot", robot], ["autonomy", "--robot", robot], ["missions", "--server", programs.url, "--state", "lost"],
            *(["profile", *by, "--length", "-8"] for by in asked_by), *(["autonomy", *by, "--charge", "2"] for by in asked_by),
            ["autonomy", "--server", programs.url, "--charge", "2"],
            *(["estimate", *by, "--turn", "1", "--length", "5", "--payload", "999"] for by in asked_by),
            ["missions", "--server", programs.url, "--limit", "many"]],
        1: [["profile", "--robot", programs.path("no-such-file.json"), "--length", "8"],
            ["profile", "--server", programs.url, "--robot-id", "nobody", "--length", "8"]],
        3: [["profile", "--server", "http://127.0.0.1:1", "--robot-id", "amr", "--length", "8"]],
        4: [["profile", *by, "--length", "80", "--deadline", "1"] for by in asked_by],
    }
    messages = {}
    for code, commands in faults.items():
        for command in commands:
            done = subprocess.run([options.client, *command], capture_output=True, text=True)
            check(done.returncode == code, f"{command} ends with {done.returncode}, not {code}: {done.stderr}")
            check(done.stderr, f"{command} fails without a message")
            messages[" ".join(command[:1] + command[-2:])] = messages.get(" ".join(command[:1] + command[-2:]), "") + done.stderr
    # A fault names its flag, with a file and with a daemon, and so does an unknown robot.
    for request, flag in (("profile --length -8", "--length"), ("autonomy --charge 2", "--charge"), ("estimate --payload 999", "--payload"),
                        ("profile --deadline 1", "--deadline"), ("missions --limit many", "--limit")):
        check(f"joulecast: {flag}: " in messages[request], f"{request}: {messages[request]}")
        check(messages[request].count("joulecast: ") == messages[request].count(f"joulecast: {flag}: "), f"{request}: {messages[request]}")
    wording = "no robot is called 'nobody'"
    for command in (["profile", "--length", "8"], ["autonomy", "--charge", "0.5"], ["gap"]):
        done = subprocess.run([options.client, *command, "--server", programs.url, "--robot-id", "nobody"], capture_output=True, text=True)
        check(done.returncode == 1 and f"joulecast: --robot-id: {wording}" in done.stderr, f"{command}: {done.stderr}")
    # What does not exist is named as the command names it.
    for command, message in ((["adopt", "amr", "--proposal", "99"], "--proposal: no proposal has id 99"),
                             (["adopt", "amr", "--diagnosis", "99"], "--diagnosis: no diagnosis has id 99"),
                             (["ledger", "99999"], "mission: no mission has number 99999")):
        done = subprocess.run([options.client, *command, "--server", programs.url], capture_output=True, text=True)
        check(done.returncode == 1 and f"joulecast: {message} (" in done.stderr, f"{command}: {done.stderr}")
    for command in (["robots"], ["state", "amr"], ["ledger", "1"], ["autonomy", "amr"], ["gap", "amr"], ["adopt", "amr", "--version", "1"]):
        done = subprocess.run([options.client, *command, "--server", programs.url + "/nowhere"], capture_output=True, text=True)
        check(done.returncode == 1 and f"joulecast: --server: {programs.url}/nowhere is no joulecastd" in done.stderr, f"{command}: {done.stderr}")
    # The daemon exits with 2 for a wrong command line and with 1 if it cannot start; it always names the setting.
    for code, name, setting in ((2, "--http-port", "99999"), (1, "store.path", "/no/such/folder/store.db")):
        flag = name if name.startswith("--") else "--store-path"
        done = subprocess.run([options.daemon, flag, setting, "--lcm-url", "memq://"], capture_output=True, text=True, timeout=30)
        check(done.returncode == code and f"{name}: " in done.stdout + done.stderr, f"{flag} {setting}: {done.returncode} {done.stdout}{done.stderr}")
    check(programs.stop() == 0, "the daemon did not stop in order")


main()
