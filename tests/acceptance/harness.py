"""A joulecastd for one test, the command line, and a minimal implementation of LCM's wire format."""
import argparse
import atexit
import json
import os
import pathlib
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import urllib.error
import urllib.request

SKIP = 77
GROUP = "239.255.76.68"
# Multiple of the times that tests wait: tests/CMakeLists.txt.
PATIENCE = float(os.environ.get("TEST_PATIENCE", 1))


def skip(why):
    print("skipped:", why)
    sys.exit(SKIP)


def check(truth, text):
    if not truth:
        print("FAILED:", text[:3000], flush=True)
        sys.exit(1)


def print_exception(error):
    """Prints it where the other reasons of a failure are printed."""
    print("FAILED:", *traceback.format_exception(error), sep="\n", flush=True)


sys.excepthook = lambda _, error, trace: print_exception(error)
threading.excepthook = lambda thread: print_exception(thread.exc_value)


# The first line of a sanitizer's report: of addresses, leaks and threads, and of undefined behaviour.
FINDING = re.compile(r"^.*(?:(?:ERROR|WARNING): \w+Sanitizer|runtime error:).*$", re.M)
findings = []  # of all daemons of this test


def fail_for_findings():
    """Ends the test with 1 after its other exit handlers, which cannot change the exit code otherwise."""
    if findings:
        print("FAILED: findings of a sanitizer:", *findings, sep="\n", flush=True)
        os._exit(1)


atexit.register(fail_for_findings)


def start_postgresql(server):
    started = server.tell("start")
    if started == SKIP:
        skip("PostgreSQL is not installed")
    check(started == 0, "PostgreSQL did not start")


def close_to(value, expected, relative, text):
    check(abs(value - expected) <= relative * abs(expected), f"{text}: {value} against {expected}, tolerance {relative}")


def arguments():
    parser = argparse.ArgumentParser()
    for name in ("daemon", "client", "source", "shared"):
        parser.add_argument("--" + name, required=True)
    return parser.parse_args()


def wait_until(condition, seconds, text):
    """Waits for the condition and returns the time taken [s]; the test fails after `seconds`, times PATIENCE."""
    seconds *= PATIENCE
    began = time.monotonic()
    while not condition():
        check(time.monotonic() - began < seconds, f"not within {seconds} s: {text}")
        time.sleep(0.05)
    return time.monotonic() - began


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        return probe.getsockname()[1]


