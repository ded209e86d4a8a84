"""Runs the commands of a document and compares their output with the document.

A document's ```console blocks are one shell session: lines that begin with "$ " are commands ("> " continues one), the
lines below are their output. Every command must end with the exit code 0, or with N where the output's last line is
"(exit code N)". Numbers are compared as numbers-in-general, since measured values differ from run to run; a "..." within
an output matches any text, and a line of only "..." any lines. ```sh blocks run too, without their output
being compared. Text that only explains is fenced otherwise (```text, ```json).

--update writes the output of the commands into the document.
Ends with 77 where LCM multicast is needed ("simulate" or "replay" over UDP) and not there.
"""

import argparse
import re
import sys
from pathlib import Path

from sandbox import SKIP, Sandbox, multicast_here

NUMBER = re.compile(r"[-+]?(?:(?<![A-Za-z_])|(?<=\dT))\d[\d.,]*(?:[eE][-+]?\d+)?")  # the hours of a time too
HEXADECIMAL_ID = re.compile(r"(?<![\w.])(?=[a-f]*\d)(?=\d*[a-f])[0-9a-f]{8,}\b")
BLOCK = re.compile(r"^```(console|sh)\n(.*?)^```$", re.S | re.M)


def steps(block):
    """(command, expected output) pairs of a console block."""
    pairs = []
    for line in block.splitlines():
        if line.startswith("$ "):
            pairs.append([line[2:], []])
        elif line.startswith("> ") and pairs and not pairs[-1][1]:
            pairs[-1][0] += "\n" + line[2:]
        elif not pairs:
            raise SystemExit(f"a console block begins with output: {line!r}")
        else:
            pairs[-1][1].append(line)
    return pairs


def general(line):
    return re.sub(r"\s+|-{3,}", " ", NUMBER.sub("0", HEXADECIMAL_ID.sub("0", line))).strip()


def matches(expected, actual):
    """Returns whether the lines agree, except for numbers and text matched by "..."."""
    pattern = ""
    for line in expected:
        if line.strip() == "...":
            pattern += r"(?:.*\n)*?"
        else:
            pattern += ".*?".join(re.escape(general(part)) for part in line.split("...")).replace(r"\ ", " ") + r"\s*\n"
    return re.fullmatch(pattern, "".join(general(line) + "\n" for line in actual)) is not None


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("document", type=Path)
    arguments.add_argument("--daemon", type=Path, required=True)
    arguments.add_argument("--client", type=Path, required=True)
    arguments.add_argument("--source", type=Path, required=True)
    arguments.add_argument("--update", action="store_true")
    options = arguments.parse_args()

    text = options.document.read_text()
    if re.search(r"joulecast (simulate|replay)\b", text) and not multicast_here():
        print("skipped: no route for LCM multicast")
        return SKIP
    faults = []

    def replay(match):
        language, block = match.groups()
        if language == "sh":
            output, code = sandbox.run(block)
            if code != 0:
                faults.append(f"{block}\n  exit code {code}\n  " + "\n  ".join(output))
            return match.group(0)
        written = ""
        for command, expected in steps(block):
            output, code = sandbox.run(command)
            if code != 0:
                output.append(f"(exit code {code})")
            while expected and not expected[-1].strip():
                expected.pop()
            allowed = expected and re.fullmatch(r"\(exit code \d+\)", expected[-1])
            if not matches(expected, output) or (code != 0 and not allowed):
                faults.append(f"$ {command}\n expected:\n  " + "\n  ".join(expected) + "\n printed:\n  " +
                              "\n  ".join(output))
            written += "\n".join(["$ " + command.replace("\n", "\n> "), *output]) + "\n"
        return f"```{language}\n{written}```"

    with Sandbox(options.daemon, options.client, options.source) as sandbox:
        updated = BLOCK.sub(replay, text)
    if options.update:
        options.document.write_text(updated)
        return 0
    print("\n\n".join(faults) or f"{options.document.name}: the output of every command agrees")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
