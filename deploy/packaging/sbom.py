#!/usr/bin/env python3
"""Writes the bill of materials (SPDX 2.3, JSON) of programs built on this machine.

usage: sbom.py SOURCE VERSION OUT PROGRAM...

It names the shared libraries that the programs load, the Debian packages that they were built with, and the npm packages in
the page and in the reader of bags, each with its version and the package URL by which scanners find advisories."""
import functools
import hashlib
import json
import pathlib
import re
import subprocess
import sys
import time
import urllib.parse


def output(*command):
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout


def quote(text):
    return urllib.parse.quote(text, safe=".-~")


def spdx_id(kind, name):
    return f"SPDXRef-{kind}-" + re.sub(r"[^A-Za-z0-9.-]", "-", name)


def loaded_libraries(program):
    """Files of the shared libraries that a program loads."""
    return re.findall(r"=> (/\S+)", output("ldd", program))


def debian_packages_of(files):
    """The package that holds each file, also where /lib is a link to /usr/lib: one question to dpkg."""
    spellings = {file: (file, file.removeprefix("/usr"), str(pathlib.Path(file).resolve())) for file in files}
    answer = output("dpkg", "-S", *sorted({path for paths in spellings.values() for path in paths}))
    holders = {path: package for package, path in re.findall(r"^([a-z0-9.+-]+)(?::\w+)?: (.+)$", answer, re.M)}
    return {file: next((holders[path] for path in paths if path in holders), None) for file, paths in spellings.items()}


def build_packages(source):
    """The -dev packages of the first list in install-dependencies.sh, and the compiler."""
    listed = re.search(r"packages=\((.*?)\)", (source / "deploy/install-dependencies.sh").read_text(), re.S)[1].split()
    return [each for each in listed if each.endswith("-dev") or each == "g++"]


@functools.cache
def debian(name):
    version, origin, architecture = (output("dpkg-query", "-W", "-f=${Version}\n${source:Package}\n${Architecture}", name)
                                     .split("\n") + ["", "", ""])[:3]
    return {"name": name, "SPDXID": spdx_id("debian", name), "versionInfo": version or "NOASSERTION",
            "downloadLocation": "NOASSERTION", "filesAnalyzed": False, "sourceInfo": f"Debian source package {origin or name}",
            "licenseConcluded": "NOASSERTION", "licenseDeclared": "NOASSERTION", "copyrightText": "NOASSERTION",
            "externalRefs": [{"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl",
                              "referenceLocator": f"pkg:deb/debian/{quote(name)}@{quote(version)}?arch={architecture}"}]}


def of_the_page(source):
    """(name, version, licence) of the npm packages inside the page."""
    texts = (source / "server/web/third_party.txt").read_text()
    lock = json.loads((source / "server/web/package-lock.json").read_text())["packages"]
    for name, version in re.findall(r"^(\S+) (\S+)\n=+$", texts, re.M):
        yield name, version, lock[f"node_modules/{name}"].get("license", "NOASSERTION")


def of_the_bags(source):
    """The same for the reader of bags; its bundle contains the licences in a string."""
    lock = json.loads((source / "deploy/import/bags/package-lock.json").read_text())["packages"]
    licences = {(path.rpartition("node_modules/")[2], each["version"]): each.get("license", "NOASSERTION")
                for path, each in lock.items() if path}
    text = (source / "deploy/import/bags.cjs").read_text()
    for title in re.findall(r"""(?:["'`]|\\n)(@?[\w./-]+) (\d[\w.-]*)\\n=+\\n""", text):
        yield *title, licences[title]


def npm(name, version, licence):
    return {"name": name, "SPDXID": spdx_id("npm", f"{name}-{version}"), "versionInfo": version, "downloadLocation": "NOASSERTION",
            "filesAnalyzed": False, "licenseConcluded": licence, "licenseDeclared": licence, "copyrightText": "NOASSERTION",
            "externalRefs": [{"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl",
                              "referenceLocator": f"pkg:npm/{name}@{version}"}]}


def own(program, version):
    return {"name": program.name, "SPDXID": spdx_id("program", program.name), "versionInfo": version,
            "downloadLocation": "NOASSERTION", "filesAnalyzed": False, "licenseConcluded": "MIT", "licenseDeclared": "MIT",
            "copyrightText": "NOASSERTION", "primaryPackagePurpose": "APPLICATION"}


def bill(source, version, programs):
    packages, relations = {}, []

    def relate(element, kind, other):
        relation = {"spdxElementId": element, "relationshipType": kind, "relatedSpdxElement": other}
        if relation not in relations:
            relations.append(relation)

    def add(package):
        return packages.setdefault(package["SPDXID"], package)["SPDXID"]

    libraries = {program: loaded_libraries(program) for program in programs}
    holders = debian_packages_of({library for loaded in libraries.values() for library in loaded})
    for program in programs:
        mine = add(own(program, version))
        relate("SPDXRef-DOCUMENT", "DESCRIBES", mine)
        for library in sorted(libraries[program]):
            if holder := holders[library]:
                relate(mine, "DYNAMIC_LINK", add(debian(holder)))
        for name in build_packages(source):
            relate(add(debian(name)), "BUILD_DEPENDENCY_OF", mine)
        if program.name == "joulecastd":
            for each in of_the_page(source):
                relate(mine, "CONTAINS", add(npm(*each)))
        if program.name == "joulecast":
            for each in of_the_bags(source):
                relate(mine, "CONTAINS", add(npm(*each)))
    digest = hashlib.sha256(json.dumps(packages, sort_keys=True).encode()).hexdigest()
    return {"spdxVersion": "SPDX-2.3", "dataLicense": "CC0-1.0", "SPDXID": "SPDXRef-DOCUMENT", "name": f"joulecast-{version}",
            "documentNamespace": f"https://spdx.org/spdxdocs/joulecast-{version}-{digest[:32]}",
            "creationInfo": {"created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
                             "creators": ["Tool: joulecast-sbom"]},
            "packages": list(packages.values()), "relationships": relations}


def main():
    source, version, out, *programs = sys.argv[1:]
    document = bill(pathlib.Path(source), version, list(map(pathlib.Path, programs)))
    pathlib.Path(out).write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
