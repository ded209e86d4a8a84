"""Writes the manual pages from the programs' --help: joulecastd.8, joulecast.1, joulecast-study.1 and one for each command.

man_pages.py DAEMON CLIENT STUDY PROJECT FOLDER
"""

import gzip
import re
import subprocess
import sys
from pathlib import Path


def help_of(program, *command):
    return subprocess.run([program, *command, "--help"], check=True, capture_output=True, text=True).stdout


def roff(text):
    escaped = text.replace("\\", "\\e").replace("-", "\\-")
    return "\\&" + escaped if escaped[:1] in (".", "'") else escaped


def sections(text):
    """(heading, lines) pairs; the lines before the first heading have none. Indented lines follow a heading."""
    lines = text.splitlines()
    found = [("", [])]
    for line, following in zip(lines, lines[1:] + [""]):
        usage = re.fullmatch(r"[Uu]sage: (.*)", line)
        if usage:
            found.append(("synopsis", ["  " + usage[1]]))
        elif line[:1].strip() and following.startswith("  "):
            found.append((line.rstrip(":"), []))
        else:
            found[-1][1].append(line)
    return found


def rows(lines):
    """[left, text] of the rows of a section; a row without a left side is plain text."""
    table = []
    for line in filter(str.strip, lines):
        row = re.fullmatch(r"  (\S.*?)(?:\s{2,}(\S.*))?", line)
        if row:
            table.append([row[1], row[2] or ""])
        elif table and line.startswith("   "):
            table[-1][1] = f"{table[-1][1]} {line.strip()}".strip()
        else:
            table.append(["", line.strip()])
    return table


def page(name, section, text, related, project):
    parts = sections(text)
    summary = " ".join(line for line in parts[0][1] if line).removeprefix("joulecast: ").removeprefix("joulecastd: ")
    out = [f'.TH {name.upper()} {section} "" joulecast', ".SH NAME", f"{name} \\- {roff(summary)}"]
    for heading, lines in parts[1:]:
        out.append(f".SH {heading.upper()}")
        for left, meaning in rows(lines):
            if left and meaning:
                out += [".TP", ".B " + roff(left), roff(meaning)]
            else:
                out += [".PP", roff(left or meaning)]
    out += [".SH FILES", ".TP", ".B " + roff(project),
            roff("README.md and the documents it lists (package joulecastd); robot files, mappings and examples to start from")]
    out += [".SH SEE ALSO", ", ".join(map(roff, related))]
    return "\n".join(out) + "\n"


def commands_of(text):
    return [left for heading, lines in sections(text) if heading == "Subcommands" for left, _ in rows(lines) if left]


def main():
    daemon, client, study, project, folder = *sys.argv[1:5], Path(sys.argv[5])
    folder.mkdir(parents=True, exist_ok=True)
    for earlier in folder.glob("*.gz"):
        earlier.unlink()

    def write(name, section, text, related):
        content = page(name, section, text, related, project).encode()
        (folder / f"{name}.{section}.gz").write_bytes(gzip.compress(content, 9, mtime=0))

    def write_commands(program, first, related, command=()):
        text = help_of(program, *command)
        name = "-".join([first, *command])
        below = commands_of(text)
        write(name, 1, text, [f"{name}-{each}(1)" for each in below] + ([f"{first}(1)"] if command else []) + related)
        for each in below:
            write_commands(program, first, related, (*command, each))

    write("joulecastd", 8, help_of(daemon), ["joulecast(1)"])
    write_commands(client, "joulecast", ["joulecast-study(1)", "joulecastd(8)"])
    write_commands(study, "joulecast-study", ["joulecast(1)", "joulecastd(8)"])


main()
