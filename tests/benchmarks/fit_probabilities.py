#!/usr/bin/env python3
"""Refits src/gap/calibration.cc: how far the odds of named effects have to move for the stated probabilities to come true.

usage: fit_probabilities.py TRIAL.json...   (each from `joulecast gap trial --json` with a seed below 1000)

By standing of the answer (alone, with others that the data cannot tell from it, in an inconclusive answer, beside
something outside), log odds = slope * log odds before + shift: maximum a posteriori with normal priors about leaving them
as they are (slope 1 +- 0.3, shift 0 +- 1.5), so that few cases move little. An effect counts as right when its own id is
in the truth.
"""
import json
import math
import sys

STANDINGS = ("alone", "grouped", "inconclusive", "outside")


def standing(case, effect):
    if case["verdict"] in ("inconclusive", "outside"):
        return case["verdict"]
    return "grouped" if effect["alternatives"] else "alone"


def logit(p):
    p = min(max(p, 0.01), 0.99)
    return math.log(p / (1 - p))


def fit(points):
    """slope and shift of points (log odds before, right) by Newton's method."""
    slope, shift = 1.0, 0.0
    for _ in range(50):
        ga, gb = (1 - slope) / 0.3**2, -shift / 1.5**2
        haa, hab, hbb = 1 / 0.3**2, 0.0, 1 / 1.5**2
        for x, right in points:
            p = 1 / (1 + math.exp(-slope * x - shift))
            ga += (right - p) * x
            gb += right - p
            w = p * (1 - p)
            haa, hab, hbb = haa + w * x * x, hab + w * x, hbb + w
        determinant = haa * hbb - hab * hab
        slope += (hbb * ga - hab * gb) / determinant
        shift += (haa * gb - hab * ga) / determinant
    return slope, shift


def main():
    points = {name: [] for name in STANDINGS}
    for path in sys.argv[1:]:
        with open(path) as file:
            for case in json.load(file)["cases"]:
                truth = {effect["id"] for effect in case["truth"]}
                for effect in case["effects"]:
                    before = effect.get("posterior", effect["probability"])
                    points[standing(case, effect)].append((logit(before), effect["id"] in truth))
    for name in STANDINGS:
        cases = points[name]
        slope, shift = fit(cases)
        right = sum(r for _, r in cases)
        stated = sum(1 / (1 + math.exp(-x)) for x, _ in cases)
        moved = sum(1 / (1 + math.exp(-slope * x - shift)) for x, _ in cases)
        print(f"{name:<13} {{{slope:.2f}, {shift:+.2f}}}   {len(cases)} named, {right} right; stated {stated:.1f} before, {moved:.1f} after")


main()
