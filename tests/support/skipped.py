#!/usr/bin/env python3
"""Fails when a test was skipped for another reason than those that are allowed.

skipped.py REPORT [REASON...]

REPORT is what `ctest --output-junit` wrote, each REASON a regular expression that the output of a skipped test may match.
"""
import re
import sys
import xml.etree.ElementTree as xml


def faults_of(report, reasons):
    faults = []
    for test in xml.parse(report).getroot().iter("testcase"):
        if test.find("skipped") is None:
            continue
        output = test.findtext("system-out", "")
        if not any(re.search(reason, output) for reason in reasons):
            faults.append(f"{test.get('name')} was skipped: {output.strip()[-200:]}")
    return faults


if __name__ == "__main__":
    found = faults_of(sys.argv[1], sys.argv[2:])
    for fault in found:
        print(fault)
    sys.exit(1 if found else 0)
