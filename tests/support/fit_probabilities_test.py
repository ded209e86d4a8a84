#!/usr/bin/env python3
"""Tests fit_probabilities.py against results computed by hand."""
import json
import pathlib
import tempfile
import unittest

import fit_probabilities as fp


def cell(posterior, right, named, standing="alone", trial="virtual"):
    return {"standing": standing, "trial": trial, "from": posterior, "posterior": posterior, "right": right, "named": named}


class Fit(unittest.TestCase):
    def test_keeps_rising_rates(self):
        bins = fp.fit([cell(0.5, 15, 30), cell(0.9, 27, 30)])
        self.assertEqual([fp.stated(b) for b in bins], [16 / 32, 28 / 32])

    def test_violators_are_pooled(self):
        # By hand: (8, 40) stays; 30/40 and 20/40 fall and become 50/80 at the mean of their posteriors.
        bins = fp.fit([cell(0.4, 8, 40), cell(0.6, 30, 40), cell(0.8, 20, 40)])
        self.assertEqual([(b["right"], b["named"]) for b in bins], [(8, 40), (50, 80)])
        self.assertAlmostEqual(bins[1]["posterior"], 0.7)

    def test_pooling_is_transitive(self):
        # 24/40 then 30/40 rise; 0/40 pools with 30/40 to 30/80, which is below 24/40: all become one.
        bins = fp.fit([cell(0.4, 24, 40), cell(0.6, 30, 40), cell(0.8, 0, 40)])
        self.assertEqual([(b["right"], b["named"]) for b in bins], [(54, 120)])

    def test_few_names_join_a_neighbour(self):
        bins = fp.fit([cell(0.3, 0, 5), cell(0.6, 20, 40), cell(0.95, 3, 3)])
        self.assertEqual([(b["right"], b["named"]) for b in bins], [(23, 48)])

    def test_bins_are_few_and_rise(self):
        bins = fp.fit([cell(k / 20, 2 * k, 40) for k in range(1, 20)])
        self.assertEqual(len(bins), fp.MOST_BINS)
        rates = [fp.stated(b) for b in bins]
        self.assertEqual(rates, sorted(rates))
        self.assertEqual(sum(b["named"] for b in bins), 19 * 40)

    def test_empty_input_is_even(self):
        self.assertEqual([fp.stated(b) for b in fp.fit([])], [0.5])


class Reliability(unittest.TestCase):
    bins = {s: [] for s in fp.STANDINGS} | {"alone": [{"posterior": 0.9, "probability": 0.8}]}

    def test_wilson(self):
        # Brown, Cai and DasGupta 2001, equation (4), by hand.
        low, high = fp.wilson(8, 10)
        self.assertAlmostEqual(low, 0.49016, 5)
        self.assertAlmostEqual(high, 0.94332, 5)

    def test_reports_unreliable_bins(self):
        self.assertEqual(fp.unreliable(self.bins, [cell(0.9, 80, 100)]), [])
        self.assertEqual(len(fp.unreliable(self.bins, [cell(0.9, 50, 100)])), 1)

    def test_interpolates_between_bins(self):
        bins = [{"posterior": 0.5, "probability": 0.4}, {"posterior": 0.9, "probability": 0.8}]
        for posterior, probability in ((0.25, 0.2), (0.5, 0.4), (0.7, 0.6), (0.9, 0.8), (1.0, 0.8)):
            self.assertAlmostEqual(fp.stated_probability(bins, posterior), probability)


class Files(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.root = pathlib.Path(self.folder.name)
        self.addCleanup(self.folder.cleanup)

    def test_counts_last_line_of_case(self):
        name = {"standing": "grouped", "posterior": 0.97, "there": True}
        case = {"trial": "motion", "digest": "1", "verdict": "effects", "verdict_probability": 0.96, "right": True, "effects": [name]}
        lines = [case | {"effects": []}, case, case | {"digest": "2", "effects": [name | {"there": False}], "right": False},
                 case | {"digest": "3", "verdict": "inconclusive", "effects": []}]
        path = self.root / "outcomes"
        path.write_text("\n".join(json.dumps(line) for line in lines))
        cells, sure, cases = fp.count([path])
        self.assertEqual([(c["standing"], c["from"], c["named"], c["right"]) for c in cells], [("grouped", 0.95, 2, 1)])
        self.assertEqual(sure, {"named": 2, "right": 1})
        self.assertEqual(cases, {"motion": 3})

    def test_table_reads_back(self):
        document = {"date": "2000-01-01", "commit": "0", "cases": {"motion": 9}, "sure_verdicts": {"right": 8, "named": 8},
                    "cells": [cell(0.5, 15, 30), cell(0.9, 27, 30)]}
        text = fp.table_text(document)
        bins = fp.read_table(text)
        self.assertEqual(bins["alone"], [{"posterior": 0.5, "probability": 0.5}, {"posterior": 0.9, "probability": 0.875}])
        self.assertEqual(len(bins["outside"]), 1)
        self.assertIn("surest_verdict = 0.9000;", text)


if __name__ == "__main__":
    unittest.main()