def free_tcp_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Listener:
    """Receives LCM messages of a multicast port, without fragments (these messages are small)."""

    def __init__(self, port):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        self.socket.bind(("", port))
        member = struct.pack("4sl", socket.inet_aton(GROUP), socket.INADDR_ANY)
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)

    def messages(self, seconds):
        """(time of arrival, channel, payload) of each message within the time."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            self.socket.settimeout(left)
            try:
                datagram = self.socket.recv(65536)
            except socket.timeout:
                return
            if datagram[:4] == b"LC02":
                channel, payload = datagram[8:].split(b"\0", 1)
                yield time.monotonic(), channel.decode(), payload


def ask(url, method, path, body=None):
    """Status and answer of a request."""
    request = urllib.request.Request(url + path, method=method, headers={"Content-Type": "application/json"},
                                     data=None if body is None else json.dumps(body).encode())
    try:
        with urllib.request.urlopen(request, timeout=120) as reply:
            return reply.status, json.load(reply)
    except urllib.error.HTTPError as error:
        return error.code, json.load(error)


def need_multicast():
    """Skips the test if a multicast message is not received."""
    port = free_port()
    try:
        listener = Listener(port)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            sender.sendto(b"LC02\0\0\0\0PROBE\0", (GROUP, port))
        heard = any(channel == "PROBE" for _, channel, _ in listener.messages(2))
    except OSError as error:
        skip(f"no multicast route ({error}); tests/support/isolated.sh makes one")
    if not heard:
        skip("multicast is not received; tests/support/isolated.sh makes a namespace with multicast")


class Programs:
    """The daemon with a separate store and LCM port, and the command line."""

    def __init__(self, options):
        self.options = options
        self.folder = tempfile.TemporaryDirectory()
        self.lcm_port = free_port()
        # The usual maximum of receive buffers of unprivileged processes, as test machines are busy.
        self.lcm_url = f"udpm://{GROUP}:{self.lcm_port}?ttl=0&recv_buf_size=4194304"
        self.store = self.path("history.db")
        self.settings = []  # further options of the daemon
        self.environment = {}  # and additions to its environment
        self.process = None
        atexit.register(self.end)

    def end(self):
        """Ends the daemon together with the test, for any result, and looks for findings of a sanitizer in its log."""
        if self.process and self.process.poll() is None:
            self.kill()
        log = pathlib.Path(self.path("daemon.log"))
        text = log.read_text(errors="replace") if log.exists() else ""
        if (found := FINDING.search(text)) and (finding := text[found.start():][:8000]) not in findings:
            findings.append(finding)

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def start(self):
        self.log = open(self.path("daemon.log"), "a+")
        begin = self.log.seek(0, os.SEEK_END)
        self.process = subprocess.Popen(
            [self.options.daemon, "--http-port", "0", "--store-path", self.store, "--log-format", "json",
             "--lcm-url", self.lcm_url, *self.settings], stderr=self.log, env=os.environ | self.environment)
        until = time.monotonic() + 30 * PATIENCE
        while time.monotonic() < until and self.process.poll() is None:
            self.log.seek(begin)
            for line in self.log:
                if line.startswith("{") and line.endswith("\n") and (event := json.loads(line)).get("message") == "ready":
                    self.url = event["http"]
                    return
            time.sleep(0.02)
        self.log.seek(begin)
        sys.exit("the daemon did not become ready:\n" + self.log.read())

    def kill(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def stop(self):
        self.process.terminate()
        return self.process.wait(timeout=30 * PATIENCE)

    def get(self, path):
        with urllib.request.urlopen(self.url + path, timeout=30) as reply:
            return json.load(reply)

    def metric(self, name):
        """The value of a metric, with its labels as they are printed."""
        with urllib.request.urlopen(self.url + "/metrics", timeout=10) as reply:
            for line in reply.read().decode().splitlines():
                if line.startswith(name + " "):
                    return float(line.split()[1])
        check(False, f"metric {name} is missing")

    def put(self, path, document):
        request = urllib.request.Request(self.url + path, method="PUT", data=json.dumps(document).encode(),
                                         headers={"Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=30) as reply:
            return json.load(reply)

    def run(self, *arguments):
        done = subprocess.run([self.options.client, *map(str, arguments)], capture_output=True, text=True)
        check(done.returncode == 0, f"joulecast {' '.join(map(str, arguments))}: {done.stdout}{done.stderr}")
        return done.stdout

    def missions(self, robot_id):
        return self.get(f"/v1/missions?limit=500&digits=17&robot_id={robot_id}")["missions"]

    def wait_for(self, robot_id, count, seconds=60):
        """The robot's missions, once `count` have ended."""
        seconds *= PATIENCE
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            missions = self.missions(robot_id)
            if sum(m["state"] != "open" for m in missions) >= count:
                return missions
            time.sleep(0.2)
        check(False, f"{robot_id}: {count} missions did not end within {seconds} s, only "
                     f"{[(m['mission_id'], m['state']) for m in missions]}")


def shared_folder(options, *parts):
    folder = pathlib.Path(options.shared, "data", *parts)
    if not os.path.isdir(options.shared):
        skip("no shared folder next to the project")
    check(folder.is_dir(), f"{folder} is missing")
    return folder


def accounts_twice(programs, logs, robots):
    """`replay --into` two stores: every ledger of every mission must be identical bit by bit."""
    answers = []
    for k in range(2):
        arguments = ["replay", *logs, "--into", programs.path(f"again-{k}-{os.path.basename(str(logs[0]))}.db")]
        for robot in robots:
            arguments += ["--robot", robot]
        answers.append(json.loads(programs.run(*arguments, "--json")))
    check(answers[0]["missions"] == answers[1]["missions"], "a second replay gives different ledgers")
    return answers[0]["missions"]
