"""A PostgreSQL server with a synchronous standby, the daemons that share it, and their links."""
import json
import os
import pathlib
import shutil
import socket
import struct
import subprocess
import tempfile
import threading
import time
import urllib.error
import urllib.request

from harness import Programs, check
from host_faults import HostFaults

LEASE_S = 5
NODES = ("alpha", "beta", "gamma")
BEGAN = time.time()


def say(text):
    print(f"{time.time() - BEGAN:7.1f} s: {text}", flush=True)


class Server:
    """A separate PostgreSQL with a synchronous standby; the disk of either may be full."""

    def __init__(self, source):
        self.folders = [tempfile.TemporaryDirectory(), tempfile.TemporaryDirectory()]
        self.primary, self.standby = (folder.name for folder in self.folders)
        self.disks = {folder: HostFaults(folder, files=folder + "/data/") for folder in (self.primary, self.standby)}
        self.script = pathlib.Path(source, "tests", "support", "postgresql.sh")
        self.url = f"postgresql://joulecast@/postgres?host={self.primary},{self.standby}&target_session_attrs=read-write"

    def tell(self, what, *folders):
        folders = folders or [self.primary]
        return subprocess.run([self.script, what, *folders], env=os.environ | self.disks[folders[-1]].environment).returncode

    def add_standby(self):
        """Starts the standby in the folder that the primary does not use; existing content is deleted."""
        other = next(folder for folder in self.disks if folder != self.primary)
        shutil.rmtree(pathlib.Path(other, "data"), ignore_errors=True)
        check(self.tell("standby", self.primary, other) == 0, "the standby did not start")
        self.standby = other

    def fail_over(self):
        """The primary crashes permanently, and the standby replaces it."""
        check(self.tell("stop") == 0, "the primary did not stop")
        check(self.tell("promote", self.standby) == 0, "the standby was not promoted")
        self.primary, self.standby = self.standby, None

    def end(self):
        for folder in filter(None, (self.primary, self.standby)):
            self.tell("stop", folder)

    def rows(self, text):
        done = subprocess.run(["psql", self.url, "-XqtAF", "\t", "-c", text], capture_output=True, text=True)
        check(done.returncode == 0, f"psql: {done.stderr}")
        return [line.split("\t") for line in done.stdout.splitlines()]

    def takes_writes(self):
        """True if a row can be written now."""
        return subprocess.run(["psql", self.url, "-Xqc", "CREATE TEMPORARY TABLE t AS SELECT 1; SELECT txid_current()"],
                              capture_output=True, timeout=30).returncode == 0


class Connection:
    """One of PostgreSQL's connections, by its protocol; refused if none is left."""

    def __init__(self, folder):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(10)
        self.socket.connect(folder + "/.s.PGSQL.5432")
        words = b"user\0joulecast\0database\0postgres\0application_name\0test\0\0"
        self.socket.sendall(struct.pack(">ii", 8 + len(words), 196608) + words)
        self.refused = self.socket.recv(1) == b"E"

    def say(self, query):
        """Drops pending answers."""
        try:
            self.socket.recv(1 << 20, socket.MSG_DONTWAIT)
        except BlockingIOError:
            pass
        self.socket.sendall(b"Q" + struct.pack(">i", 5 + len(query)) + query.encode() + b"\0")

    def close(self):
        self.socket.close()


class Relay:
    """The link between one daemon and PostgreSQL; when cut, it accepts bytes of both and forwards none."""

    def __init__(self, server):
        self.server, self.open = server, threading.Event()
        self.open.set()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"postgresql://joulecast@127.0.0.1:{self.listener.getsockname()[1]}/postgres"
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            client, _ = self.listener.accept()
            threading.Thread(target=self.connect, args=(client,), daemon=True).start()

    def connect(self, client):
        self.open.wait()
        database = socket.socket(socket.AF_UNIX)
        try:
            database.connect(self.server.primary + "/.s.PGSQL.5432")
        except OSError:
            client.close()
            return
        for one, other in ((client, database), (database, client)):
            threading.Thread(target=self.carry, args=(one, other), daemon=True).start()

    def carry(self, one, other):
        try:
            while data := one.recv(65536):
                self.open.wait()
                other.sendall(data)
        except OSError:
            pass
        for end in (one, other):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass


class Node(Programs):
    """A daemon of the cluster."""

    def __init__(self, arguments, name, url, lcm_url):
        super().__init__(arguments)
        self.name, self.lcm_url = name, lcm_url
        self.settings = ["--store-url", url, "--cluster-name", "test", "--cluster-node", name,
                         "--cluster-lease-s", str(LEASE_S)]

    def post(self, path, document, headers=()):
        request = urllib.request.Request(self.url + path, data=json.dumps(document).encode(),
                                         headers={"Content-Type": "application/json"} | dict(headers))
        with urllib.request.urlopen(request, timeout=30) as reply:
            return json.load(reply)

    def is_ready(self):
        try:
            urllib.request.urlopen(self.url + "/readyz", timeout=10)
        except (urllib.error.URLError, OSError):
            return False
        return True

    def send(self, which):
        self.process.send_signal(which)


class Cluster:
    def __init__(self, arguments, server):
        first = Programs(arguments)
        self.server, self.lcm_url = server, first.lcm_url
        self.relay = Relay(server)
        urls = (server.url, server.url, self.relay.url)
        self.nodes = {name: Node(arguments, name, url, first.lcm_url) for name, url in zip(NODES, urls)}

    def keepers(self):
        """Daemon by robot; only leases of daemons that are members."""
        return dict(self.server.rows("SELECT robot_id, node FROM cluster_lease JOIN cluster_node USING (node)"))

    def of(self, name):
        return sorted(robot for robot, node in self.keepers().items() if node == name)

    def positions(self):
        return {robot: int(us) for robot, us in
                self.server.rows("SELECT robot_id, coalesce(utime_us, 0) FROM cluster_lease")}

    def is_spread(self, robots):
        held = self.keepers()
        return len(held) == robots and set(held.values()) == set(self.nodes)
