#!/usr/bin/env python3
"""Checks the English of comments, messages, documents and test names.

    check_language.py               fail where a folder is above its limits, or a limit is out of date
    check_language.py --list PATH   list the hits below PATH, each with a replacement
    check_language.py --update      lower the limits to the present figures; a limit is never raised
    --root DIR                      the working tree to check (default: the one that contains this script)

deploy/language/words.txt lists words and their replacements, exceptions.txt the exceptions, and limits.txt two limits
for each folder: hits per 1,000 words and the mean length of a test name in words.
"""

import argparse
import collections
import fnmatch
import io
import math
import re
import subprocess
import sys
import tokenize
from pathlib import Path

# The aims of limits.txt. A folder within them passes also above its limit.
AIM_HITS = 3  # per 1,000 words; also the number of hits that a folder of less than 1,000 words may have
AIM_NAME_WORDS = 5
# A limit further above the present figure than this is out of date.
MARGIN_HITS = 1.0
MARGIN_NAME_WORDS = 0.5

SUFFIXES = (".cc", ".h", ".md", ".py", ".sh", ".js", ".jsx", ".mjs", ".json", ".sql", ".lcm", ".in", ".css", "CMakeLists.txt")
C_TEXT = re.compile(
    r'//[^\n]*|/\*.*?\*/|"(?:[^"\\\n]|\\.)*"|R"[^(]*\((?:.|\n)*?\)[^"]*"|\'(?:[^\'\\\n]|\\.){12,}\'|`(?:[^`\\]|\\.)*`', re.S)
SHELL_TEXT = re.compile(r"(?<![$\w{])#.*|'[^'\n]{12,}'|\"[^\"\n]{12,}\"")
JSON_TEXT = re.compile(r'"(?:description|title|summary)":\s*"(.*)"')
CPP_TEST = re.compile(r"\b(?:TEST(?:_F|_P)?|RC_GTEST_PROP)\(\s*\w+\s*,\s*(\w+)\s*[,)]")
PYTHON_TEST = re.compile(r"^\s*def test_(\w+)", re.M)


def cpp_name_words(name):
    return re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", name)


def texts(path, text):
    """(line number, English text) pairs of a file: comments, strings and test names; of a document every line."""

    def found(pattern, group=0):
        return ((text.count("\n", 0, m.start()) + 1, m.group(group)) for m in pattern.finditer(text))

    if path.endswith(".md"):
        yield from enumerate(text.split("\n"), 1)
    elif path.endswith(".py"):
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.COMMENT or (token.type == tokenize.STRING and len(token.string) > 13):
                yield from enumerate(token.string.split("\n"), token.start[0])
    elif path.endswith((".sh", "CMakeLists.txt")):
        yield from found(SHELL_TEXT)
    elif path.endswith(".json"):
        yield from found(JSON_TEXT, 1)
    else:
        yield from found(C_TEXT)
    for line, name in found(CPP_TEST, 1) if path.endswith(".cc") else ():
        yield line, " ".join(cpp_name_words(name))


def name_lengths(path, text):
    """The length of each test name of a file, in words."""
    if not path.startswith("tests/"):
        return []
    if path.endswith(".cc"):
        return [len(cpp_name_words(name)) for name in CPP_TEST.findall(text)]
    if path.endswith(".py"):
        return [len(name.split("_")) for name in PYTHON_TEST.findall(text)]
    return []


def entries(path):
    """The lines of a list without comments and empty ones."""
    return [line.rstrip() for line in path.read_text().splitlines() if line.strip() and not line.startswith("#")]


class Words:
    def __init__(self, path):
        self.replacement = [(re.compile(rf"(?:{pattern})\Z", re.I), better)
                            for pattern, better in (line.split(" -> ") for line in entries(path))]
        self.pattern = re.compile(r"\b(?:" + "|".join(each.pattern[3:-3] for each, _ in self.replacement) + r")\b", re.I)

    def better(self, word):
        return next(better for pattern, better in self.replacement if pattern.match(word))


class Exceptions:
    def __init__(self, path):
        self.files, self.phrases = [], []
        for line in entries(path):
            glob, _, phrase = line.partition(": ")
            if phrase:
                self.phrases.append((glob, phrase))
            else:
                self.files.append(glob)

    def skips(self, path):
        return any(fnmatch.fnmatchcase(path, glob) for glob in self.files)

    def apply(self, path, text):
        """The text without the phrases that are excepted in this file."""
        for glob, phrase in self.phrases:
            if fnmatch.fnmatchcase(path, glob):
                text = text.replace(phrase, "")
        return text


class Figures:
    """Counts of a folder."""

    def __init__(self):
        self.words = self.hits = self.names = self.name_words = 0

    def hits_per_1000(self):
        return 1000 * self.hits / max(self.words, 1)

    def name_mean(self):
        return self.name_words / self.names if self.names else None


