"""Compares assign.py with nearest-robot assignment on virtual fleets: 30 tasks for 10 robots, by default of four kinds.

    /usr/bin/python3 assign_trial.py 1 2 3      # seeds; --robot amr.json: all of this kind

Each seed makes a fleet with a history of three missions a robot, of which joulecastd forecasts what each robot usually spends.
Places are drawn on a floor of 100 m by 60 m, charges from 16 to 30 %, above the robots' reserve of 15 %.
joulecast and joulecastd must be on the PATH.
"""
import argparse
import contextlib
import math
import random
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from assign import EACH, along, assign, prices
from joulecast_client import Client


@contextlib.contextmanager
def daemon(folder: Path) -> Iterator[Client]:
    """A joulecastd with its history in the folder."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = str(probe.getsockname()[1])
    with open(folder / "joulecastd.log", "w") as log:
        process = subprocess.Popen(["joulecastd", "--store-path", folder / "fleet.db", "--lcm-url", "memq://",
                                    "--http-port", port], stdout=log, stderr=log)
    try:
        while True:
            with contextlib.suppress(OSError):
                client = Client(f"http://127.0.0.1:{port}")
                break
            if process.poll() is not None:
                raise SystemExit((folder / "joulecastd.log").read_text())
            time.sleep(0.1)
        yield client
    finally:
        process.terminate()
        process.wait()


def make_history(folder: Path, robots: int, seed: int, kinds: list[str] = []) -> None:
    """Stores the missions of virtual robots, of the kinds of these options of joulecast simulate."""
    with daemon(folder) as joulecast:
        subprocess.run(["joulecast", "simulate", "--robots", str(robots), "--seed", str(seed), "--missions", "3", "--rate", "10",
                        "--mission-duration", "60", "--speed", "0", "--log", folder / "fleet.lcmlog", "--quiet",
                        "--server", joulecast.url, *kinds], check=True)
    subprocess.run(["joulecast", "replay", folder / "fleet.lcmlog", "--into", folder / "fleet.db"], check=True,
                   stdout=subprocess.DEVNULL)


def draw_request(joulecast: Client, tasks: int, seed: int) -> dict:
    """Poses and charges of the daemon's robots, and tasks: half with a payload for all robots, half for some."""
    draw = random.Random(seed)

    def place() -> dict:
        return {"x_m": round(draw.uniform(0, 100), 2), "y_m": round(draw.uniform(0, 60), 2)}

    robots = [{"robot_id": robot["robot_id"], "pose": place() | {"heading_rad": 0},
               "state_of_charge": round(draw.uniform(0.16, 0.3), 4)} for robot in joulecast.pages("listRobots")]
    return {"robots": robots, "tasks": [{"task_id": f"task-{k + 1}", "pickup": place(), "dropoff": place(),
                                         "payload_kg": draw.choice([5, 5, 10, 40])} for k in range(tasks)]}


def nearest(request: dict, energy_j: np.ndarray, duration_s: np.ndarray, budgets_j: np.ndarray) -> list[list[int]]:
    """Of the open tasks and the robots that are free first and able, the nearest pair is next; the same limits as of assign()."""
    routes = [[] for _ in budgets_j]
    undone = set(range(len(request["tasks"])))
    while True:
        pairs = []
        for robot, route in enumerate(routes):
            at = request["tasks"][route[-1]]["dropoff"] if route else request["robots"][robot]["pose"]
            free_s = along(duration_s[robot], np.array(route)) if route else 0
            for task in undone if len(route) < EACH else ():
                if along(energy_j[robot], np.array([*route, task])) <= budgets_j[robot]:
                    to = request["tasks"][task]["pickup"]
                    pairs.append((free_s, math.hypot(to["x_m"] - at["x_m"], to["y_m"] - at["y_m"]), robot, task))
        if not pairs:
            return routes
        _, _, robot, task = min(pairs)
        routes[robot].append(task)
        undone.remove(task)


def total(costs: np.ndarray, routes: list[list[int]], combine=sum) -> float:
    """Sum, or another combination, of the robots' costs along their routes."""
    return combine(float(along(costs[robot], np.array(route))) for robot, route in enumerate(routes) if route)


def main() -> None:
    arguments = argparse.ArgumentParser()
    arguments.add_argument("seeds", type=int, nargs="+")
    arguments.add_argument("--robot")
    options = arguments.parse_args()
    savings = []
    for seed in options.seeds:
        with tempfile.TemporaryDirectory() as name:
            make_history(Path(name), 10, seed, ["--robot", options.robot] if options.robot else [])
            with daemon(Path(name)) as joulecast:
                request = draw_request(joulecast, 30, seed)
                energy_j, duration_s, budgets_j = prices(joulecast, request)
        usual = nearest(request, energy_j, duration_s, budgets_j)
        undone = 30 - sum(map(len, usual))
        if undone:
            print(f"seed {seed}: nearest robots leave {undone} tasks undone", flush=True)
            continue
        least = assign(energy_j, duration_s, budgets_j, total(duration_s, usual, max))
        savings.append(100 * (1 - total(energy_j, least) / total(energy_j, usual)))
        print(f"seed {seed}: nearest robots {total(energy_j, usual) / 1000:.1f} kJ in {total(duration_s, usual, max):.0f} s, "
              f"least energy {total(energy_j, least) / 1000:.1f} kJ in {total(duration_s, least, max):.0f} s, "
              f"saved {savings[-1]:.1f} %", flush=True)
    if savings:
        print(f"saved on average {sum(savings) / len(savings):.1f} %, from {min(savings):.1f} to {max(savings):.1f} %")


if __name__ == "__main__":
    main()
