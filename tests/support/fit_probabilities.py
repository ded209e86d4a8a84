#!/usr/bin/env python3
"""Writes the table that maps posteriors of named effects to stated probabilities, the observed rates of such names.

usage: fit_probabilities.py OUTCOMES...         write src/gap/verdict/probabilities.{json,inc}
       fit_probabilities.py --check [OUTCOMES...]

OUTCOMES are files of `joulecast-study trial --outcomes FILE`: one line of JSON a case, of the trial on virtual robots
and of the one on recorded motion. A name is right when exactly this effect was planted. For each standing of an answer
(gap/verdict/diagnosis.h) names are counted in cells of their posterior (probabilities.json), cells are joined until
each bin has LEAST_NAMED names and the rate never falls (pool-adjacent-violators; Ayer and others 1955), then
to at most MOST_BINS. A bin states (right + 1)/(named + 2).

--check fails when the table does not match its counts, or when the probabilities stated for the names of a bin are
outside the bin's 95 % interval (Wilson 1927). With outcomes, the second check uses these.
"""
import argparse
import bisect
import datetime
import json
import math
import pathlib
import re
import subprocess
import sys

SOURCE = pathlib.Path(__file__).resolve().parents[2]
JSON = SOURCE / "src/gap/verdict/probabilities.json"
TABLE = SOURCE / "src/gap/verdict/probabilities.inc"
METHOD = ("src/dynamics/*", "src/dynamics/effects/*", "src/gap/traits.h", "src/gap/checks/*", "src/gap/equations/*",
          "src/gap/diagnose/*", "src/gap/verdict/judge*", "src/statistics/*", "src/windows/*")
STANDINGS = ("alone", "grouped", "inconclusive", "outside")
EDGES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.925, 0.95, 0.975, 0.99)
LEAST_NAMED, MOST_BINS = 25, 5
SURE_VERDICT = 0.95
NORMAL_95 = 1.959964


def wilson(right, named):
    if named == 0:
        return 0.0, 1.0
    p, z2 = right / named, NORMAL_95**2
    middle = (p + z2 / (2 * named)) / (1 + z2 / named)
    half = NORMAL_95 * math.sqrt(p * (1 - p) / named + z2 / (4 * named**2)) / (1 + z2 / named)
    return max(0.0, middle - half), min(1.0, middle + half)


def stated(cell):
    return (cell["right"] + 1) / (cell["named"] + 2)


def join(a, b):
    named = a["named"] + b["named"]
    return {"named": named, "right": a["right"] + b["right"],
            "posterior": (a["named"] * a["posterior"] + b["named"] * b["posterior"]) / named}


def fit(cells):
    """Bins, ascending in posterior and in probability, of cells ascending in posterior."""
    bins = []
    for cell in cells:
        bins.append(cell)
        while len(bins) > 1 and (bins[-2]["named"] < LEAST_NAMED or stated(bins[-2]) >= stated(bins[-1])):
            bins[-2:] = [join(*bins[-2:])]
    while len(bins) > 1 and bins[-1]["named"] < LEAST_NAMED:
        bins[-2:] = [join(*bins[-2:])]
        while len(bins) > 1 and stated(bins[-2]) >= stated(bins[-1]):
            bins[-2:] = [join(*bins[-2:])]
    while len(bins) > MOST_BINS:
        k = min(range(len(bins) - 1), key=lambda k: stated(bins[k + 1]) - stated(bins[k]))
        bins[k:k + 2] = [join(*bins[k:k + 2])]
    return bins or [{"named": 0, "right": 0, "posterior": 1.0}]


def joined_by_posterior(cells, standing):
    """The cells of one standing, of all trials, ascending."""
    by_edge = {}
    for cell in cells:
        if cell["standing"] == standing:
            by_edge[cell["from"]] = join(by_edge[cell["from"]], cell) if cell["from"] in by_edge else cell
    return [by_edge[edge] for edge in sorted(by_edge)]


def count(paths):
    """Cells by standing, trial and posterior; sure verdicts; cases by trial. The last line of a case counts."""
    outcomes = {}
    for path in paths:
        for line in pathlib.Path(path).read_text(encoding="utf-8").splitlines():
            outcome = json.loads(line)
            outcomes[outcome["trial"], outcome["digest"]] = outcome
    cells, cases, sure = {}, {}, {"named": 0, "right": 0}
    # "inconclusive" makes no claim. The program that wrote the outcomes limits its verdicts to the surest of its own
    # table.
    claims = [o for o in outcomes.values() if o["verdict"] in ("none", "effects", "outside")]
    surest = min(SURE_VERDICT, max([o["verdict_probability"] for o in claims], default=SURE_VERDICT))
    for outcome in claims:
        if outcome["verdict_probability"] >= surest:
            sure["named"] += 1
            sure["right"] += outcome["right"]
    for outcome in outcomes.values():
        trial = outcome["trial"]
        cases[trial] = cases.get(trial, 0) + 1
        for name in outcome["effects"]:
            k = bisect.bisect_right(EDGES, name["posterior"])
            lower = EDGES[k - 1] if k else 0.0
            cell = {"standing": name["standing"], "trial": trial, "from": lower, "named": 1,
                    "right": int(name["there"]), "posterior": name["posterior"]}
            key = name["standing"], trial, lower
            cells[key] = {**cell, **join(cells[key], cell)} if key in cells else cell
    for cell in cells.values():
        cell["posterior"] = round(cell["posterior"], 5)
    return [cells[key] for key in sorted(cells)], sure, cases


