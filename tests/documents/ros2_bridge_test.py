"""Units and signs of the ROS 2 bridge, without ROS: messages are plain objects with the fields of ROS's own."""

import math
import sys
import unittest
from types import SimpleNamespace as Message

sys.path.insert(0, sys.argv.pop(1))
import ros2_bridge


def quaternion(roll, pitch, yaw):
    """Of the rotation Rz(yaw) Ry(pitch) Rx(roll)."""
    def half(angle):
        return math.cos(angle / 2), math.sin(angle / 2)
    (cr, sr), (cp, sp), (cy, sy) = half(roll), half(pitch), half(yaw)
    return Message(w=cr * cp * cy + sr * sp * sy, x=sr * cp * cy - cr * sp * sy, y=cr * sp * cy + sr * cp * sy,
                   z=cr * cp * sy - sr * sp * cy)


def joints(right=3.0, left=2.0):
    return Message(header=Message(stamp=Message(sec=1700000000, nanosec=250_000_000)), name=["caster", "left", "right"],
                   velocity=[9.0, left, right])


def telemetry(latest, joint_state=None, now_s=100.0):
    return ros2_bridge.to_telemetry(Message(), joint_state or joints(), latest, "amr", "right", "left", 7, 12.5, now_s)


class Bridge(unittest.TestCase):
    def test_takes_time_and_wheels_from_the_joint_state(self):
        sample = telemetry(ros2_bridge.Latest())
        self.assertEqual(sample.utime, 1700000000_250_000)
        self.assertEqual(sample.wheel_velocity, [3.0, 2.0])
        self.assertEqual((sample.sequence, sample.robot_id, sample.payload_mass), (7, "amr", 12.5))

    def test_a_discharging_battery_is_positive(self):
        latest = ros2_bridge.Latest()
        latest.put("battery_state", Message(voltage=25.0, current=-4.0), 100.0)
        sample = telemetry(latest)
        self.assertEqual((sample.battery_voltage, sample.battery_current), (25.0, 4.0))

    def test_nose_up_and_left_are_positive(self):
        latest = ros2_bridge.Latest()
        # A turn of +0.1 about y, which points left, puts the nose down.
        latest.put("imu", Message(angular_velocity=Message(z=0.4), orientation=quaternion(0.02, 0.1, 1.0),
                                  orientation_covariance=[0.0] * 9), 100.0)
        latest.put("odom", Message(pose=Message(pose=Message(position=Message(x=1.0, y=2.0),
                                                             orientation=quaternion(0.0, 0.0, 0.7)))), 100.0)
        sample = telemetry(latest)
        self.assertAlmostEqual(sample.pitch, -0.1)
        self.assertEqual(sample.yaw_rate, 0.4)
        self.assertAlmostEqual(sample.pose[2], 0.7)

    def test_an_imu_without_orientation_measures_no_pitch(self):
        latest = ros2_bridge.Latest()
        latest.put("imu", Message(angular_velocity=Message(z=0.4), orientation=quaternion(0, 0, 0),
                                  orientation_covariance=[-1.0] + [0.0] * 8), 100.0)
        self.assertTrue(math.isnan(telemetry(latest).pitch))

    def test_what_is_old_or_never_came_is_not_measured(self):
        latest = ros2_bridge.Latest()
        latest.put("battery_state", Message(voltage=25.0, current=-4.0), 98.0)
        sample = telemetry(latest)
        self.assertTrue(math.isnan(sample.battery_voltage) and math.isnan(sample.yaw_rate))
        self.assertTrue(all(math.isnan(v) for v in sample.pose + sample.motor_current + sample.velocity_command))

    def test_a_missing_wheel_is_an_error(self):
        with self.assertRaises(KeyError):
            telemetry(ros2_bridge.Latest(), Message(header=joints().header, name=["left"], velocity=[1.0]))


unittest.main()
