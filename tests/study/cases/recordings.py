"""Prepares the recordings that the kept cases use and prints one line of a cases file for each recorded case.

recordings.py JOULECAST DATA FOLDER > recorded.jsonl

JOULECAST is the program that imports tables. DATA contains `practice` (logs with truths), `real_cases` (tables with
mappings, robot files and truths) and `real` (tables of the shipped mappings). FOLDER receives

    motion/NAME.lcmlog, NAME.json       the motion that effects are planted into
    practice/NAME, real/NAME, halves/NAME    telemetry.lcmlog and robot.json of each recorded case
"""

import csv
import gzip
import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[3]
MAPPINGS, ROBOTS = PROJECT / "deploy/import", PROJECT / "deploy/robots"
# Without a slope or a pitch, each in one variant only: effects are planted into the motion of these cases.
MOTION = {
    "bmw_i3": "none",
    "ecomarathon": "none",
    "fomo": "cut",
    "motives_dyno": "nodrag",
    "motives_road": "none",
    "tb3_logs": "logs",
    "warthog": "pose",
}
CAR = "real_cases/motives_road/robot.json"
# name: (tables below `real`, shipped mapping, robot file)
HALVES = {
    "warthog": ("warthog_grass/*.csv", "warthog_grass", ROBOTS / "warthog-grass.json"),
    "tesla": ("evpino_tesla3/*.csv.gz", "evpino_tesla3", CAR),
    "motives_lab": ("motives_bev/lab/*.csv.gz", "motives_lab", CAR),
    "motives_road": ("motives_bev/road/*.csv.gz", "motives_road", CAR),
    "frc_high": ("frc3314_drivetrain/*_high.csv", "frc3314_high", ROBOTS / "frc3314-high.json"),
    "frc_low": ("frc3314_drivetrain/*_low.csv", "frc3314_low", ROBOTS / "frc3314-low.json"),
    **{
        f"husky_{floor.lower()}": (f"borealtc_husky/{floor}/*.csv", "borealtc_husky", ROBOTS / "borealtc-husky.json")
        for floor in ("ASPHALT", "FLOORING", "ICE", "SANDY_LOAM", "SNOW")
    },
}


def rows_of(path):
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rt", newline="") as table:
        return list(csv.reader(table))


def named_columns(mapping, header):
    """The columns that a mapping names."""
    named = set(re.findall(r'"((?:[^"\\]|\\.)*)"', json.dumps(mapping)))
    return [k for k, name in enumerate(header) if name in named]


def bring(joulecast, tables, mapping, out):
    """Imports tables of (name, rows with a header) by a mapping."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "tables"  # mission ids may contain the folder's name
        folder.mkdir()
        paths = []
        for name, rows in tables:
            paths.append(folder / f"{name}.csv")
            with open(paths[-1], "w", newline="") as table:
                csv.writer(table, lineterminator="\n").writerows(rows)
        file = folder / "mapping.json"
        file.write_text(json.dumps(mapping))
        command = [joulecast, "import", *paths, "--mapping", file, "--out", out]
        subprocess.run(
            [*command, "--start", "2026-03-01T08:00:00Z", "--pause", "60"], check=True, stdout=subprocess.DEVNULL
        )


def pieces(name, rows, column, length_s):
    """Pieces of a mission; an end shorter than half of one is part of the last."""
    start = float(rows[0][column])
    numbers = [int((float(row[column]) - start) // length_s) for row in rows]
    if numbers[-1] > 0 and float(rows[-1][column]) - start - numbers[-1] * length_s < length_s / 2:
        numbers = [min(n, numbers[-1] - 1) for n in numbers]
    cut = {}
    for number, row in zip(numbers, rows):
        cut.setdefault(number, []).append(row)
    return [(f"{name}-{number:04d}", part) for number, part in cut.items() if len(part) > 2]


def expectations(given):
    """[{"id", "from", "to"}] of the effects of a truth; the range is that of its first parameter."""
    ranges = {effect: next(iter(limits.values()), [None, None]) for effect, limits in given.items()}
    return [{"id": effect, "from": low, "to": high} for effect, (low, high) in ranges.items()]


def real_case(joulecast, case, variant, out):
    """The log of one variant's part for fitting and its truth."""
    header, *rows = rows_of(case / "data.csv.gz")
    mapping = json.loads((case / f"{variant['mapping']}.json").read_text())
    missions = {}
    for row in rows:
        if row[1] == "fit" or variant.get("join"):
            missions.setdefault(row[0], []).append(row[2:])
    header = header[2:]
    clock = header.index(mapping["time"]["column"])
    if variant.get("join"):
        missions = {"whole": [row for part in missions.values() for row in part]}
    tables = list(missions.items())
    if "cut_s" in variant:
        tables = [piece for name, part in tables for piece in pieces(name, part, clock, variant["cut_s"])]
    keep = named_columns(mapping, header)
    tables = [(name, [[row[k] for k in keep] for row in [header, *part]]) for name, part in tables]
    if isinstance(mapping.get("covariates"), list):
        mapping["covariates"] = {c["name"]: {"column": c["column"]} for c in mapping["covariates"]}
    out.mkdir(parents=True)
    bring(joulecast, tables, mapping, out / "telemetry.lcmlog")
    shutil.copy(case / "robot.json", out / "robot.json")
    truth = {"right": expectations(variant["right"]), "neutral": expectations(variant["neutral"])}
    for ours, theirs in (("outside", "right_outside"), ("refuted", "refuted_outside"), ("corrections", "right_checks")):
        if variant.get(theirs, "$^") != "$^":
            truth[ours] = variant[theirs]
    return truth


