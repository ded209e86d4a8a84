#!/usr/bin/env python3
"""The trial on recorded motion, on public recordings as imported by a user: cars on a dynamometer and on the road, a robot
with currents held for a second, one on six grounds. It verifies that every log is suitable, that each robot file has the
base power from which it was made, that cases are the same for any number of jobs and when evaluated again, and that no
confident name is wrong."""
import json
import pathlib

from harness import Programs, arguments, check
from recorded_motion import Importer, import_all


def check_logs(answer):
    check(len(answer["logs"]) == 18 and not answer["left_out"], f"18 logs are suitable, left out: {answer['left_out']}")
    for log in answer["logs"]:
        print(f"{log['name']:<36} every {log['period_s']:.3f} s, residual {log['residual']:.3f}, mismatch {log['mismatch']:.4f}")
        check(log["mismatch"] < 0.01, f"{log['name']}: the power of the robot file differs by {log['mismatch']:.1%} from its base power")
        check(log["residual"] < 0.6, f"{log['name']}: the regression leaves {log['residual']:.0%}")
    periods = {log["name"]: log["period_s"] for log in answer["logs"]}
    check(0.95 < periods["warthog"] < 1.05, f"currents held for a second are refreshed every {periods['warthog']} s")
    check(0.19 < periods["trip075"] < 0.21, f"currents rounded to 0.1 A are refreshed every {periods['trip075']} s")


def main():
    options = arguments()
    programs = Programs(options)
    importer = Importer(programs, options)
    import_all(importer, options)
    kept = programs.path("kept")
    options.client = pathlib.Path(options.client).with_name("joulecast-study")
    trial = ("trial", "--seed", 2000, "--json")
    answer = json.loads(programs.run(*trial, "--motion", importer.folder, "--count", 20, "--jobs", 2, "--keep", kept))
    check_logs(answer)
    alone = json.loads(programs.run(*trial, "--motion", importer.folder, "--count", 6))
    check(alone["cases"] == answer["cases"][:6], "cases depend on the number of jobs or of cases")
    again = json.loads(programs.run(*trial, "--again", kept, "--count", 6))
    check(again["cases"] == answer["cases"][:6], "kept cases have another result")

    kinds = [case["kind"] for case in answer["cases"]]
    check({kind: kinds.count(kind) for kind in kinds} == {"single": 9, "pair": 4, "none": 4, "outside": 3}, f"{kinds}")
    for case in answer["cases"]:
        check("refused" not in case, f"case {case['case']} is rejected: {case.get('refused')}")
        if case["kind"] == "single" and case["gap_class"] == 0.2:
            check(case["unchanged_error"] > case["referee_error"],
                  f"case {case['case']}: with a gap of 20 % the robot file is as good as a regression")
    misled = answer["score"]["misled"]
    print("named at 0.9 and not planted:", misled, "nothing planted, named:", answer["score"]["none_named"])
    check(misled["hits"] <= 1, f"{misled['hits']} of 20 cases have a confident wrong name")
    check(answer["score"]["misled_by_kind"]["none"]["hits"] == 0, "a confident name where nothing was planted")


main()
