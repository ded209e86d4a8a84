#!/usr/bin/env python3
"""The Debian packages as used by an administrator: installed with dpkg into a separate root, the service started according to
its unit, queried, given a faulty robot file, removed and purged. The root is an overlay over this machine's, so that the
machine is not changed and no network is needed."""
import argparse
import json
import os
import pathlib
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

from harness import check, skip


def run(*command, **options):
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, **options)
    check(done.returncode == 0, f"{' '.join(map(str, command))}: {done.stdout}{done.stderr}")
    return done.stdout


def isolate():
    """Runs this script again in separate name spaces for mounts and network."""
    if os.environ.pop("JOULECAST_ISOLATED", None):
        for command in ("ip link set lo up", "ip link set lo multicast on", "ip route add 224.0.0.0/4 dev lo"):
            run(*command.split())
        return
    if os.geteuid() != 0 or subprocess.run(["unshare", "--mount", "--net", "true"], capture_output=True).returncode != 0:
        skip("needs root and name spaces")
    os.environ["JOULECAST_ISOLATED"] = "1"
    os.execvp("unshare", ["unshare", "--mount", "--net", sys.executable, "-B", *sys.argv])


def make_root(folder):
    """A root into which packages can be installed: an overlay over this machine's."""
    run("mount", "-t", "tmpfs", "tmpfs", folder)
    for name in ("upper", "work", "root"):
        (folder / name).mkdir()
    root = folder / "root"
    layers = f"lowerdir=/,upperdir={folder}/upper,workdir={folder}/work"
    if subprocess.run(["mount", "-t", "overlay", "overlay", "-o", layers, root], capture_output=True).returncode != 0:
        skip("no overlay over the root")
    run("mount", "-t", "proc", "proc", root / "proc")
    run("mount", "-t", "tmpfs", "tmpfs", root / "dev")
    for name, minor in (("null", 3), ("zero", 5), ("random", 8), ("urandom", 9)):
        run("mknod", "-m", "666", root / "dev" / name, "c", 1, minor)
    run("mount", "-t", "tmpfs", "tmpfs", root / "run")
    (root / "usr/sbin/policy-rc.d").write_text("#!/bin/sh\nexit 101\n")
    (root / "usr/sbin/policy-rc.d").chmod(0o755)
    return root


def unit_of(root):
    """The unit's settings; the last one counts if one is repeated."""
    path, = [p for p in (root / "usr/lib/systemd/system/joulecastd.service", root / "lib/systemd/system/joulecastd.service")
             if p.exists()][:1]
    return path, dict(line.split("=", 1) for line in path.read_text().splitlines() if re.match(r"\w+=", line))


class Service:
    """The daemon as started by systemd: program, user, folder and readiness of the unit."""

    def __init__(self, root, unit):
        notify = root / "run/notify"
        notify.unlink(missing_ok=True)
        ready = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        ready.bind(str(notify))
        notify.chmod(0o777)
        ready.settimeout(20)
        self.log = open(root / "run/log", "w+")
        command = (f"umask {unit['UMask']}; cd {unit['WorkingDirectory']} && NOTIFY_SOCKET=/run/notify exec setpriv "
                   f"--reuid {unit['User']} --regid {unit['Group']} --clear-groups --inh-caps=-all --no-new-privs "
                   + unit["ExecStart"])
        self.process = subprocess.Popen(["chroot", str(root), "sh", "-c", command], stderr=self.log)
        try:
            check(b"READY=1" in ready.recv(4096), "the service did not send READY=1")
        except socket.timeout:
            check(False, "the service did not become ready:\n" + self.lines())

    def lines(self):
        self.log.seek(0)
        return self.log.read()

    def stop(self, limit_s):
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(timeout=limit_s)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()


def is_ready():
    try:
        return json.loads(get("/readyz"))["status"] == "ready"
    except urllib.error.HTTPError:
        return False


def get(path, port=8080):
    with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=10) as reply:
        return reply.read().decode()


def check_with_lintian(packages):
    if shutil.which("lintian") is None:
        return print("lintian is missing: packages not linted")
    done = subprocess.run(["lintian", "--fail-on", "error", "--allow-root", *map(str, packages)], capture_output=True, text=True)
    check(done.returncode == 0, done.stdout + done.stderr)


def check_with_systemd(root, path):
    if shutil.which("systemd-analyze") is None:
        return print("systemd-analyze is missing: unit not verified")
    inside = "/" + str(path.relative_to(root))
    done = subprocess.run(["chroot", str(root), "systemd-analyze", "verify", inside], capture_output=True, text=True)
    check(done.returncode == 0 and not done.stdout + done.stderr, "systemd-analyze verify: " + done.stdout + done.stderr)
    exposure = run("systemd-analyze", "security", "--offline=true", "--threshold=20", path)
    print(exposure.strip().splitlines()[-1])


