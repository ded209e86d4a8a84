#!/usr/bin/env python3
"""Robots that need attention are listed with reason and action: telemetry that contradicts the robot file, silence during a
mission, low charge, no robot file, a drift and its diagnosis. Healthy robots are not listed. An outdated reason leaves the list.
An acknowledgement lasts over a restart until the condition ends. Beginnings and ends are in the log."""
import json
import os
import signal
import subprocess

from harness import Programs, arguments, ask, check, need_multicast, wait_until


class Fleet:
    """Virtual robots of one kind with separate names."""

    def __init__(self, programs):
        self.programs, self.running = programs, []
        with open(programs.options.source + "/deploy/robots/amr.json", encoding="utf-8") as file:
            self.kind = json.load(file)

    def file(self, robot_id, **change):
        path = self.programs.path(robot_id + ".json")
        with open(path, "w", encoding="utf-8") as file:
            json.dump({**self.kind, "robot_id": robot_id, **change}, file)
        return path

    def drive(self, robot_id, *options):
        self.running.append(subprocess.Popen(
            [self.programs.options.client, "simulate", "--robots", "1", "--robot", self.file(robot_id), "--lcm-url",
             self.programs.lcm_url, "--rate", "20", "--quiet", *options]))
        return self.running[-1]

    def end(self):
        for process in self.running:
            process.kill()
            process.wait()


def history(programs, fleet):
    """A robot with dry friction that rose between two days."""
    for seed, missions, options in ((31, 8, []), (32, 6, ["--effect", "coulomb_friction=0.6", "--start", "2023-11-16T08:00:00Z"])):
        programs.run("simulate", "--robots", "1", "--robot", fleet.file("worn"), "--seed", seed, "--missions", missions,
                     "--mission-duration", "40", "--rate", "20", "--speed", "0", "--log", programs.path(f"{seed}.lcmlog"), "--quiet", *options)
    programs.run("replay", programs.path("31.lcmlog"), programs.path("32.lcmlog"), "--into", programs.store, "--robot",
                 fleet.file("worn"))


