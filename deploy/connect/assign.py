"""Assigns tasks to robots with the least total energy within every robot's charge. Needs joulecast_client.py and python3-scipy.

    /usr/bin/python3 assign.py http://127.0.0.1:8080 request.json [deadline_s]

request.json is the body of an energy matrix: robots with a pose and a charge, tasks with places. If charge or time do not
suffice, as few tasks as possible are left undone."""
import json
import math
import sys
from itertools import combinations, permutations, product

import numpy as np
from joulecast_client import Client
from scipy.optimize import LinearConstraint, linprog, milp

EACH = 4  # tasks of a route; of 30 tasks there are 31930 sets of up to 4 and 174436 of up to 5


def prices(joulecast: Client, request: dict) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Energy [J] and duration [s] by robot, place (0: its pose, i + 1: where task i ends) and next task, infinite where the robot
    cannot do it; energy [J] that each robot may spend to keep its reserve at 95 %."""
    robots, tasks = request["robots"], request["tasks"]
    ends = [{"heading_rad": math.atan2(b["y_m"] - a["y_m"], b["x_m"] - a["x_m"]), **b}
            for a, b in ((task["pickup"], task["dropoff"]) for task in tasks)]
    starts = [robot | {"pose": pose} for robot in robots for pose in (robot["pose"], *ends)]
    rows = joulecast.computeEnergyMatrix(body={"driving": "usual", **request, "robots": starts})["rows"]
    energy_j, duration_s = (np.array([row[key] for row in rows], float).reshape(len(robots), -1, len(tasks))
                            for key in ("energy_j", "duration_s"))
    asked = [{"robot_id": robot["robot_id"], "request": {"state_of_charge": robot["state_of_charge"]}} for robot in robots]
    budgets_j = []
    for answer in joulecast.computeFleetAutonomy(body={"robots": asked})["robots"]:
        deviation = math.hypot(answer["consumption"]["common_deviation"], answer["consumption"]["leg_deviation"])
        budgets_j.append((answer["usable_energy_j"] - 1.645 * answer["usable_energy_sd_j"]) / math.exp(1.645 * deviation))
    return np.nan_to_num(energy_j, nan=np.inf), duration_s, np.array(budgets_j)


def along(costs: np.ndarray, routes: np.ndarray) -> np.ndarray:
    """Sums of one robot's costs along routes of tasks (the last axis)."""
    return costs[np.insert(routes[..., :-1] + 1, 0, 0, axis=-1), routes].sum(axis=-1)


def assign(energy_j: np.ndarray, duration_s: np.ndarray, budgets_j: np.ndarray, deadline_s: float = math.inf) -> list[list[int]]:
    """The tasks of each robot, in order. A column of the program is a robot and a set of tasks, in the order of least energy."""
    robots, _, tasks = energy_j.shape
    undone_j = energy_j[np.isfinite(energy_j)].sum()
    routes, price_j, covers = [(None, [])] * tasks, [undone_j] * tasks, [np.eye(tasks, tasks + robots)]
    for robot, count in product(range(robots), range(1, EACH + 1)):
        sets = np.array(list(combinations(range(tasks), count)))
        orders = sets[:, list(permutations(range(count)))]
        spent_j = np.where(along(duration_s[robot], orders) > deadline_s, np.inf, along(energy_j[robot], orders))
        best, least_j = spent_j.argmin(axis=1), spent_j.min(axis=1)
        able = np.flatnonzero(np.isfinite(least_j) & (least_j <= budgets_j[robot]))
        routes += [(robot, route) for route in orders[able, best[able]].tolist()]
        price_j.extend(least_j[able])
        covers.append(np.eye(tasks + robots)[sets[able]].sum(axis=1) + np.eye(tasks + robots)[tasks + robot])
    price_j, covers = np.array(price_j), np.concatenate(covers)
    # Each task once, a route a robot at most. A column whose reduced cost is above the gap is in no better assignment.
    once, free = np.split(covers.T, [tasks])
    relaxed = linprog(price_j, A_eq=once, b_eq=np.ones(tasks), A_ub=free, b_ub=np.ones(robots))
    reduced_j = price_j - covers @ np.concatenate([relaxed.eqlin.marginals, relaxed.ineqlin.marginals])
    columns = np.argsort(reduced_j)[:1000]
    for _ in range(2):
        rows = LinearConstraint(covers[columns].T, np.repeat([1, 0], [tasks, robots]), 1)
        found = milp(price_j[columns], integrality=np.ones(len(columns)), constraints=rows, options={"mip_rel_gap": 0})
        chosen, columns = columns[found.x > 0.5], np.flatnonzero(reduced_j <= found.fun - relaxed.fun + 1e-6)
    done = dict(routes[column] for column in chosen)
    return [done.get(robot, []) for robot in range(robots)]


if __name__ == "__main__":
    with open(sys.argv[2]) as file:
        request = json.load(file)
    energy_j, duration_s, budgets_j = prices(Client(sys.argv[1]), request)
    for k, route in enumerate(assign(energy_j, duration_s, budgets_j, *map(float, sys.argv[3:]))):
        spent_j = along(energy_j[k], np.array(route)) if route else 0
        print(request["robots"][k]["robot_id"], *(request["tasks"][task]["task_id"] for task in route), f"{spent_j:.0f} J")