def check_programs(root):
    """Manual pages and completions of the installed programs."""
    for page in ("man8/joulecastd.8.gz", "man1/joulecast.1.gz", "man1/joulecast-calibrate-drive.1.gz", "man1/joulecast-study-trial.1.gz"):
        check((root / "usr/share/man" / page).exists(), f"no {page}")
    for script in ("bash-completion/completions/joulecast", "zsh/vendor-completions/_joulecast",
                   "fish/vendor_completions.d/joulecast.fish"):
        check("joulecast" in (root / "usr/share" / script).read_text(), f"no {script}")
    answer = run("chroot", root, "joulecast", "profile", "--robot", "/usr/share/joulecast/deploy/robots/amr.json", "--length", "10", "--json")
    check(json.loads(answer)["robot_id"] == "amr", answer)
    tables = run("chroot", root, "joulecast-study", "thesis", "--table", "4-1")
    check(tables.startswith("Table 4-1."), tables)


def check_documents(root):
    """All files linked by the documents exist, and the first steps work with the packages alone."""
    for folder in ("usr/share/joulecast", "usr/share/doc/joulecastd"):
        documents = [root / folder / "README.md", *(root / folder / "deploy/documents").glob("*.md"), *(root / folder / "tests").rglob("*.md")]
        check(len(documents) >= 12, f"{folder} has {len(documents)} documents")
        for document in documents:
            for target in re.findall(r"\]\(([^)#\s=]+)(?:#[^)]*)?\)", document.read_text()):
                there = "://" in target or os.path.exists(os.path.normpath(document.parent / target))
                check(there, f"{document} links to {target}")
    run("chroot", root, "cp", "-r", "/usr/share/joulecast", "/run/project")
    first_look = ["chroot", str(root), "env", "HOME=/run", "/run/project/deploy/first_look.sh"]
    try:
        run(*first_look, "8086")
        check(len(json.loads(get("/v1/missions", 8086))["missions"]) == 6, "the first look has six missions")
    finally:
        run(*first_look, "stop")


def check_library(root):
    """The library's example builds with the installed files and gives the same cost as the command line."""
    if subprocess.run(["chroot", str(root), "which", "cmake", "c++"], capture_output=True).returncode != 0:
        return print("no compiler in the root: example not built")
    source = "/usr/share/doc/libjoulecast-dev/examples"
    run("chroot", root, "cmake", "-S", source, "-B", "/run/example", "-DCMAKE_BUILD_TYPE=Release")
    run("chroot", root, "cmake", "--build", "/run/example")
    answer = run("chroot", root, "/run/example/price_a_path", "/usr/share/joulecast/deploy/robots/amr.json")
    print("the example of libjoulecast-dev prints", answer.strip())
    check(re.fullmatch(r"[1-9]\d+ J in \d+\.\d s\n", answer), answer)


def check_bill_of_materials(root):
    """It lists the package and installed version of every library that the program needs, and the parts of the page."""
    bill = json.loads((root / "usr/share/doc/joulecastd/joulecast.spdx.json").read_text())
    check(bill["spdxVersion"] == "SPDX-2.3" and bill["dataLicense"] == "CC0-1.0", str(bill)[:300])
    by_id = {each["SPDXID"]: each for each in bill["packages"]}
    for relation in bill["relationships"]:
        described = {*by_id, "SPDXRef-DOCUMENT"}
        check({relation["spdxElementId"], relation["relatedSpdxElement"]} <= described, f"{relation} has an unknown element")
    versions = {each["name"]: each["versionInfo"] for each in by_id.values()}
    for program in ("joulecastd", "joulecast", "joulecast-study"):
        check(program in versions, f"{program} is not in the bill")
        for library in re.findall(r"NEEDED.*\[(.*)\]", run("readelf", "-d", root / "usr/bin" / program)):
            holders = {line.split(":")[0] for line in run("dpkg", "-S", f"*/{library}").splitlines()}
            mine = holders & set(versions)
            check(mine, f"{library} of {program}: none of {holders} is in the bill")
            for name in mine:
                installed = run("dpkg-query", "-W", "-f=${Version}", name)
                check(versions[name] in installed, f"{name}: {versions[name]}, installed is {installed}")
    check({"preact", "uplot", "@mcap/core", "libboost-dev"} <= set(versions), f"{sorted(versions)}")
    print(f"bill of materials: {len(by_id)} packages")


