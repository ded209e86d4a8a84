#!/usr/bin/env python3
"""The store is backed up under a running daemon, robots are removed with and without their history, the store is checked and
restored; crafted input files are rejected in time, and output files are never written through links."""
import json
import os
import pathlib
import struct
import subprocess
import time
import urllib.error
import urllib.request

from harness import Programs, arguments, check, need_multicast

CRAFTED_S = 10  # on a loaded machine; it takes 0.1 s


def asked(programs, method, path):
    """(HTTP status, document)"""
    try:
        with urllib.request.urlopen(urllib.request.Request(programs.url + path, method=method), timeout=30) as reply:
            return reply.status, json.load(reply)
    except urllib.error.HTTPError as error:
        return error.code, json.load(error)


def care(programs, *command, code=0):
    done = subprocess.run([programs.options.daemon, "--store-path", programs.store, *command], capture_output=True, text=True)
    check(done.returncode == code, f"joulecastd {' '.join(command)}: {done.returncode} {done.stdout}{done.stderr}")
    return done.stdout + done.stderr


def removed(programs):
    fleet = subprocess.Popen([programs.options.client, "simulate", "--robots", "2", "--lcm-url", programs.lcm_url, "--server",
                              programs.url, "--rate", "20", "--mission-duration", "4", "--quiet"])
    try:
        until = time.monotonic() + 60
        while True:
            robots = programs.get("/v1/robots")["robots"]
            ended = {r["robot_id"]: [m for m in programs.missions(r["robot_id"]) if m["state"] != "open"] for r in robots}
            if len(ended) == 2 and all(ended.values()):
                break
            check(time.monotonic() < until, f"missions did not end: {ended}")
            time.sleep(0.2)
        (kept, _), (purged, missions) = sorted(ended.items())
        check(asked(programs, "DELETE", "/v1/robots/absent")[0] == 404, "an unknown robot")
        check(asked(programs, "DELETE", f"/v1/robots/{kept}?history=burn")[0] in (400, 422), "an unknown choice")

        copy = programs.path("copy.db")
        care(programs, "--backup", copy)
        check("already exists" in care(programs, "--backup", copy, code=1), "a backup is overwritten")
        check("is locked" in care(programs, "--restore", copy, code=1), "a store in use is restored")
        check("sound" in care(programs, "--check-store"), "check next to a daemon")

        # During the drive of both.
        status, answer = asked(programs, "DELETE", f"/v1/robots/{kept}")
        check(status == 200 and answer == {"robot_id": kept, "history": "keep", "missions_deleted": 0}, f"keep: {answer}")
        status, answer = asked(programs, "DELETE", f"/v1/robots/{purged}?history=purge")
        check(status == 200 and answer["missions_deleted"] >= len(missions), f"purge: {answer}")
        time.sleep(2)  # they continue to drive, without a model
        for robot in (kept, purged):
            check(asked(programs, "GET", f"/v1/robots/{robot}")[0] == 404, f"{robot} has a model")
        check(programs.missions(kept) and not programs.missions(purged), "missions kept and purged")
        check(all(m["state"] != "open" for m in programs.missions(kept)), "an open mission")
        events = programs.get("/v1/event-log?limit=1000")["events"]
        removals = {e["robot_id"]: e["detail"]["history"] for e in events if e["kind"] == "robot_removed"}
        check(removals == {kept: "keep", purged: "purge"}, f"audit: {removals}")
        log = open(programs.path("daemon.log")).read()
        check("no mission has number" not in log, "data of a removed robot was written after its removal")
    finally:
        fleet.terminate()
        fleet.wait()
    model = json.load(open(os.path.join(programs.options.source, "deploy/robots/amr.json")))
    check(programs.put(f"/v1/robots/{kept}", model | {"robot_id": kept})["model_version"] == 2, "a kept robot's next version")
    check(programs.put(f"/v1/robots/{purged}", model | {"robot_id": purged})["model_version"] == 1, "a purged robot's first")
    check(programs.stop() == 0, "stop")
    check("sound" in care(programs, "--check-store"), "check")
    check("the previous file is" in care(programs, "--restore", copy), "restore")
    programs.start()
    check(len(programs.missions(purged)) >= len(missions), "the missions are back")
    check(programs.stop() == 0, "stop")
    store = os.path.getsize(programs.store)
    with open(programs.store, "r+b") as file:
        file.seek(store // 2 // 4096 * 4096)
        file.write(b"\xa5" * 4096)
    damaged = care(programs, "--check-store", code=3)
    care(programs, "--restore", programs.store + ".absent", code=1)
    whole = programs.path("whole.db")
    print(damaged.splitlines()[0], "/", care(programs, "--salvage", whole, code=3).splitlines()[-1])
    care(programs, "--restore", whole)
    care(programs, "--check-store")


def fails(programs, *command):
    done = subprocess.run([programs.options.client, *command], capture_output=True, text=True, timeout=CRAFTED_S)
    check(done.returncode not in (0, None) and done.returncode > 0, f"{command}: {done.returncode} {done.stdout[:500]}")
    return done.stderr


def files(programs):
    robot = os.path.join(programs.options.source, "deploy/robots/amr.json")
    log = programs.path("crafted.lcmlog")
    with open(log, "wb") as file:
        file.write(b"x" + struct.pack(">IqqiI", 0xEDA1DA01, 0, 0, 3, 15 << 20) * 36_000 + bytes(34 << 20))
    fails(programs, "gap", log, "--robot", robot)
    fails(programs, "calibrate", "drive", log, "--robot", robot)
    check("more than" in fails(programs, "gap", log, "--robot", "/dev/zero"), "an endless robot file")

    victim, link = programs.path("victim"), programs.path("link")
    with open(victim, "w") as file:
        file.write("victim")
    os.symlink(victim, link)
    table, mapping = programs.path("table.csv"), programs.path("mapping.json")
    with open(table, "w") as file:
        file.write("t,v,w,u,i\n" + "".join(f"{k * 0.1},0.5,0,24,2\n" for k in range(50)))
    with open(mapping, "w") as file:
        json.dump({"robot_id": "amr", "time": {"column": "t", "unit": "s"}, "speed": {"column": "v", "unit": "m/s"},
                   "yaw_rate": {"column": "w", "unit": "rad/s"}, "battery_voltage": {"column": "u", "unit": "V"},
                   "battery_current": {"column": "i", "unit": "A"}, "wheel_radius_m": 0.1, "track_m": 0.5}, file)
    for path, why in ((link, "symbolic link"), (victim, "already exists")):
        for command in (("import", table, "--mapping", mapping, "--start", "2026-03-01T08:00:00Z", "--out", path),
                        ("calibrate", "drive", log, "--robot", robot, "--out", path),
                        ("calibrate", "battery", table, "--out", path),
                        ("simulate", "--duration", "1", "--log", path)):
            check(why in fails(programs, *command), f"{command} overwrites {path}")
    check(open(victim).read() == "victim", "the victim of a link")
    plot = [pathlib.Path(programs.options.client).with_name("joulecast-study"), "explore", "--case", "1",
            "--plot", programs.path("new.svg")]
    subprocess.run(plot, check=True, capture_output=True, timeout=CRAFTED_S)
    again = subprocess.run(plot, capture_output=True, text=True, timeout=CRAFTED_S)
    check(again.returncode > 0 and "already exists" in again.stderr, "explore --plot")
    programs.run("simulate", "--quiet", "--duration", "1", "--log", link, "--force")
    check(not os.path.islink(link) and open(victim).read() == "victim", "--force follows the link")
    check(not [name for name in os.listdir(programs.folder.name) if name.endswith(".part")], "a part is left")


def main():
    options = arguments()
    need_multicast()
    programs = Programs(options)
    files(programs)
    programs.start()
    for name in ("", "-wal", "-shm", ".lock"):
        mode = os.stat(programs.store + name).st_mode & 0o777
        check(mode & 0o007 == 0, f"history.db{name} has the mode {mode:o}")
    removed(programs)


main()