def main():
    programs = Programs(arguments())
    need_multicast()
    fleet = Fleet(programs)
    history(programs, fleet)
    programs.start()

    def listed():
        return {entry["robot_id"]: {reason["kind"]: reason for reason in entry["reasons"]}
                for entry in programs.get("/v1/attention")["attention"]}

    def wait_for(robot_id, kind, seconds=60):
        wait_until(lambda: kind in listed().get(robot_id, {}), seconds, f"{robot_id}: {kind}")
        return listed()[robot_id][kind]

    try:
        for robot_id, change in (("healthy", {}), ("slow", {"limits": {**fleet.kind["limits"], "speed_m_s": 0.05}}), ("lost", {}), ("lossy", {}),
                                 ("empty", {"battery": {**fleet.kind["battery"], "reserve_fraction": 0.95}})):
            with open(fleet.file(robot_id, **change), encoding="utf-8") as file:
                programs.put(f"/v1/robots/{robot_id}", json.load(file))
        fleet.drive("healthy")
        fleet.drive("slow")
        fleet.drive("empty")
        lost = fleet.drive("lost")
        stranger = fleet.drive("stranger")
        lossy = fleet.drive("lossy", "--loss", "0.5")

        check("Check the robot's network" in wait_for("lossy", "contradicted")["action"], "what to do about lost samples")
        lossy.kill()
        lossy.wait()
        check(ask(programs.url, "DELETE", "/v1/robots/lossy?history=purge", None)[0] == 200, "a robot is removed")
        check("reserve of 95 %" in wait_for("empty", "charge_low")["message"], "the reserve in the message")
        check("robot file" in wait_for("stranger", "no_robot_file")["message"], "no robot file")
        check(wait_for("slow", "contradicted")["severity"] == "fault", "a speed above the file's limit is a fault")
        drift = wait_for("worn", "drift")
        ratio = programs.metric('joulecast_robot_energy_ratio{robot_id="worn"}')
        check(ratio > 0.9, f"the ratio of a robot is a metric from the start: {ratio}")
        check("2023-11-16" in drift["message"] and "more energy" in drift["message"], f"the drift: {drift}")
        known = ask(programs.url, "POST", "/v1/robots/worn/autonomy", {})[1]["drift"]
        logged, = (e["detail"] for e in programs.get("/v1/event-log?robot_id=worn&limit=1000")["events"] if e["kind"] == "gap_drift")
        check(logged["utime_us"] == known["start_utime_us"] and abs(logged["ratio_after"] - known["ratio_after"]) < 1e-8,
              f"one change, of one date and size, in the log and in the autonomy: {logged} {known}")
        check("coulomb friction" in wait_for("worn", "gap_diagnosed", 120)["message"], "the cause of the drift")

        wait_until(lambda: programs.get("/v1/robots/lost/state")["mission"], 60, "a mission of the robot that will be silenced")
        os.kill(lost.pid, signal.SIGKILL)
        silent = wait_for("lost", "silent", 15)
        check("during mission" in silent["message"] and silent["since_utime_us"] > 0, f"the silence: {silent}")
        check("healthy" not in listed() and None not in listed(), f"healthy robots are listed: {listed()}")
        answer = programs.get("/v1/attention")
        check([entry["robot_id"] for entry in answer["attention"]] == ["lost", "slow", "empty", "stranger", "worn"],
              f"the most urgent first: {answer}")
        check(answer["counts"] == {"fault": 2, "warning": 3, "notice": 0}, f"the counts: {answer['counts']}")

        def acknowledge(robot_id, kind):
            return ask(programs.url, "POST", f"/v1/robots/{robot_id}/acknowledge", {"kind": kind, "note": "being looked at"})

        def faults():
            return programs.metric('joulecast_attention{severity="fault"}')

        check(faults() == 2, "the metric counts the faults")
        check(acknowledge("lost", "silent")[1]["acknowledged"], "the only reason is acknowledged")
        acknowledge("empty", "charge_low")
        answer = programs.get("/v1/attention")
        check([entry["robot_id"] for entry in answer["attention"]] == ["slow", "stranger", "worn", "lost", "empty"],
              f"acknowledged ones come last: {answer}")
        check(answer["counts"] == {"fault": 1, "warning": 2, "notice": 0} and faults() == 1, "acknowledged ones are not counted")
        check(listed()["lost"]["silent"]["acknowledged"]["note"] == "being looked at", "the note")
        check(acknowledge("healthy", "silent")[0] == 404, "a robot without the reason")

        check(programs.stop() == 0, "the daemon ends")
        programs.start()
        wait_until(lambda: "silent" in listed().get("lost", {}), 30, "the silence is known after a restart")
        check(listed()["lost"]["silent"]["acknowledged"] is not None, "an acknowledgement survives a restart")
        check(listed()["lost"]["silent"]["since_utime_us"] == silent["since_utime_us"], "the beginning survives a restart")

        stranger.kill()
        wait_until(lambda: "stranger" not in listed(), 30, "a robot without a file leaves the list when it is silent")
        lost = fleet.drive("lost")
        wait_until(lambda: "silent" not in listed().get("lost", {}), 30, "a robot with telemetry again leaves the list")
        wait_until(lambda: programs.get("/v1/robots/lost/state")["mission"], 60, "another mission")
        os.kill(lost.pid, signal.SIGKILL)
        check(wait_for("lost", "silent", 15)["acknowledged"] is None, "an acknowledgement ends with its condition")
        with open(fleet.file("slow"), encoding="utf-8") as file:
            programs.put("/v1/robots/slow", json.load(file))
        wait_until(lambda: "slow" not in listed(), 60, "a contradiction that ended leaves the list")

        def kinds(robot_id):
            return [event["kind"] for event in programs.get(f"/v1/event-log?robot_id={robot_id}&limit=1000")["events"]
                    if event["kind"] in ("robot_silent", "robot_back", "charge_low", "contradiction", "contradiction_ended")]

        wait_until(lambda: "contradiction_ended" in kinds("slow"), 10, "the end of the contradiction in the log")
        check(kinds("lost") == ["robot_silent", "robot_back", "robot_silent"], f"silence in the log: {kinds('lost')}")
        check(kinds("empty") == ["charge_low"], f"low charge in the log, once over a restart: {kinds('empty')}")
        check(kinds("slow")[0] == "contradiction", f"contradiction in the log: {kinds('slow')}")
        check(kinds("healthy") == [], "nothing about the healthy robot")
    finally:
        fleet.end()
    check(programs.stop() == 0, "the daemon ends")


main()
