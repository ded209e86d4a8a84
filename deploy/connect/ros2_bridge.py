"""A ROS 2 node that passes a differential-drive robot's topics on to joulecast.

    lcm-gen -p --ppath generated lcmtypes/*.lcm
    PYTHONPATH=generated python3 deploy/connect/ros2_bridge.py --robot-id amr-01 \\
        --right-joint wheel_right_joint --left-joint wheel_left_joint

| topic | type | becomes |
|---|---|---|
| joint_states | sensor_msgs/JointState | wheel_velocity, the sample's time: one sample a message |
| battery_state | sensor_msgs/BatteryState | battery_voltage, battery_current |
| imu | sensor_msgs/Imu | yaw_rate, pitch |
| odom | nav_msgs/Odometry | pose |
| cmd_vel | geometry_msgs/Twist | velocity_command |

ROS and joulecast agree on metres, radians, volts and the left turn being positive. They differ in one sign: ROS counts
battery current negative while discharging, joulecast positive. What has not arrived within `stale_s` is sent as NaN,
"not measured". `to_telemetry` needs no ROS, so it can be tested without it.
"""

import argparse
import math
from types import SimpleNamespace

NAN = math.nan
stale_s = 0.5


def seconds(stamp):
    return stamp.sec + stamp.nanosec * 1e-9


def yaw_of(q):
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def nose_up_of(q):
    """ROS turns about y to the left of the robot, so nose down is positive there; nose up is positive here."""
    return -math.asin(max(-1.0, min(1.0, 2 * (q.w * q.y - q.z * q.x))))


class Latest:
    """The newest message of each topic and when it came."""

    def __init__(self):
        self.messages = {}

    def put(self, topic, message, now_s):
        self.messages[topic] = (message, now_s)

    def get(self, topic, now_s):
        message, came_s = self.messages.get(topic, (None, -math.inf))
        return message if now_s - came_s <= stale_s else None


def to_telemetry(sample, joint_state, latest, robot_id, right_joint, left_joint, sequence, payload_kg, now_s):
    """Fills `sample`, a robot_telemetry_t. KeyError where the joint state lacks one of the wheels."""
    speed = dict(zip(joint_state.name, joint_state.velocity))
    battery, imu = latest.get("battery_state", now_s), latest.get("imu", now_s)
    odometry, command = latest.get("odom", now_s), latest.get("cmd_vel", now_s)
    sample.utime = round(seconds(joint_state.header.stamp) * 1e6)
    sample.sequence = sequence
    sample.robot_id = robot_id
    sample.wheel_velocity = [speed[right_joint], speed[left_joint]]
    sample.motor_voltage = [NAN, NAN]
    sample.motor_current = [NAN, NAN]
    sample.motor_temperature = [NAN, NAN]
    sample.battery_voltage = battery.voltage if battery else NAN
    sample.battery_current = -battery.current if battery else NAN
    sample.velocity_command = [command.linear.x, command.angular.z] if command else [NAN, NAN]
    sample.yaw_rate = imu.angular_velocity.z if imu else NAN
    # An IMU without orientation says so by a covariance of -1.
    sample.pitch = nose_up_of(imu.orientation) if imu and imu.orientation_covariance[0] >= 0 else NAN
    pose = odometry.pose.pose if odometry else None
    sample.pose = [pose.position.x, pose.position.y, yaw_of(pose.orientation)] if pose else [NAN] * 3
    sample.payload_mass = payload_kg
    return sample


def main():
    import rclpy
    from geometry_msgs.msg import Twist
    from joulecast import robot_telemetry_t
    from lcm_udp import Publisher
    from nav_msgs.msg import Odometry
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import BatteryState, Imu, JointState

    arguments = argparse.ArgumentParser()
    arguments.add_argument("--robot-id", required=True)
    arguments.add_argument("--right-joint", required=True)
    arguments.add_argument("--left-joint", required=True)
    arguments.add_argument("--payload-kg", type=float, default=0.0)
    options = arguments.parse_args()

    rclpy.init()
    node = rclpy.create_node("joulecast_bridge")
    lcm, latest, count = Publisher(), Latest(), SimpleNamespace(sequence=0)

    def now_s():
        return node.get_clock().now().nanoseconds * 1e-9

    def on_joint_state(message):
        sample = to_telemetry(robot_telemetry_t(), message, latest, options.robot_id, options.right_joint,
                              options.left_joint, count.sequence, options.payload_kg, now_s())
        lcm.publish(f"ROBOT_TELEMETRY.{options.robot_id}", sample.encode())
        count.sequence += 1

    for topic, kind in (("battery_state", BatteryState), ("imu", Imu), ("odom", Odometry), ("cmd_vel", Twist)):
        node.create_subscription(kind, topic, lambda message, topic=topic: latest.put(topic, message, now_s()),
                                 qos_profile_sensor_data)
    node.create_subscription(JointState, "joint_states", on_joint_state, qos_profile_sensor_data)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
