"""Assignments of deploy/connect/assign.py on a daemon with virtual robots, compared with every assignment that is possible.

  assign_test.py CONNECT --daemon PROGRAM --client PROGRAM [unittest's arguments]

Ends with 77 where python3-scipy is missing.
"""
import argparse
import importlib.util
import itertools
import json
import math
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

arguments = argparse.ArgumentParser()
arguments.add_argument("connect", type=Path)
arguments.add_argument("--daemon", type=Path, required=True)
arguments.add_argument("--client", type=Path, required=True)
options, rest = arguments.parse_known_args()
sys.path.insert(0, str(options.connect))
os.environ["PATH"] = f"{options.daemon.resolve().parent}:{options.client.resolve().parent}:{os.environ['PATH']}"
if importlib.util.find_spec("scipy") is None:
    print("python3-scipy is not installed")
    sys.exit(77)
import assign
import assign_trial
import numpy as np


class Assignment(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        assign_trial.make_history(folder, 3, 1)
        cls.joulecast = cls.enterClassContext(assign_trial.daemon(folder))
        cls.request = assign_trial.draw_request(cls.joulecast, 4, 1)
        for task in cls.request["tasks"]:
            task["payload_kg"] = 5
        # The second robot, which spends least a metre, has charge for one task.
        for robot, charge in zip(cls.request["robots"], (0.3, 0.156, 0.3)):
            robot["state_of_charge"] = charge
        cls.energy_j, cls.duration_s, cls.budgets_j = assign.prices(cls.joulecast, cls.request)
        cls.plans = [{route: cls.plan(robot, route) for count in range(5) for route in itertools.permutations(range(4), count)}
                     for robot in cls.request["robots"]]

    @classmethod
    def plan(cls, robot, route):
        """The autonomy of a robot for a route; None for the empty one."""
        return route and cls.joulecast.computeAutonomy(id=robot["robot_id"], body={
            "state_of_charge": robot["state_of_charge"], "compare_minimum_energy": False,
            "payload_kg": 0, "start_pose": robot["pose"], "tasks": [cls.request["tasks"][task] for task in route]})["plan"]

    def spent_j(self, robot, route):
        return self.plans[robot][route]["expected_energy_j"] if route else 0

    def least_j(self, able):
        """Energy of the best assignment, of all that give each task to a robot and are able."""
        totals = []
        for robots in itertools.product(range(3), repeat=4):
            lists = [[task for task in range(4) if robots[task] == robot] for robot in range(3)]
            for routes in itertools.product(*map(itertools.permutations, lists)):
                if all(able(robot, route) for robot, route in enumerate(routes) if route):
                    totals.append(sum(self.spent_j(robot, route) for robot, route in enumerate(routes)))
        return min(totals)

    def total_j(self, routes):
        self.assertEqual(sorted(itertools.chain(*routes)), [0, 1, 2, 3])
        return sum(self.spent_j(robot, tuple(route)) for robot, route in enumerate(routes))

    def test_prices_agree_with_autonomy(self):
        for robot, plans in enumerate(self.plans):
            for route, plan in plans.items():
                if not route:
                    continue
                price_j = assign.along(self.energy_j[robot], np.array(route))
                if math.isfinite(price_j):
                    # The means of forecasts are not additive: deviations of single legs average out along a route.
                    self.assertAlmostEqual(price_j / plan["expected_energy_j"], 1, delta=0.001 if len(route) == 1 else 0.07)
                elif len(route) == 1:
                    self.assertLess(plan["success_probability"], 0.95)

    def test_equals_best_of_all(self):
        ample_j = np.full(3, math.inf)
        sure = lambda robot, route: np.isfinite(assign.along(self.energy_j[robot], np.array(route)))
        self.assertAlmostEqual(self.total_j(assign.assign(self.energy_j, self.duration_s, ample_j)), self.least_j(sure), delta=1)

    def test_keeps_every_reserve(self):
        routes = assign.assign(self.energy_j, self.duration_s, self.budgets_j)
        for robot, route in enumerate(routes):
            if route:
                plan = self.plans[robot][tuple(route)]
                self.assertGreaterEqual(plan["success_probability"], 0.95)
                self.assertGreaterEqual(plan["legs"][-1]["arrival_charge"]["p05"], 0.15)
        likely = self.least_j(lambda robot, route: self.plans[robot][route]["success_probability"] >= 0.95)
        self.assertGreater(likely, self.least_j(lambda robot, route: True) + 1)
        self.assertAlmostEqual(self.total_j(routes), likely, delta=1)

    def test_keeps_the_deadline(self):
        free = assign.assign(self.energy_j, self.duration_s, self.budgets_j)
        deadline_s = assign_trial.total(self.duration_s, free, max) - 1
        routes = assign.assign(self.energy_j, self.duration_s, self.budgets_j, deadline_s)
        self.assertLessEqual(assign_trial.total(self.duration_s, routes, max), deadline_s)
        self.assertGreaterEqual(self.total_j(routes), self.total_j(free))

    def test_beats_nearest_robots(self):
        ample_j = np.full(3, math.inf)
        spent_j = []
        for seed in range(1, 6):
            request = assign_trial.draw_request(self.joulecast, 4, seed)
            energy_j, duration_s, _ = assign.prices(self.joulecast, request)
            usual = assign_trial.nearest(request, energy_j, duration_s, ample_j)
            least = assign.assign(energy_j, duration_s, ample_j, assign_trial.total(duration_s, usual, max))
            spent_j.append([assign_trial.total(energy_j, routes, sum) for routes in (least, usual)])
        for least_j, usual_j in spent_j:
            self.assertLessEqual(least_j, usual_j + 1)
        self.assertLess(sum(least for least, _ in spent_j), 0.95 * sum(usual for _, usual in spent_j))

    def test_prints_every_route(self):
        with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
            json.dump(self.request, file)
            file.flush()
            printed = subprocess.run([sys.executable, "-B", options.connect / "assign.py", self.joulecast.url, file.name],
                                     check=True, capture_output=True, text=True).stdout
        routes = assign.assign(self.energy_j, self.duration_s, self.budgets_j)
        self.assertEqual([line.split()[:-2] for line in printed.splitlines()],
                         [[robot["robot_id"], *(f"task-{task + 1}" for task in route)]
                          for robot, route in zip(self.request["robots"], routes)])

    def test_leaves_tasks_without_charge(self):
        self.assertEqual(assign.assign(self.energy_j, self.duration_s, self.budgets_j * 0), [[], [], []])


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *rest])
