#!/usr/bin/env python3
"""Instructions per straight solve, from the difference between two runs of valgrind's callgrind.

  solve_instructions.py PLANNER_COST
"""
import re
import subprocess
import sys


def instructions(program, kind, count):
    run = subprocess.run(["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", program, kind, str(count)],
                         capture_output=True, text=True, check=True)
    return int(re.search(r"Collected : (\d+)", run.stderr).group(1))


for kind in ("--straight", "--limited"):
    few, many = (instructions(sys.argv[1], kind, count) for count in (64, 6464))
    print(f"{kind[2:]}: {(many - few) / 6400:.0f} instructions a solve, end time included")
