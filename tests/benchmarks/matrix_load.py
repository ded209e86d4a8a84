#!/usr/bin/env python3
"""The energy matrix over HTTP: time to the last byte, memory and CPU of the daemon, and its CPU after the client
disconnects.

  matrix_load.py --daemon PROGRAM --source DIR [--robots 1000] [--tasks 1000] [--models 4] [--without-charge]

Without charges the answer has no probabilities; the difference is their cost.
"""
import argparse
import http.client
import json
import pathlib
import random
import socket
import subprocess
import tempfile
import time


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def memory_mb(pid, line="VmHWM"):
    for text in pathlib.Path(f"/proc/{pid}/status").read_text().splitlines():
        if text.startswith(line + ":"):
            return int(text.split()[1]) / 1024
    return 0


def cpu_seconds(pid):
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / 100


class Api:
    def __init__(self, port):
        self.port = port

    def open(self, method, path, body=None):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=120)
        connection.request(method, path, None if body is None else json.dumps(body), {"Content-Type": "application/json"})
        return connection, connection.getresponse()

    def call(self, method, path, body=None):
        connection, reply = self.open(method, path, body)
        text = reply.read()
        connection.close()
        return reply.status, text


def fleet(options, api):
    """Robots of the shipped files. Each model after the first four has its own parameters, as after calibration."""
    chance = random.Random(7)
    files = [json.loads((pathlib.Path(options.source) / "deploy/robots" / f"{name}.json").read_text())
             for name in ("amr", "tug", "nomad", "p3dx")]
    models = []
    for k in range(options.models):
        model = json.loads(json.dumps(files[k % 4]))
        if k >= 4:
            for name in ("resistance_ohm", "viscous_friction_nm_s_rad"):
                model["motor"][name] *= chance.uniform(0.8, 1.2)
            model["mass"]["chassis_kg"] *= chance.uniform(0.9, 1.1)
        if options.regeneration is not None:
            model["effects"] = {"no_regeneration": {"fraction": 1 - options.regeneration}}
        models.append(model)
    names = []
    for k in range(options.robots):
        names.append(f"robot-{k:04}")
        status, text = api.call("PUT", f"/v1/robots/{names[-1]}", {**models[k % len(models)], "robot_id": names[-1]})
        assert status in (200, 201), (status, text)
    return names


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--daemon", required=True)
    arguments.add_argument("--source", required=True)
    arguments.add_argument("--robots", type=int, default=1000)
    arguments.add_argument("--tasks", type=int, default=1000)
    arguments.add_argument("--models", type=int, default=4)
    arguments.add_argument("--regeneration", type=float)
    arguments.add_argument("--without-charge", action="store_true")
    options = arguments.parse_args()
    chance = random.Random(3)
    with tempfile.TemporaryDirectory() as folder:
        port = free_port()
        daemon = subprocess.Popen([options.daemon, "--store-path", f"{folder}/h.db", "--http-port", str(port), "--lcm-url",
                                   "memq://", "--log-level", "warning"])
        try:
            api = Api(port)
            for _ in range(200):
                try:
                    if api.call("GET", "/readyz")[0] == 200:
                        break
                except OSError:
                    time.sleep(0.05)
            names = fleet(options, api)
            place = lambda: {"x_m": round(chance.uniform(0, 120), 2), "y_m": round(chance.uniform(0, 80), 2)}
            charge = lambda: {} if options.without_charge else {"state_of_charge": round(chance.uniform(0.15, 1), 3)}
            request = {
                "robots": [{"robot_id": name, "pose": {**place(), "heading_rad": round(chance.uniform(-3, 3), 3)}, **charge()} for name in names],
                "tasks": [{"task_id": f"task-{k}", "payload_kg": round(chance.uniform(0, 60), 2), "pickup": place(),
                           "dropoff": {**place(), "heading_rad": 1.57}, "pickup_dwell_s": 10} for k in range(options.tasks)]}
            print(f"before: resident {memory_mb(daemon.pid, 'VmRSS'):.0f} MB; {options.models} different models")
            for trial in ("cold", "warm", "warm", "warm"):
                cpu, began = cpu_seconds(daemon.pid), time.perf_counter()
                connection, reply = api.open("POST", "/v1/energy-matrix", request)
                first, size = None, 0
                pieces = []
                while piece := reply.read1(1 << 20):
                    first = first or time.perf_counter() - began
                    pieces.append(piece)
                    size += len(piece)
                took = time.perf_counter() - began
                connection.close()
                print(f"{trial}: {took:.3f} s to the last of {size / 1e6:.1f} MB (first byte {first:.3f} s), "
                      f"{cpu_seconds(daemon.pid) - cpu:.2f} s CPU, peak resident {memory_mb(daemon.pid):.0f} MB")
            answer = json.loads(b"".join(pieces))
            rows = answer["rows"]
            cells = sum(len(row["energy_j"]) for row in rows)
            likely = sum(value is not None for row in rows for value in row["success_probability"] or ())
            feasible = sum(value is not None for row in rows for value in row["energy_j"])
            print(f"{len(rows)} x {len(answer['tasks'])}: {cells} cells, {feasible} feasible, {likely} with a probability; largest interpolation error "
                  f"{max(row['interpolation_error'] for row in rows):.1e}")
            connection, reply = api.open("POST", "/v1/energy-matrix", request)
            reply.read(100_000)
            cpu = cpu_seconds(daemon.pid)
            connection.sock.shutdown(socket.SHUT_RDWR)
            connection.close()
            time.sleep(1)
            spent = cpu_seconds(daemon.pid) - cpu
            time.sleep(0.5)
            print(f"client left after 100 kB: {spent:.2f} s CPU more, then {cpu_seconds(daemon.pid) - cpu - spent:.2f} s")
        finally:
            daemon.terminate()
            daemon.wait()


if __name__ == "__main__":
    main()
