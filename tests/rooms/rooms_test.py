#!/usr/bin/env python3
"""Checks that rooms (folders with a library of their own) declare their use of each other, by include and by link.

rooms_test.py SOURCE

- A room links exactly the rooms whose headers its files include; PUBLIC those that its own headers include.
- Each hop of the walks in architecture.md, `file: function`, is a function of that file, and each file named there exists.
- A room of src/ uses only rooms that deploy/documents/architecture.md lists above it, and the build lists them in
  that order.
"""
import re
import sys
from pathlib import Path


def calls(text, function):
    """The arguments of every call of a CMake function."""
    text = re.sub(r"#.*", "", text)
    return [m.split() for m in re.findall(rf"\b{function}\(([^()]*)\)", text)]


PRODUCTS = ("src", "server", "client", "tests/study")


class Library:
    def __init__(self, name, folder):
        self.name, self.folder = name, folder
        self.links = {"PUBLIC": set(), "PRIVATE": set()}

    def __repr__(self):
        return f"{self.folder} ({self.name})"


def libraries_of(source):
    """The libraries by name and, of each source file or header, its library."""
    libraries, owner = {}, {}
    lists = [f for top in PRODUCTS for f in sorted((source / top).rglob("CMakeLists.txt"))]
    for file in lists:
        folder, text = file.parent, file.read_text()
        made = [("joulecast_" + a[0], a[1:]) for a in calls(text, "joulecast_room") if a[0] != "name"]
        made += [(a[0], a[2:]) for a in calls(text, "add_library") if a[0].startswith("joulecast_") and "$" not in a[0]]
        for name, sources in made:
            library = libraries[name] = Library(name, folder.relative_to(source))
            for s in {folder / s for s in sources if s.endswith(".cc") and "$" not in s}:
                owner[s] = owner[s.with_suffix(".h")] = library
        for name, *words in calls(text, "target_link_libraries"):
            scope = None
            for word in words:
                if word in ("PUBLIC", "PRIVATE", "INTERFACE"):
                    scope = word
                elif name in libraries and word.startswith("joulecast_") and word != "joulecast_options":
                    libraries[name].links[scope].add(word)
    # A source that no list names belongs to the library of its folder's name.
    for file in [s for top in PRODUCTS for s in (source / top).rglob("*.cc") if s not in owner and s.name != "main.cc"]:
        folder = next(f for f in file.parents if f == source or (f / "CMakeLists.txt").exists())
        library = libraries.get(f"joulecast_{folder.name}")
        if library and source / library.folder == folder:
            owner[file] = owner[file.with_suffix(".h")] = library
    # A header without a source belongs to the library of its name, or else of its folder's.
    for header in [h for top in PRODUCTS for h in (source / top).rglob("*.h") if h not in owner]:
        folder = next(f for f in header.parents if f == source or (f / "CMakeLists.txt").exists())
        near = [l for l in libraries.values() if source / l.folder == folder]
        named = [l for n in (header.stem, folder.name) for l in near + list(libraries.values()) if l.name == f"joulecast_{n}"]
        if named or near:
            owner[header] = (named or near)[0]
    return libraries, owner


def included(source, file):
    for name in re.findall(r'^#include "([^"]+)"', file.read_text(), re.M):
        for root in (source / "src", source, file.parent):
            if (root / name).exists():
                yield (root / name).resolve()
                break


def wanted_links(source, libraries, owner, library):
    """The libraries that it must link, PUBLIC and PRIVATE, and of each a file that includes it."""
    headers, sources = {}, {}
    for file in sorted(f for f, l in owner.items() if l is library and f.exists()):
        for header in included(source, file):
            to = owner.get(header, library)
            if to is not library:
                (headers if file.suffix == ".h" else sources).setdefault(to.name, file)
    return {"PUBLIC": headers, "PRIVATE": {n: f for n, f in sources.items() if n not in headers}}


def faults_of_links(source, libraries, owner):
    faults = []
    for library in libraries.values():
        wanted = wanted_links(source, libraries, owner, library)
        for scope, other in (("PUBLIC", "PRIVATE"), ("PRIVATE", "PUBLIC")):
            for name, file in wanted[scope].items():
                if name not in library.links[scope]:
                    faults.append(f"{library}: {file.relative_to(source)} includes {name}, which is not linked {scope}")
            for name in library.links[scope]:
                if name in libraries and name not in wanted[scope]:
                    faults.append(f"{library}: links {name} {scope}, which its "
                                  + ("files do not include" if name not in wanted[other] else "sources alone include"
                                     if scope == "PUBLIC" else "headers include"))
    return faults


def faults_of_order(source, libraries):
    architecture = (source / "deploy/documents/architecture.md").read_text()
    order = re.findall(r"^src/([a-z_]+) ", architecture, re.M)
    built = re.search(r"foreach\(room ([^)]*)\)", (source / "src/CMakeLists.txt").read_text()).group(1).split()
    faults = [] if order == built else [f"architecture.md lists {order}, src/CMakeLists.txt builds {built}"]
    folders = sorted(p.name for p in (source / "src").iterdir() if p.is_dir())
    if folders != sorted(order):
        faults.append(f"architecture.md lists {sorted(order)}, src/ has {folders}")
    # Of the server those that have a folder; log, metrics and settings lie in server/ itself.
    rooms = re.findall(r"^((?:src|server)/[a-z_]+) ", architecture, re.M)
    built = sorted("/".join(library.folder.parts[:2]) for library in libraries.values()
                   if library.folder.parts[0] == "server" and len(library.folder.parts) > 1)
    if faulty := set(built) - set(rooms):
        faults.append(f"architecture.md does not list {sorted(faulty)}")
    place = {name: k for k, name in enumerate(rooms)}
    for library in libraries.values():
        own = "/".join(library.folder.parts[:2])
        if own not in place:
            continue
        for name in library.links["PUBLIC"] | library.links["PRIVATE"]:
            to = "/".join(libraries[name].folder.parts[:2]) if name in libraries else None
            if to is None or to in place and place[to] <= place[own] or own.startswith("server/") and to == "server":
                continue
            faults.append(f"{library} uses {name}, which is not above it")
    return faults


def faults_of_walks(source):
    architecture = (source / "deploy/documents/architecture.md").read_text()
    walks = re.findall(r"^## The path of .*?(?=^## )", architecture, re.M | re.S)
    hops = [hop for walk in walks for hop in re.findall(r"`((?:src|server|client)/[^`:]+\.(?:h|cc))(?:: ([^`]+))?`", walk)]
    assert len(walks) == 4 and len(hops) > 25, "the walks are not read as they are written"
    faults = []
    for file, function in hops:
        path = source / file
        if not path.exists():
            faults.append(f"architecture.md names {file}, which does not exist")
        elif function and not re.search(rf"^[^/\n]*\b{re.escape(function)}\(", path.read_text(), re.M):
            faults.append(f"architecture.md names {function} in {file}, which does not define it")
    return faults


def main():
    source = Path(sys.argv[1]).resolve()
    libraries, owner = libraries_of(source)
    assert len(libraries) > 20, "the build's lists are not read as they are written"
    faults = faults_of_links(source, libraries, owner) + faults_of_order(source, libraries) + faults_of_walks(source)
    print("\n".join(sorted(faults)))
    sys.exit(1 if faults else 0)


main()
