"""Fails when a generated document is not what its script writes."""

import subprocess
import sys

script, document = sys.argv[1:]
written = subprocess.run([sys.executable, "-B", script], check=True, capture_output=True, text=True).stdout
with open(document) as file:
    if file.read() != written:
        sys.exit(f"{document} is out of date: python3 {script} > {document}")
