#!/usr/bin/env python3
"""Diagnoses of public recordings, as run by a user. The printed intervals justify the checks."""
import json
import os
import re
import subprocess

from harness import Programs, arguments, check, shared_folder, skip


def page(path):
    """A report without external resources and without paths of this machine."""
    with open(path, encoding="utf-8") as file:
        text = file.read()
    check(text.startswith("<!doctype html>") and text.rstrip().endswith("</html>"), f"{path} is a whole page")
    for foreign in ("<link", " src=", "@import", os.path.dirname(path)):
        check(foreign not in text, f"{path} holds {foreign}")
    check(not re.search(r"url\((?!#)", text), f"{path} holds an address")
    data = text.split('<script type="application/json" id="data">')[1].split("</script>")[0]
    return json.loads(data, parse_constant=lambda number: check(False, f"{path} holds {number}"))["result"]


def husky(programs, options):
    """Flooring compared with ice: the resistance to turning changes with the floor by more than its interval."""
    folder = shared_folder(options, "real", "borealtc_husky")
    logs = []
    for day, ground in enumerate(("FLOORING", "ICE"), start=1):
        tables = sorted((folder / ground).glob("pro_*.csv"))
        check(tables, f"no tables of {ground}")
        logs.append(programs.path(ground + ".lcmlog"))
        programs.run("import", *tables, "--mapping", f"{options.source}/deploy/import/borealtc_husky.json",
                     "--start", f"2024-01-0{day}T10:00:00Z", "--out", logs[-1])
    report = programs.path("husky.html")
    answer = json.loads(programs.run("gap", *logs, "--robot", f"{options.source}/deploy/robots/borealtc-husky.json",
                                     "--compare-by", "prefix", "--json", "--report", report))
    check("turning_scrub" in [s["id"] for s in page(report)["strengths"]], "the report names what changes")
    check(answer["motor_channels"] and answer["power"] == "motors", "power is that of the currents in the windings")
    first = answer["effects"][0]
    check(first["id"] == "turning_scrub", f"the largest change is {first['id']}")
    difference, sd = (first["parameters"]["coefficient"][key] for key in ("value", "sd"))
    print(f"turning_scrub on flooring above that on ice by {difference:.2f} +- {sd:.2f}")
    # Estimate from the motors' currents in steady turns, without a fit: 0.5 to 0.9 of the weight on the floor.
    check(difference > 2 * sd and difference < 1, "scrub on flooring is above that on ice")
    compared = {e["id"]: e["groups"] for e in answer["strengths"]}["turning_scrub"]
    check(compared["FLOORING"]["value"] > compared["ICE"]["value"], "the strengths by group agree")


def warthog(programs, options):
    """Turning is the largest loss and nearly absent from the file: it is named first, no name is confident, and held-out parts
    are predicted as well as by a regression without a robot model."""
    folder = shared_folder(options, "real", "warthog_grass")
    log, report = programs.path("warthog.lcmlog"), programs.path("warthog.html")
    programs.run("import", *sorted(folder.glob("*.csv")), "--mapping",
                 f"{options.source}/deploy/import/warthog_grass.json", "--out", log)
    answer = json.loads(programs.run("gap", log, "--robot", f"{options.source}/deploy/robots/warthog-grass.json",
                                     "--json", "--report", report))
    print("warthog:", answer["verdict"], [e["id"] for e in answer["effects"]], "gap", answer["gap"])
    page(report)
    check(answer["verdict"] == "not_this_robot", f"warthog: the file is not this robot's, not {answer['verdict']}")
    check(answer["effects"][0]["id"] == "turning_scrub", f"warthog: {answer['effects'][0]['id']} comes first")
    check(all(e["probability"] < 0.9 for e in answer["effects"]), "no name may be sure")
    baseline = answer["baseline"]
    ratio = baseline["explanation_held_out"] / baseline["held_out"]
    print(f"held-out error over the regression's: {ratio:.2f}")
    check(ratio < 1.15 or baseline["wins"], f"warthog: the error is {ratio:.2f} times the regression's, unreported")
    check(baseline["explanation_held_out"] < 0.3 * baseline["unchanged_model_held_out"], "the gap shrinks")


def halves(programs, options):
    """A file corrected from one half of the Warthog's drive predicts the other half as well as a regression on the first, or
    it is rejected."""
    table = next(shared_folder(options, "real", "warthog_grass").glob("*.csv"))
    head, *rows = table.read_text(encoding="utf-8").splitlines(keepends=True)
    logs = {}
    for half, part in (("early", rows[:len(rows) // 2]), ("late", rows[len(rows) // 2:])):
        csv, logs[half] = programs.path(half + ".csv"), programs.path(half + ".lcmlog")
        with open(csv, "w", encoding="utf-8") as file:
            file.writelines([head, *part])
        programs.run("import", csv, "--mapping", f"{options.source}/deploy/import/warthog_grass.json", "--out", logs[half])
    for learnt, other in (("early", "late"), ("late", "early")):
        corrected = programs.path(f"corrected-{learnt}.json")
        done = subprocess.run([options.client, "gap", logs[learnt], "--robot", f"{options.source}/deploy/robots/warthog-grass.json",
                               "--json", "--test", logs[other], "--apply", corrected],
                              capture_output=True, text=True)
        answer = json.loads(done.stdout)
        comparison = answer["back_test"]["beside_regression"]
        written = os.path.exists(corrected)
        print(f"{learnt} half: {comparison}, {'written' if written else 'refused'}")
        check(comparison["windows"] > 40, "the other half was compared")
        worse = comparison["corrected_missed"] - comparison["regression_missed"] > comparison["lead_sd"]
        check(worse == comparison["regression_wins"], "the better predictor is reported")
        check(not (written and worse), f"written though the regression predicts better: {comparison}")
        check(written or "--apply: " in done.stderr, f"refused without a reason: {done.stderr}")


def gears(programs, options):
    """The competition robot: named effects are evaluated on held-out runs, with the motors' power."""
    folder = shared_folder(options, "real", "frc3314_drivetrain")
    for gear in ("low", "high"):
        log, robot = programs.path(gear + ".lcmlog"), programs.path(f"fitted-{gear}.json")
        programs.run("import", *sorted(folder.glob(f"*_{gear}.csv")), "--mapping",
                     f"{options.source}/deploy/import/frc3314_{gear}.json", "--start", "2019-02-16T10:00:00Z",
                     "--out", log)
        programs.run("calibrate", "drive", log, "--method", "whole", "--robot",
                     f"{options.source}/deploy/robots/frc3314-{gear}.json", "--out", robot)
        report = programs.path(gear + ".html")
        answer = json.loads(programs.run("gap", log, "--robot", robot, "--json", "--report", report))
        page(report)
        print(f"{gear} gear, fitted:", answer["verdict"], [(e["id"], e["parameters"]) for e in answer["effects"]],
              "outside", answer["outside"], "shrinkage", answer["shrinkage"])
        check(answer["power"] == "motors", f"{gear}: power is {answer['power']}")
        check(answer["gap"]["power_absolute_relative"] > 0.05, f"{gear}: the fitted model still has a gap")
        check(answer["verdict"] != "none", f"{gear}: the verdict is none although there is a gap")


def main():
    options = arguments()
    if not os.path.isdir(options.shared):
        skip("no shared folder next to the project")
    programs = Programs(options)
    husky(programs, options)
    warthog(programs, options)
    halves(programs, options)
    gears(programs, options)


main()
