#!/usr/bin/env python3
"""The host's clock is set while robots drive: by an hour back, by an hour and then by sixty days forward. Robots stay live, their
silence is measured by elapsed time, missions continue, no recording is deleted, and the step is reported. A preloaded library
changes the daemon's clock; the machine's clock is not changed."""
import os
import sqlite3
import subprocess
import time

from harness import Programs, arguments, check, need_multicast
from host_faults import HostFaults

DAY_S = 86400


def main():
    options = arguments()
    need_multicast()
    programs = Programs(options)
    faults = HostFaults(programs.folder.name)
    # Existing recordings, which a wrong clock could age.
    log = programs.path("old.lcmlog")
    programs.run("simulate", "--robots", "1", "--robot", os.path.join(options.source, "deploy/robots/tug.json"), "--seed", "3",
                 "--missions", "2", "--mission-duration", "40", "--speed", "0", "--log", log)
    programs.run("replay", log, "--into", programs.store, "--robot", os.path.join(options.source, "deploy/robots/tug.json"))
    programs.environment = faults.environment
    programs.start()
    fleet = subprocess.Popen([options.client, "simulate", "--robots", "2", "--lcm-url", programs.lcm_url, "--server", programs.url,
                              "--rate", "50", "--missions", "1", "--mission-duration", "300", "--quiet"])

    def chunks():
        with sqlite3.connect(f"file:{programs.store}?mode=ro", uri=True) as store:
            return store.execute("SELECT count(*) FROM telemetry_chunk AS c JOIN mission USING (mission_key) "
                                 "WHERE mission.robot_id = 'tug'").fetchone()[0]

    try:
        time.sleep(4)
        before = chunks()
        check(before > 0, "no recordings to lose")
        started = {m["robot_id"]: m["id"] for m in programs.get("/v1/missions?state=open")["missions"]}
        check(len(started) == 2, f"open missions: {started}")
        for offset_s in (-3600, 3600, 60 * DAY_S):
            faults.set_clock(offset_s)
            time.sleep(3)
            open_now = {m["robot_id"]: m["id"] for m in programs.get("/v1/missions?state=open")["missions"]}
            check(open_now == started, f"missions after a step to {offset_s} s: {open_now} were {started}")
            for robot in started:
                state = programs.get(f"/v1/robots/{robot}/state")
                check(state["live"] and abs(state["silent_s"]) < 2, f"{robot} after a step to {offset_s} s: silent "
                                                                    f"{state['silent_s']}, live {state['live']}")
        # Two runs of the retention, which runs once a minute.
        time.sleep(65)
        check(chunks() == before, f"{before - chunks()} of {before} chunks were deleted")
    finally:
        fleet.terminate()
        fleet.wait()
    steps = [e["detail"]["step_s"] for e in programs.get("/v1/event-log?limit=1000")["events"] if e["kind"] == "host_clock_step"]
    print("steps reported:", steps)
    check([round(s) for s in steps] == [-3600, 7200, 60 * DAY_S - 3600], f"steps reported: {steps}")
    check(programs.stop() == 0, "stop")


main()