def main():
    joulecast, data, folder = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])

    def show(group, name, truth):
        line = {"case": f"{group}/{name}", "group": group, "channels": "recorded", "recording": f"{group}/{name}"}
        print(json.dumps({**line, "truth": truth}))

    for log in sorted((data / "practice").glob("*/telemetry.lcmlog")):
        out = folder / "practice" / log.parent.name
        out.mkdir(parents=True)
        shutil.copy(log, out)
        shutil.copy(log.with_name("robot.json"), out)
        truth = json.loads(log.with_name("truth.json").read_text())
        effects = [{"id": id_, "strength": strength} for id_, strength in truth["effects"].items()]
        outside = any(id_.startswith("x_") for id_ in truth["effects"])
        kind = "outside" if outside else ("none", "single", "pair")[len(effects)]
        show("practice", log.parent.name, {"kind": kind, "effects": effects, "gap": truth["gap_abs_rel"]})

    (folder / "motion").mkdir()
    for file in sorted((data / "real_cases").glob("*/truth.json")):
        case = file.parent
        for variant in json.loads(file.read_text())["variants"]:
            if variant.get("kind", "gap") != "gap":
                continue
            name = f"{case.name}_{variant['id']}"
            show("real", name, real_case(joulecast, case, variant, folder / "real" / name))
            if MOTION.get(case.name) == variant["id"]:
                shutil.copy(folder / "real" / name / "telemetry.lcmlog", folder / "motion" / f"{case.name}.lcmlog")
                shutil.copy(case / "robot.json", folder / "motion" / f"{case.name}.json")

    for name, (pattern, mapping, robot) in HALVES.items():
        tables = [(path.name.split(".")[0], rows_of(path)) for path in sorted((data / "real").glob(pattern))]
        if len(tables) == 1:  # one drive is cut in its middle, of several every second is in a half
            stem, (header, *rows) = tables[0]
            middle = len(rows) // 2
            tables = [(f"{stem}_1", [header, *rows[:middle]]), (f"{stem}_2", [header, *rows[middle:]])]
        rule = json.loads((MAPPINGS / f"{mapping}.json").read_text())
        if name in ("tesla", "husky_flooring", "husky_snow"):
            powered = json.loads(json.dumps(rule))
            if "battery_current" not in rule["fields"]:  # the motors' currents at the nominal voltage
                powered["fields"].pop("motor_current")
                powered["fields"]["battery_voltage"] = {"constant": 24}
                powered["fields"]["battery_current"] = {"columns": ["curL", "curR"], "combine": "sum"}
            bring(joulecast, tables, powered, folder / "motion" / f"{name}.lcmlog")
            shutil.copy(data / robot, folder / "motion" / f"{name}.json")
        for half, part in (("a", tables[0::2]), ("b", tables[1::2])):
            out = folder / "halves" / f"{name}_{half}"
            out.mkdir(parents=True)
            bring(joulecast, part, rule, out / "telemetry.lcmlog")
            shutil.copy(data / robot, out / "robot.json")
            show("halves", f"{name}_{half}", {"other": f"halves/{name}_{'b' if half == 'a' else 'a'}"})


if __name__ == "__main__":
    main()
