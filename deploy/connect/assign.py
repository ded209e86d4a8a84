"""Assigns tasks to robots with the least total energy within every robot's charge. Needs joulecast_client.py and Debian's
python3-scipy.

    /usr/bin/python3 assign.py http://127.0.0.1:8080 request.json [deadline_s]

request.json is the body of an energy matrix: robots with a pose and a charge, tasks with places. The matrix prices each robot's
routes, lists of up to EACH tasks; the autonomy returns its energy above the reserve. HiGHS selects the routes that do every task
once with the least energy. If charge or time do not suffice, as few tasks as possible are left undone.
"""
import json
import math
import sys
from itertools import combinations, permutations
from statistics import NormalDist

import numpy as np
from joulecast_client import Client
from scipy.optimize import LinearConstraint, OptimizeResult, linprog, milp

EACH = 4  # tasks of a route; of 30 tasks there are 31930 sets of up to 4 and 174436 of up to 5


def prices(joulecast: Client, request: dict) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Energy [J] and duration [s] by robot, place (0: its pose, i + 1: where task i ends) and next task, infinite where the robot
    cannot do it; energy [J] that each robot may spend to keep its reserve at 95 % by the deviations of its forecast."""
    robots, tasks = request["robots"], request["tasks"]
    ends = [{"heading_rad": math.atan2(b["y_m"] - a["y_m"], b["x_m"] - a["x_m"]), **b}
            for a, b in ((task["pickup"], task["dropoff"]) for task in tasks)]
    starts = [robot | {"pose": pose} for robot in robots for pose in (robot["pose"], *ends)]
    rows = joulecast.computeEnergyMatrix(body={"driving": "usual", **request, "robots": starts})["rows"]
    energy_j, duration_s, probability = (
        np.nan_to_num(np.array([row[key] for row in rows], float), nan=np.inf).reshape(len(robots), -1, len(tasks))
        for key in ("energy_j", "duration_s", "success_probability"))
    energy_j[probability < 0.95] = np.inf
    asked = [{"robot_id": robot["robot_id"], "request": {"state_of_charge": robot["state_of_charge"]}} for robot in robots]
    sigmas, budgets_j = NormalDist().inv_cdf(0.95), []
    for answer in joulecast.computeFleetAutonomy(body={"robots": asked})["robots"]:
        deviation = math.hypot(answer["consumption"]["common_deviation"], answer["consumption"]["leg_deviation"])
        budgets_j.append((answer["usable_energy_j"] - sigmas * answer["usable_energy_sd_j"]) / math.exp(sigmas * deviation))
    return energy_j, duration_s, np.array(budgets_j)


def along(costs: np.ndarray, routes: np.ndarray) -> np.ndarray:
    """Sums of one robot's costs along routes of tasks (the last axis)."""
    return costs[np.insert(routes[..., :-1] + 1, 0, 0, axis=-1), routes].sum(axis=-1)


def assign(energy_j: np.ndarray, duration_s: np.ndarray, budgets_j: np.ndarray, deadline_s: float = math.inf) -> list[list[int]]:
    """The tasks of each robot, in order. A column of the program is a robot and a set of tasks, in the order of least energy that
    its charge and the deadline allow. Columns enter while their reduced cost is negative. An assignment of these is the upper
    bound; the columns that a better one can contain are selected from again, so that the result is optimal."""
    robots, _, tasks = energy_j.shape
    undone_j = np.full(tasks, energy_j[np.isfinite(energy_j)].sum())
    routes, price_j, covers = [(None, [])] * tasks, [undone_j], [np.eye(tasks, tasks + robots)]
    for count in range(1, EACH + 1):
        sets = np.array(list(combinations(range(tasks), count)))
        orders = sets[:, list(permutations(range(count)))]
        for robot in range(robots):
            spent_j = along(energy_j[robot], orders)
            spent_j[(spent_j > budgets_j[robot]) | (along(duration_s[robot], orders) > deadline_s)] = np.inf
            able, best = np.flatnonzero(np.isfinite(spent_j).any(axis=1)), spent_j.argmin(axis=1)
            routes += [(robot, route) for route in orders[able, best[able]].tolist()]
            price_j.append(spent_j[able, best[able]])
            covers.append(np.zeros((len(able), tasks + robots)))
            np.put_along_axis(covers[-1], sets[able], 1, axis=1)
            covers[-1][:, tasks + robot] = 1
    price_j, covers = np.concatenate(price_j), np.concatenate(covers)

    columns, entering = np.arange(0), np.arange(tasks)
    while len(entering):
        columns = np.union1d(columns, entering)
        once, free = np.split(covers[columns].T, [tasks])
        relaxed = linprog(price_j[columns], A_eq=once, b_eq=np.ones(tasks), A_ub=free, b_ub=np.ones(robots))
        reduced_j = price_j - covers @ np.concatenate([relaxed.eqlin.marginals, relaxed.ineqlin.marginals])
        entering = np.argsort(reduced_j)[:1000]
        entering = np.setdiff1d(entering[reduced_j[entering] < -1e-6], columns)
    found = select(price_j[columns], covers[columns], tasks)
    columns = np.flatnonzero(reduced_j <= found.fun - relaxed.fun + 1e-6)
    best = select(price_j[columns], covers[columns], tasks)
    done = dict(routes[column] for column in columns[best.x > 0.5])
    return [done.get(robot, []) for robot in range(robots)]


def select(price_j: np.ndarray, covers: np.ndarray, tasks: int) -> OptimizeResult:
    """The cheapest columns that do each task once, with one route a robot at most."""
    rows = LinearConstraint(covers.T, np.repeat([1, 0], [tasks, covers.shape[1] - tasks]), 1)
    return milp(price_j, integrality=np.ones(len(price_j)), constraints=rows, options={"mip_rel_gap": 0})


if __name__ == "__main__":
    with open(sys.argv[2]) as file:
        request = json.load(file)
    energy_j, duration_s, budgets_j = prices(Client(sys.argv[1]), request)
    for k, route in enumerate(assign(energy_j, duration_s, budgets_j, *map(float, sys.argv[3:]))):
        spent_j = along(energy_j[k], np.array(route)) if route else 0
        print(request["robots"][k]["robot_id"], *(request["tasks"][task]["task_id"] for task in route), f"{spent_j:.0f} J")
