"""`joulecast export rmf` on a daemon with missions of a virtual robot, compared with a Python version of the power sinks of
Open-RMF's rmf_battery, written from their description.

  rmf_test.py CONNECT --daemon PROGRAM --client PROGRAM [unittest's arguments]

Ends with 77 where python3-numpy or python3-yaml is missing.
"""
import argparse
import importlib.util
import json
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
if any(importlib.util.find_spec(name) is None for name in ("numpy", "scipy", "yaml")):
    print("python3-scipy or python3-yaml is not installed")
    sys.exit(77)
import assign_trial
import numpy as np
import yaml

STEP_S = 0.5
TYPICAL = """# the fleet
rmf_fleet:
  name: amr # as the adapter names it
  limits:
    linear: [1.5, 0.6] # velocity, acceleration
  battery_system:
    voltage: 24.0 # V
    capacity: 40.0 # Ahr
    charging_current: 26.4 # A
  mechanical_system:
    mass: 80.0 # kg
    moment_of_inertia: 20.0 #kgm^2
    friction_coefficient: 0.20
  ambient_system:
    power: 20.0 # W
  tool_system:
    power: 760.0 # W
  recharge_threshold: 0.10
"""


class Trajectory:
    """Cubic splines of the way and the heading through knots every half second, as RMF makes them of waypoints."""

    def __init__(self, time_s, speed, yaw_rate):
        self.knots = np.arange(time_s[0], time_s[-1], STEP_S)
        means = [np.interp(self.knots, time_s, np.convolve(rate, np.ones(self.window(time_s)) / self.window(time_s), "same"))
                 for rate in (speed, yaw_rate)]
        self.rates = np.array(means)
        self.places = np.hstack([np.zeros((2, 1)), np.cumsum((self.rates[:, 1:] + self.rates[:, :-1]) / 2 * STEP_S, axis=1)])

    @staticmethod
    def window(time_s):
        return max(1, round(STEP_S / np.median(np.diff(time_s))))

    def at(self, k):
        """Velocity and acceleration of the spline at the start of its piece k."""
        p0, p1, v0, v1 = self.places[:, k], self.places[:, k + 1], self.rates[:, k], self.rates[:, k + 1]
        return v0, 6 * (p1 - p0) / STEP_S**2 - (4 * v0 + 2 * v1) / STEP_S


def motion_charge(configuration, trajectory):
    """The share of the battery that SimpleMotionPowerSink takes."""
    battery, mechanics = configuration["battery_system"], configuration["mechanical_system"]
    joules = 0.0
    for k in range(len(trajectory.knots) - 1):
        (v, w), (a, alpha) = np.abs(trajectory.at(k))
        joules += mechanics["mass"] * a * v * STEP_S + mechanics["moment_of_inertia"] * alpha * w * STEP_S
        joules += mechanics["friction_coefficient"] * mechanics["mass"] * 9.81 * v * STEP_S
    return joules / battery["voltage"] / (battery["capacity"] * 3600)


def device_charge(configuration, power, run_time_s):
    """The share of the battery that SimpleDevicePowerSink takes."""
    battery = configuration["battery_system"]
    return power * run_time_s / battery["voltage"] / (battery["capacity"] * 3600)


