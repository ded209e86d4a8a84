#!/usr/bin/env python3
"""Expensive requests of several clients at the same time: probes and reads are answered, memory stays bounded, the request of
a disconnected client is cancelled, and SIGTERM ends the daemon in time."""
import json
import math
import pathlib
import socket
import threading
import time
import urllib.error
import urllib.request

from harness import PATIENCE, Programs, arguments, check

PROBE_P99_S = 0.5  # on a machine that runs other tests too
RSS_MIB = 1024 if PATIENCE == 1 else 2048  # with shadow, redzones and quarantine of the address sanitizer
STOP_S = 15
# Valid but unusual robot files.
ODD = {"gear-1": ("motor", "gear_ratio", 1.0), "gear-1000": ("motor", "gear_ratio", 1000.0),
       "battery-3-v": ("battery", "nominal_voltage_v", 3.0)}


def post(programs, path, document, timeout=90):
    request = urllib.request.Request(programs.url + path, method="POST", data=json.dumps(document).encode(),
                                     headers={"Content-Type": "application/json"})
    try:
        with urllib.request.urlopen(request, timeout=timeout) as reply:
            return reply.status, len(reply.read())
    except urllib.error.HTTPError as error:
        return error.code, len(error.read())


def memory_mib(programs, name="VmHWM"):
    status = pathlib.Path(f"/proc/{programs.process.pid}/status").read_text()
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith(name)) / 1024


def cpu_s(programs):
    fields = pathlib.Path(f"/proc/{programs.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / 100


class Probes(threading.Thread):
    """Repeats the requests of a supervisor and of an operator."""

    def __init__(self, programs):
        super().__init__(daemon=True)
        self.programs, self.ended = programs, False
        self.seconds = {"/readyz": [], "/metrics": [], "/v1/missions?limit=5": []}

    def run(self):
        while not self.ended:
            for path, seconds in self.seconds.items():
                began = time.monotonic()
                with urllib.request.urlopen(self.programs.url + path, timeout=60) as reply:
                    reply.read()
                seconds.append(time.monotonic() - began)
            time.sleep(0.02)


def polyline(points):
    way = [{"x_m": 0.05 * k, "y_m": 0.02 * math.sin(0.01 * k)} for k in range(1, points + 1)]
    return {"path": [{"kind": "polyline", "points": way}]}


def corners(count, **more):
    return {"path": count // 2 * [{"kind": "straight", "length_m": 5}, {"kind": "turn", "angle_rad": 1.0}], **more}


def clothoids(count, **more):
    bends = [{"kind": "clothoid", "length_m": 2, "start_curvature_1_m": begin, "end_curvature_1_m": end} for begin, end in ((0, 0.5), (0.5, 0))]
    return {"path": count // 4 * [*bends, {"kind": "straight", "length_m": 1.5}, {"kind": "dwell", "duration_s": 1}], **more}


def ask_all(programs, requests):
    """Statuses of concurrent requests."""
    statuses = [None] * len(requests)

    def ask(k):
        statuses[k], _ = post(programs, *requests[k])
    threads = [threading.Thread(target=ask, args=(k,)) for k in range(len(requests))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return statuses


def leave_at_once(programs, path, document):
    """Sends a request and disconnects after 0.5 s."""
    body = json.dumps(document).encode()
    host, port = programs.url.split("//")[1].split(":")
    with socket.create_connection((host, int(port))) as client:
        client.sendall(f"POST {path} HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\n"
                       f"Content-Length: {len(body)}\r\n\r\n".encode() + body)
        time.sleep(0.5)


def idle_again(programs, seconds):
    """True if the daemon becomes nearly idle within `seconds`."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        before = cpu_s(programs)
        time.sleep(1)
        if cpu_s(programs) - before < 0.3:
            return True
    return False


def main():
    options = arguments()
    programs = Programs(options)
    programs.lcm_url = "memq://"
    programs.start()
    robot = json.loads((pathlib.Path(options.source) / "deploy/robots/amr.json").read_text())
    programs.put("/v1/robots/amr", robot)
    odd = []
    for name, (part, field, value) in ODD.items():
        try:
            programs.put(f"/v1/robots/{name}", robot | {"robot_id": name, part: robot[part] | {field: value}})
            odd.append(name)
        except urllib.error.HTTPError as error:
            check(error.code == 422, f"PUT of {name}: {error.code}")

    probes = Probes(programs)
    probes.start()
    task = {"task_id": "t", "path": [{"kind": "straight", "length_m": 12}]}
    for what, requests in {
            "polylines": 4 * [("/v1/robots/amr/profile", polyline(50_000))],
            "corners": 2 * [("/v1/robots/amr/profile", corners(10_000, pareto_points=200))],
            "corners in brief": 2 * [("/v1/robots/amr/profile", corners(10_000, pareto_points=200, columns=False))],
            "clothoids": 2 * [("/v1/robots/amr/profile", clothoids(10_000, pareto_points=200, columns=False))],
            "odd robots": [("/v1/energy-matrix", {"robots": [{"robot_id": name, "pose": {"x_m": 0, "y_m": 0, "heading_rad": 0}}],
                                                  "tasks": [task]}) for name in odd],
            "prices": [("/v1/energy-matrix", {"robots": ["amr"], "tasks": [task], "value_of_time_w": 1 + 0.1 * k}) for k in range(8)],
    }.items():
        began = time.monotonic()
        statuses = ask_all(programs, requests)
        check(set(statuses) <= {200, 413, 422, 429, 503}, f"{what}: {statuses}")
        print(f"{what}: {statuses} in {time.monotonic() - began:.1f} s, {memory_mib(programs):.0f} MiB")
    probes.ended = True
    probes.join()
    for path, seconds in probes.seconds.items():
        seconds.sort()
        p99 = seconds[int(0.99 * len(seconds))]
        print(f"{path}: {len(seconds)} times, 99 % within {1000 * p99:.0f} ms")
        check(len(seconds) > 20 and p99 < PROBE_P99_S, f"{path} waits {p99:.2f} s")
    check(memory_mib(programs) < RSS_MIB, f"{memory_mib(programs):.0f} MiB are in use")

    check(idle_again(programs, 20), "still computes after the last answer")
    for path, document in (("/v1/robots/amr/profile", corners(8_000, pareto_points=200)),
                           ("/v1/robots/amr/autonomy", {"state_of_charge": 0.9, "driving": "minimum_energy", "value_of_time_w": 40,
                                                        "tasks": [{"task_id": str(k), "distances_m": [3 + 0.37 * k]}
                                                                  for k in range(1000)]})):
        leave_at_once(programs, path, document)
        check(idle_again(programs, 8), f"{path}: still computes for a disconnected client")
    for _ in range(4):
        leave_at_once(programs, "/v1/robots/amr/profile", corners(8_000, pareto_points=200))
    began = time.monotonic()
    check(programs.stop() == 0, "the daemon did not stop in order")
    check(time.monotonic() - began < STOP_S, f"SIGTERM took {time.monotonic() - began:.1f} s")
    print(f"stopped in {time.monotonic() - began:.1f} s")


if __name__ == "__main__":
    main()
