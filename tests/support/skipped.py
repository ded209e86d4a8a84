#!/usr/bin/env python3
"""Fails when a test was skipped for a reason that is not allowed.

skipped.py [--allow REASON]... REPORT...

Each REPORT is a file of `ctest --output-junit` or of `--gtest_output=xml`, each REASON a regular expression that the
output of a skipped test may match.
"""
import argparse
import re
import sys
import xml.etree.ElementTree as xml


def faults_of(report, reasons):
    faults = []
    for test in xml.parse(report).getroot().iter("testcase"):
        skipped = test.find("skipped")
        if skipped is None:
            continue
        # ctest stores the test's output next to the element, gtest the reason within it.
        output = test.findtext("system-out") or skipped.get("message", "")
        if not any(re.search(reason, output) for reason in reasons):
            faults.append(f"{test.get('classname')}.{test.get('name')} was skipped: {output.strip()[-200:]}")
    return faults


if __name__ == "__main__":
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--allow", action="append", default=[])
    arguments.add_argument("reports", nargs="+")
    given = arguments.parse_args()
    found = [fault for report in given.reports for fault in faults_of(report, given.allow)]
    print(*found, sep="\n", end="\n" if found else "")
    sys.exit(1 if found else 0)