def show_demo(root, source, packages):
    """deploy/demo.sh --packages in a folder with built packages: it installs them and shows the first answers."""
    folder = root / "run/demo"
    (folder / "deploy").mkdir(parents=True)
    (folder / "build/packages").mkdir(parents=True)
    for script in source.glob("deploy/demo*.sh"):
        shutil.copy(script, folder / "deploy")
    for package in packages:
        shutil.copy(package, folder / "build/packages")
    began = time.monotonic()
    try:
        shown = run("chroot", root, "/run/demo/deploy/demo.sh", "--packages")
        print(f"the demo from packages took {time.monotonic() - began:.0f} s")
        for answer in ('"certificate"', '"range_m"', '"kinetic"'):
            check(answer in shown, f"no {answer} in:\n{shown}")
        check(len(json.loads(get("/v1/robots", 8090))["robots"]) == 4, get("/v1/robots", 8090))
        left = [p.name for p in (root / "var/lib/joulecast").iterdir()]
        check(not left, f"the demo wrote into the service's folder: {left}")
    finally:
        print(run("chroot", root, "/run/demo/deploy/demo.sh", "stop").strip())
    run("chroot", root, "dpkg", "--purge", "joulecast", "joulecastd")


def check_service(service, state):
    until = time.monotonic() + 30  # it answers before it has read the missions of its robots
    while not is_ready():
        check(time.monotonic() < until, "the service is not ready after 30 s:\n" + service.lines())
        time.sleep(0.1)
    check([r["robot_id"] for r in json.loads(get("/v1/robots"))["robots"]] == ["amr"], get("/v1/robots"))
    check("joulecast_robot_files_faulty 3" in get("/metrics"), get("/metrics"))
    check(service.lines().count("robot file left out") == 3, service.lines())
    check((state / "history.db").stat().st_mode & 0o777 == 0o600, "the history can be read by others")
    check(service.stop(15) == 0, "the service did not stop in order")


def install_and_use(root, packages):
    for package in packages:
        shutil.copy(package, root / "run")
    run("chroot", root, "dpkg", "--install", *[f"/run/{p.name}" for p in packages])
    check_programs(root)
    check_documents(root)
    check_library(root)
    check_bill_of_materials(root)
    path, unit = unit_of(root)
    check_with_systemd(root, path)
    program, flag, settings = shlex.split(unit["ExecStart"])
    check(flag == "--config" and settings == "/etc/joulecast/joulecastd.json", unit["ExecStart"])
    check(run("chroot", root, program, flag, settings, "--check-config") == "the settings are valid\n", "--check-config")

    robots = root / "etc/joulecast/robots"
    shutil.copy(root / "usr/share/joulecast/deploy/robots/amr.json", robots)
    (robots / "broken.json").write_text("{")
    (robots / "negative.json").write_text((robots / "amr.json").read_text().replace('"amr"', '"other"')
                                          .replace('"wheel_radius_m": 0', '"wheel_radius_m": -1'))
    (robots / "twin.json").write_text((robots / "amr.json").read_text())
    done = subprocess.run(["chroot", str(root), program, flag, settings, "--store-url", "postgresql://host/?bogus=1", "--check-config"],
                          capture_output=True, text=True)
    check(done.returncode == 2 and len(done.stderr.splitlines()) == 4, f"{done.returncode}: {done.stderr}")
    for fault in ("broken.json", "negative.json", "twin.json", "store.url"):
        check(fault in done.stderr, f"{fault}: {done.stderr}")

    with Service(root, unit) as service:
        check_service(service, state := root / "var/lib/joulecast")

    run("chroot", root, "dpkg", "--remove", "joulecast", "joulecastd", "libjoulecast-dev")
    check((state / "history.db").exists() and (root / "etc/joulecast/joulecastd.json").exists(), "remove took data")
    run("chroot", root, "dpkg", "--purge", "joulecast", "joulecastd", "libjoulecast-dev")
    left = [p for p in (state, root / "etc/joulecast", root / "usr/bin/joulecastd", root / "usr/share/joulecast",
                        root / "usr/bin/joulecast") if p.exists()]
    check(not left, f"left after the purge: {left}")
    print("installed, started, queried, stopped, removed and purged")


def main():
    isolate()
    parser = argparse.ArgumentParser()
    for name in ("daemon", "client", "source", "shared", "build"):
        parser.add_argument("--" + name, required=True)
    options = parser.parse_args()

    with tempfile.TemporaryDirectory() as packages_folder:
        # Made outside the overlay: cpack writes the build's install records.
        run("cpack", "--config", os.path.join(options.build, "CPackConfig.cmake"), "-B", packages_folder, cwd=options.build)
        packages = sorted(pathlib.Path(packages_folder).glob("*.deb"))
        check(len(packages) == 3, f"packages: {packages}")
        check_with_lintian(packages)
        # Not inside a folder that is deleted recursively: mounted files do not belong to the test.
        mounted = pathlib.Path(tempfile.mkdtemp())
        try:
            root = make_root(mounted)
            install_and_use(root, packages)
            show_demo(root, pathlib.Path(options.source), packages)
        finally:
            subprocess.run(["umount", "--recursive", "--lazy", str(mounted)])
            mounted.rmdir()


main()
