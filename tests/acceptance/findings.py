#!/usr/bin/env python3
"""Tests of daemons fail for a report of a sanitizer in the daemon's log, whatever else they check."""
import os
import subprocess
import sys
import tempfile

from harness import check

DAEMON = """#!/bin/sh
echo '{"message":"ready","http":"http://127.0.0.1:1"}' >&2
echo '%s' >&2
exec sleep 60
"""
TEST = """
import argparse, sys, time
from harness import Programs
programs = Programs(argparse.Namespace(daemon=sys.argv[1], client=""))
programs.start()
time.sleep(0.2)
programs.end()
print("end of the test")
"""
LINES = {"{\"message\":\"a log line with ERROR and runtime errors\"}": 0, "==7==ERROR: AddressSanitizer: heap-use-after-free": 1,
         "/x/session.cc:12:7: runtime error: signed integer overflow": 1, "==7==ERROR: LeakSanitizer: detected memory leaks": 1,
         "WARNING: ThreadSanitizer: data race (pid=7)": 1}


def main():
    with tempfile.TemporaryDirectory() as folder:
        daemon = os.path.join(folder, "daemon")
        for line, code in LINES.items():
            with open(daemon, "w") as file:
                file.write(DAEMON % line)
            os.chmod(daemon, 0o755)
            done = subprocess.run([sys.executable, "-B", "-c", TEST, daemon], cwd=os.path.dirname(os.path.abspath(__file__)),
                                  capture_output=True, text=True)
            check(done.returncode == code and "end of the test" in done.stdout, f"{line}: {done}")
            check((line in done.stdout) == (code != 0), f"{line}: {done.stdout}")


main()