def folder_of(path):
    """The first two folders of a path; of a file at the top its name."""
    parts = path.split("/")
    return "/".join(parts[:2]) if len(parts) > 2 else parts[0]


def count(root, words, exceptions, below=None):
    """Figures by folder, with "all" for the tree, and the (path, line, word, text) of every hit."""
    figures, hits = collections.defaultdict(Figures), []
    listed = subprocess.run(["git", "-C", root, "ls-files", "-co", "--exclude-standard"],
                            check=True, capture_output=True, text=True).stdout
    for path in listed.splitlines():
        file = root / path
        if not path.endswith(SUFFIXES) or exceptions.skips(path) or not file.is_file():
            continue
        if below and not path.startswith(below):
            continue
        text = file.read_text()
        names = name_lengths(path, text)
        mine = Figures()
        for line, piece in texts(path, text):
            mine.words += len(re.findall(r"[A-Za-z]{2,}", piece))
            for found in words.pattern.finditer(exceptions.apply(path, piece)):
                mine.hits += 1
                hits.append((path, line, found.group(), piece.strip()))
        for each in (figures[folder_of(path)], figures["all"]):
            each.words += mine.words
            each.hits += mine.hits
            each.names += len(names)
            each.name_words += sum(names)
    return figures, hits


def read_limits(path):
    """(hits per 1,000 words, mean length of a test name) by folder."""
    limits = {}
    for line in entries(path):
        folder, hits, name_words = line.split()
        limits[folder] = (float(hits), None if name_words == "-" else float(name_words))
    return limits


def rounded_up(value):
    return None if value is None else math.ceil(10 * value - 1e-9) / 10


def lowered(folder, figures, limits):
    """The limits of a folder at its present figures, at most those in force."""
    old_hits, old_name_words = limits.get(folder, (AIM_HITS, AIM_NAME_WORDS)) if limits else (math.inf, math.inf)
    name_words = rounded_up(figures.name_mean())
    if name_words is not None and old_name_words is not None:
        name_words = min(name_words, old_name_words)
    return min(rounded_up(figures.hits_per_1000()), old_hits), name_words


def faults_of(figures, limits):
    """A sentence for each limit that is exceeded or out of date."""
    faults = []
    for folder in sorted(figures):
        mine = figures[folder]
        hits_limit, names_limit = limits.get(folder, (AIM_HITS, None))
        rate, names = mine.hits_per_1000(), mine.name_mean()
        names_limit = AIM_NAME_WORDS if names_limit is None else names_limit
        if mine.hits > AIM_HITS and rate > max(hits_limit, AIM_HITS):
            faults.append(f"{folder}: {mine.hits} hits in {mine.words} words, {rate:.2f} per 1,000; the limit is {hits_limit}. "
                          f"List them: deploy/check_language.py --list{'' if folder == 'all' else ' ' + folder}")
        if names is not None and names > max(names_limit, AIM_NAME_WORDS):
            faults.append(f"{folder}: test names have {names:.2f} words on average; the limit is {names_limit}")
        if folder in limits and (hits_limit > rate + MARGIN_HITS or (names is not None and names_limit > names + MARGIN_NAME_WORDS)):
            faults.append(f"{folder}: the limits are out of date; run deploy/check_language.py --update")
    faults += [f"{folder}: has a limit and no text; run deploy/check_language.py --update" for folder in sorted(set(limits) - set(figures))]
    return faults


def write_limits(path, figures, limits):
    header = [line for line in path.read_text().splitlines() if line.startswith("#")]
    rows = [(folder, *lowered(folder, figures[folder], limits)) for folder in sorted(figures, key=lambda each: (each != "all", each))]
    lines = [f"{folder:28s} {hits:6.1f} {'-' if names is None else format(names, '.1f'):>6s}" for folder, hits, names in rows]
    path.write_text("\n".join(header + lines) + "\n")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--list", metavar="PATH", nargs="?", const="")
    parser.add_argument("--update", action="store_true")
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parent.parent)
    options = parser.parse_args()
    lists = options.root / "deploy/language"
    words, exceptions = Words(lists / "words.txt"), Exceptions(lists / "exceptions.txt")
    figures, hits = count(options.root, words, exceptions, options.list)
    if options.list is not None:
        for path, line, word, text in hits:
            print(f"{path}:{line}: {word} -> {words.better(word)} | {text[:120]}")
        return 0
    limits = read_limits(lists / "limits.txt")
    if options.update:
        write_limits(lists / "limits.txt", figures, limits)
        limits = read_limits(lists / "limits.txt")
    for fault in (faults := faults_of(figures, limits)):
        print(fault, file=sys.stderr)
    return 1 if faults else 0


sys.exit(main())