class OpenRmf(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        robot = json.loads((options.connect.parent / "robots/amr.json").read_text())
        cls.robot = cls.folder / "amr.json"
        cls.robot.write_text(json.dumps(robot))
        log, store = cls.folder / "amr.lcmlog", cls.folder / "fleet.db"
        for command in (["simulate", "--robots", "1", "--robot", cls.robot, "--seed", "4", "--missions", "24",
                         "--mission-duration", "90", "--rate", "20", "--speed", "0", "--log", log, "--quiet"],
                        ["replay", log, "--into", store, "--robot", cls.robot]):
            subprocess.run([options.client, *command], check=True, capture_output=True)
        cls.joulecast = cls.enterClassContext(assign_trial.daemon(cls.folder))
        cls.kinematics, cls.capacity_ah = robot["kinematics"], robot["battery"]["capacity_ah"]
        (cls.folder / "typical.yaml").write_text(TYPICAL)
        cls.answer = json.loads(cls.export("--json", "--config", cls.folder / "typical.yaml"))
        listed = cls.joulecast.listMissions(robot_id="amr", state="finished", limit=60)["missions"]
        cls.missions = [cls.mission(one) for one in listed]

    @classmethod
    def export(cls, *more, check=True):
        done = subprocess.run([options.client, "export", "rmf", "--server", cls.joulecast.url, "--robot-id", "amr", *more],
                              check=check, capture_output=True, text=True)
        return done.stdout if check else done

    @classmethod
    def mission(cls, listed):
        """Trajectory, duration, and the share of the battery that it took."""
        t = cls.joulecast.getMissionTelemetry(id=listed["id"], limit=100000)
        time_s = (np.array(t["utime_us"]) - t["utime_us"][0]) * 1e-6
        right, left = cls.kinematics["wheel_radius_m"] * np.array(t["wheel_velocity_rad_s"])
        way = Trajectory(time_s, (right + left) / 2, (right - left) / (2 * cls.kinematics["half_track_m"]))
        amperes = np.array(t["battery_current_a"])
        charge = np.trapezoid(amperes, time_s) if hasattr(np, "trapezoid") else np.trapz(amperes, time_s)
        return way, time_s[-1], charge / (cls.capacity_ah * 3600)

    def errors(self, configuration):
        """Relative errors of the charge that RMF computes for each mission."""
        return np.array([(motion_charge(configuration, way)
                          + device_charge(configuration, configuration["ambient_system"]["power"], duration_s)) / taken - 1
                         for way, duration_s, taken in self.missions])

    def test_errors_are_those_of_the_sinks(self):
        """Each third mission is held out; 1.5 percentage points are the difference between means and samples."""
        self.assertEqual(self.answer["missions"], {"fitted": 16, "held_out": 8})
        held_out = self.errors(self.answer)[2::3]
        self.assertAlmostEqual(np.mean(np.abs(held_out)), self.answer["error"]["absolute_relative"], delta=0.015)
        self.assertAlmostEqual(np.mean(held_out), self.answer["error"]["bias_relative"], delta=0.015)
        before = yaml.safe_load(TYPICAL)["rmf_fleet"]
        # Before, the voltage differs too, which the errors of energies leave out.
        before["battery_system"]["voltage"] = self.answer["battery_system"]["voltage"]
        self.assertAlmostEqual(np.mean(np.abs(self.errors(before)[2::3])), self.answer["error_before"]["absolute_relative"],
                               delta=0.05)

    def test_fitted_values_predict_charge(self):
        self.assertLess(self.answer["error"]["absolute_relative"], 0.5 * self.answer["error_before"]["absolute_relative"])
        self.assertLess(self.answer["error"]["absolute_relative"], 0.12)
        self.assertLess(abs(np.mean(self.errors(self.answer))), 0.03)

    def test_no_other_value_fits_better(self):
        def loss(configuration):
            errors = self.errors(configuration)
            taken = np.array([charge for _, _, charge in self.missions])
            fitted = np.arange(len(errors)) % 3 != 2
            return np.sum((errors * taken)[fitted] ** 2 / np.array([s for _, s, _ in self.missions])[fitted])

        best = loss(self.answer)
        for section, key in (("mechanical_system", "mass"), ("mechanical_system", "friction_coefficient"),
                             ("ambient_system", "power")):
            for factor in (0.7, 1.4):
                other = json.loads(json.dumps(self.answer))
                other[section][key] *= factor
                self.assertGreater(loss(other), best, f"{key} times {factor}")

    def test_turns_explain_part_of_the_error(self):
        """RMF has no price of a steady turn, which takes scrub and friction."""
        self.assertGreater(self.answer["turn_j_per_rad"], 0)
        self.assertLessEqual(self.answer["error_with_turns"]["absolute_relative"],
                             self.answer["error"]["absolute_relative"] + 0.005)

    def test_configuration_keeps_all_else(self):
        out = self.folder / "fitted.yaml"
        self.export("--config", self.folder / "typical.yaml", "--out", out)
        lines = out.read_text().splitlines()
        self.assertTrue(lines[0].startswith("# Energy of amr: fitted to 16 missions."))
        self.assertIn("    charging_current: 26.4 # A", lines)  # never seen charging
        self.assertIn("    power: 760 # W", lines)
        after = yaml.safe_load("\n".join(lines))["rmf_fleet"]
        before = yaml.safe_load(TYPICAL)["rmf_fleet"]
        for section in ("battery_system", "mechanical_system", "ambient_system"):
            for key, value in after[section].items():
                self.assertAlmostEqual(value, self.answer[section][key], delta=1e-3 * abs(value))
        kept = lambda fleet: {key: fleet[key] for key in ("name", "limits", "recharge_threshold", "tool_system")}
        self.assertEqual(kept(after), kept(before))

    def test_writes_a_configuration_without_one(self):
        fleet = yaml.safe_load(self.export())["rmf_fleet"]
        self.assertEqual(sorted(fleet), ["ambient_system", "battery_system", "mechanical_system", "tool_system"])
        self.assertNotIn("charging_current", fleet["battery_system"])

    def test_rejects_incomplete_configurations(self):
        wrong = self.folder / "wrong.yaml"
        wrong.write_text(TYPICAL.replace("friction_coefficient", "friction"))
        done = self.export("--config", wrong, check=False)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("--config: has no number friction_coefficient on a line of its own below mechanical_system", done.stderr)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *rest])
