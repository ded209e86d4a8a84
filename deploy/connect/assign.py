"""Assigns tasks to robots with the least total energy within every robot's charge; needs joulecast_client.py and python3-scipy.
Usage: /usr/bin/python3 assign.py http://127.0.0.1:8080 request.json [deadline_s], request.json the body of an energy matrix."""
import json
import sys
from itertools import combinations, permutations, product

import numpy as np
from joulecast_client import Client
from scipy.optimize import linprog, milp

EACH = 4  # tasks of a route; of 30 tasks there are 31930 sets of up to 4 and 174436 of up to 5


def prices(joulecast: Client, request: dict) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Energy [J] and duration [s] by robot, place (0: its pose, i + 1: where task i ends) and next task, infinite where the robot
    cannot do it; energy [J] that each robot may spend on two tasks or more to keep its reserve at 95 %."""
    robots, ways = request["robots"], [(task["pickup"], task["dropoff"]) for task in request["tasks"]]
    ends = [{"heading_rad": np.arctan2(b["y_m"] - a["y_m"], b["x_m"] - a["x_m"]), **b} for a, b in ways]
    starts = [robot | {"pose": pose} for robot in robots for pose in (robot["pose"], *ends)]
    rows = joulecast.computeEnergyMatrix(body={"driving": "usual", **request, "robots": starts})["rows"]
    costs = np.array([[row["energy_j"], row["duration_s"]] for row in rows], float).reshape(len(robots), -1, 2, len(ways))
    asked = [{"robot_id": robot["robot_id"], "request": {"state_of_charge": robot["state_of_charge"]}} for robot in robots]
    forecasts = joulecast.computeFleetAutonomy(body={"robots": asked})["robots"]
    spread = [np.hypot(f["consumption"]["common_deviation"], f["consumption"]["leg_deviation"] / 2**0.5) for f in forecasts]
    budgets_j = [f["usable_energy_j"] - 1.645 * f["usable_energy_sd_j"] for f in forecasts] / np.exp(1.645 * np.array(spread))
    return np.nan_to_num(costs[:, :, 0], nan=np.inf), costs[:, :, 1], budgets_j


def along(costs: np.ndarray, routes: np.ndarray) -> np.ndarray:
    """Sums of one robot's costs along routes of tasks (the last axis)."""
    return costs[np.insert(routes[..., :-1] + 1, 0, 0, axis=-1), routes].sum(axis=-1)


def assign(energy_j: np.ndarray, duration_s: np.ndarray, budgets_j: np.ndarray, deadline_s: float = np.inf) -> list[list[int]]:
    """The tasks of each robot, in order. A column of the program is a robot and a set of tasks, in the order of least energy."""
    robots, _, tasks = energy_j.shape
    columns = [(energy_j[np.isfinite(energy_j)].sum(), robots, [task]) for task in range(tasks)]  # of no robot: left undone
    for robot, count in product(range(robots), range(1, EACH + 1)):
        orders = np.array(list(combinations(range(tasks), count)))[:, list(permutations(range(count)))]
        spent_j = np.where(along(duration_s[robot], orders) > deadline_s, np.inf, along(energy_j[robot], orders))
        best = zip(spent_j.min(axis=1), orders[np.arange(len(orders)), spent_j.argmin(axis=1)].tolist())
        columns += [(least_j, robot, route) for least_j, route in best if least_j < np.inf and least_j <= budgets_j[robot]]
    price_j, robot_of, routes = zip(*columns)
    price_j, bound = np.array(price_j), np.repeat([-1, 1], [tasks, robots])
    covers = np.array([np.bincount([*route, tasks + k], minlength=tasks + robots + 1)[:-1] for k, route in zip(robot_of, routes)])
    # Each task once, a route a robot at most. A column whose reduced cost is above the gap is in no better assignment.
    relaxed = linprog(price_j, A_ub=(bound * covers).T, b_ub=bound)
    reduced_j = price_j - bound * covers @ relaxed.ineqlin.marginals
    able = np.argsort(reduced_j)[:1000]
    for _ in range(2):
        found = milp(price_j[able], integrality=1, constraints=(covers[able].T, bound < 0, 1), options={"mip_rel_gap": 0})
        chosen, able = able[found.x > 0.5], np.flatnonzero(reduced_j <= found.fun - relaxed.fun + 1e-6)
    return [next((routes[k] for k in chosen if robot_of[k] == robot), []) for robot in range(robots)]


if __name__ == "__main__":
    request = json.load(open(sys.argv[2]))
    energy_j, *limits = prices(Client(sys.argv[1]), request)
    for robot, costs, route in zip(request["robots"], energy_j, assign(energy_j, *limits, *map(float, sys.argv[3:]))):
        print(robot["robot_id"], *(request["tasks"][k]["task_id"] for k in route), f"{along(costs, np.array(route, int)):.0f} J")