def table_text(document):
    lines = ["// Written by tests/support/fit_probabilities.py from the counts in probabilities.json; not to be edited.",
             f"// {document['date']}, commit {document['commit']}, cases: "
             + ", ".join(f"{n} {trial}" for trial, n in sorted(document["cases"].items())),
             "inline constexpr auto probability_table = std::to_array<ProbabilityBin>({"]
    for standing in STANDINGS:
        for b in fit(joined_by_posterior(document["cells"], standing)):
            low, high = wilson(b["right"], b["named"])
            lines.append(f"    {{Standing::{standing}, {b['posterior']:.4f}, {stated(b):.4f}, {b['named']}, {b['right']}}},"
                         f"  // [{low:.2f}, {high:.2f}]")
    low, high = wilson(document["sure_verdicts"]["right"], document["sure_verdicts"]["named"])
    sure = document["sure_verdicts"]
    lines += ["});",
              f"inline constexpr double surest_verdict = {stated(sure):.4f};"
              f"  // {sure['right']} of {sure['named']} were right [{low:.2f}, {high:.2f}]"]
    return "\n".join(lines) + "\n"


def stated_probability(bins, posterior):
    """As gap/verdict/probability.cc."""
    below = {"posterior": 0.0, "probability": 0.0}
    for b in bins:
        if posterior <= b["posterior"]:
            width = b["posterior"] - below["posterior"]
            part = (posterior - below["posterior"]) / width if width > 0 else 1.0
            return below["probability"] + part * (b["probability"] - below["probability"])
        below = b
    return below["probability"]


def read_table(text):
    bins = {standing: [] for standing in STANDINGS}
    for standing, *numbers in re.findall(r"Standing::(\w+), ([\d.]+), ([\d.]+), (\d+), (\d+)", text):
        posterior, probability = map(float, numbers[:2])
        bins[standing].append({"posterior": posterior, "probability": probability})
    return bins


def unreliable(bins, cells):
    """A sentence for each bin with a stated probability outside the interval of the observed rate. A name belongs to
    the bin with the nearest posterior."""
    sentences = []
    for standing in STANDINGS:
        of_bin = [{"named": 0, "right": 0, "stated": 0.0} for _ in bins[standing]]
        for cell in cells:
            if cell["standing"] != standing:
                continue
            nearest = min(range(len(of_bin)), key=lambda k: abs(bins[standing][k]["posterior"] - cell["posterior"]))
            of_bin[nearest]["named"] += cell["named"]
            of_bin[nearest]["right"] += cell["right"]
            of_bin[nearest]["stated"] += cell["named"] * stated_probability(bins[standing], cell["posterior"])
        for b, own in zip(bins[standing], of_bin):
            if own["named"] == 0:
                continue
            low, high = wilson(own["right"], own["named"])
            mean = own["stated"] / own["named"]
            what = (f"{standing} near {b['posterior']:.3f}: states {mean:.3f}, {own['right']} of {own['named']} came true "
                    f"[{low:.3f}, {high:.3f}]")
            print(what)
            if not low <= mean <= high:
                sentences.append(what)
    return sentences


def git(*arguments):
    return subprocess.run(("git", "-C", SOURCE, *arguments), capture_output=True, text=True, check=True).stdout.strip()


def write(paths):
    cells, sure, cases = count(paths)
    if not cells:
        sys.exit("no names in these outcomes")
    changed = git("status", "--porcelain", "--", *METHOD[:1], *(p.rsplit("/", 1)[0] for p in METHOD[1:]))
    document = {"date": datetime.date.today().isoformat(),
                "commit": git("rev-parse", "--short=12", "HEAD") + (" with changes" if changed else ""),
                "cases": cases, "sure_verdicts": sure, "cells": cells}
    JSON.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    TABLE.write_text(table_text(document), encoding="utf-8")
    print(TABLE.read_text(encoding="utf-8"), end="")
    for trial in sorted(cases):
        print(f"\nthe trial {trial} alone")
        unreliable(read_table(TABLE.read_text(encoding="utf-8")), [c for c in cells if c["trial"] == trial])


def check(paths):
    if not JSON.exists():
        return ["src/gap/verdict/probabilities.json is missing: the table has no counts"]
    document = json.loads(JSON.read_text(encoding="utf-8"))
    table = TABLE.read_text(encoding="utf-8")
    wrong = []
    if table != table_text(document):
        wrong.append("the table does not match its counts: run fit_probabilities.py")
    return wrong + unreliable(read_table(table), count(paths)[0] if paths else document["cells"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("outcomes", nargs="*")
    options = parser.parse_args()
    if options.check:
        wrong = check(options.outcomes)
        sys.exit("\n".join(wrong) if wrong else 0)
    if not options.outcomes:
        parser.error("OUTCOMES is missing")
    write(options.outcomes)


if __name__ == "__main__":
    main()
