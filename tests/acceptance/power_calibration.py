#!/usr/bin/env python3
"""Calibration from battery power alone on public recordings: cars on a dynamometer and on the road, a robot with currents held
for a second, one on six grounds with a power of 24 V times its motors' currents. Each half of a recording predicts the other
about as well as a linear regression of power on speed, turning and acceleration, or the command reports that it does not."""
import json
import os

from harness import Programs, arguments, check
from recorded_motion import Importer, import_all


def main():
    options = arguments()
    programs = Programs(options)
    importer = Importer(programs, options)
    import_all(importer, options)
    better = worse = 0
    for log in sorted(name for name in os.listdir(importer.folder) if name.endswith(".lcmlog")):
        path = os.path.join(importer.folder, log)
        robot = path.removesuffix("lcmlog") + "json"
        answer = json.loads(programs.run("calibrate", "drive", path, "--robot", robot, "--json"))
        half = answer["other_half"]
        calibrated, plain = half["calibrated_error"], half["regression_error"]
        print(f"{log:<36} file {half['file_error']:.3f} calibrated {calibrated:.3f} regression {plain:.3f}")
        check(answer["method"] == "power", f"{log}: method {answer['method']}")
        names = " ".join(entry["parameter"] for entry in answer["untold"])
        check("torque_constant_nm_a" in names and "gear efficiency" in names, f"{log}: unidentifiable parameters are {names}")
        check(calibrated < half["file_error"], f"{log}: the calibrated robot predicts worse than its file")
        better += calibrated <= 1.05 * plain
        worse += calibrated > 1.4 * plain
    print(f"as good as the regression: {better}, much worse: {worse}")
    check(better >= 15, f"only {better} of 18 recordings are predicted as well as by a linear regression")
    check(worse == 0, f"{worse} of 18 recordings are predicted much worse than by a linear regression")


main()
