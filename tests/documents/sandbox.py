"""A shell in a folder of its own, with joulecast's programs on its path and the ports of the documents made private."""

import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
from pathlib import Path

END = "__end_of_command__"
SKIP = 77


def multicast_here():
    return subprocess.run(["ip", "route", "get", "239.255.76.67"], capture_output=True).returncode == 0


def free_port(kind):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return str(probe.getsockname()[1])


def replaced(text, words):
    """Replaces all ports in one pass, as a replacement may contain another port."""
    return re.sub("|".join(words), lambda found: words[found.group()], text)


class Sandbox:
    """Replaces the ports in commands by free ones."""

    USUAL_HTTP = ["8080", "8081", "8082", "8083", "8084", "8085", "8086"]
    USUAL_LCM = ["7667", "7671", "7672", "7673", "7674"]

    def __init__(self, daemon, client, source):
        self.home = Path(tempfile.mkdtemp(prefix="joulecast-document-"))
        for name in ("deploy", "schemas", "lcmtypes", "client", "src"):
            (self.home / name).symlink_to(source.resolve() / name)
        self.ports = {usual: free_port(socket.SOCK_STREAM) for usual in self.USUAL_HTTP}
        self.ports |= {usual: free_port(socket.SOCK_DGRAM) for usual in self.USUAL_LCM}
        lcm_url = f"udpm://239.255.76.67:{self.ports['7667']}?ttl=0"
        environment = {"PATH": f"{daemon.resolve().parent}:{client.resolve().parent}:{os.environ['PATH']}",
                       "HOME": str(self.home), "LANG": "C.UTF-8", "TERM": "dumb", "PYTHONDONTWRITEBYTECODE": "1",
                       "JOULECAST_HTTP_PORT": self.ports["8080"], "JOULECAST_LCM_URL": lcm_url,
                       "LCM_DEFAULT_URL": lcm_url}
        self.shell = subprocess.Popen(["bash", "--noprofile", "--norc"], cwd=self.home, env=environment, text=True,
                                      stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                      start_new_session=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        os.killpg(self.shell.pid, signal.SIGKILL)
        self.shell.wait()
        shutil.rmtree(self.home)

    def run(self, command):
        """Its lines of output, as if it had used the usual ports, and its exit code."""
        command = replaced(command, self.ports)
        self.shell.stdin.write(f"{command}\nprintf '\\n%s %d\\n' {END} $?\n")
        self.shell.stdin.flush()
        lines = []
        for line in self.shell.stdout:
            if line.startswith(END):
                while lines and not lines[-1].strip():
                    lines.pop()
                return lines, int(line.split()[1])
            line = replaced(line, {private: usual for usual, private in self.ports.items()})
            lines.append(line.replace(str(self.home), "~").rstrip())
        raise SystemExit(f"the shell ended during: {command}")
