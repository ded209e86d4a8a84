"""Publishes a robot's telemetry and announces one mission.

    lcm-gen -p --ppath generated lcmtypes/*.lcm
    PYTHONPATH=generated python3 deploy/connect/publisher.py amr 5      (robot_id, seconds)

Messages are signed if the environment variable ROBOT_KEY contains the robot's key, as printed by `joulecast key create`.
The drive below is invented: replace it by your readings.
"""

import hashlib
import hmac
import math
import os
import struct
import sys
import time

from joulecast import mission_event_t, robot_covariates_t, robot_telemetry_t, signed_message_t
from lcm_udp import Publisher

NOT_MEASURED = math.nan
RATE_HZ = 50


def now_us():
    return time.time_ns() // 1000


class Signer:
    """Publishes messages, signed if there is a key."""

    def __init__(self, lcm, key_hex):
        self.lcm = lcm
        self.key = bytes.fromhex(key_hex)
        self.sequence = now_us()  # increases across restarts of the program

    def publish(self, channel, content):
        if self.key:
            self.sequence += 1
            message = signed_message_t()
            message.utime = now_us()
            message.sequence = self.sequence
            message.size = len(content)
            message.content = content
            text = channel.encode() + b"\0" + struct.pack(">qq", message.utime, message.sequence) + content
            message.mac = hmac.digest(self.key, text, hashlib.sha256)
            content = message.encode()
        self.lcm.publish(channel, content)


def mission_event(robot_id, mission_id, event):
    message = mission_event_t()
    message.utime = now_us()
    message.robot_id = robot_id
    message.mission_id = mission_id
    message.event = event
    message.payload_mass = 20.0  # kg, the declared load
    message.note = "first mission"
    return message.encode()


def sample(robot_id, sequence):
    t_s = sequence / RATE_HZ
    speed_m_s = min(0.5 * t_s, 1.0)
    message = robot_telemetry_t()
    message.utime = now_us()  # the instant of sampling, not of sending
    message.sequence = sequence  # +1 a message, so that losses can be counted
    message.robot_id = robot_id
    message.wheel_velocity = [speed_m_s / 0.08] * 2  # [right, left], rad/s, positive forward
    message.motor_voltage = [NOT_MEASURED] * 2
    message.motor_current = [NOT_MEASURED] * 2
    message.motor_temperature = [NOT_MEASURED] * 2
    message.battery_voltage = 26.0
    message.battery_current = 1.0 + 2.0 * speed_m_s  # positive while discharging
    message.velocity_command = [speed_m_s, 0.0]
    message.yaw_rate = 0.0
    message.pitch = NOT_MEASURED
    message.pose = [NOT_MEASURED] * 3
    message.payload_mass = 20.0
    return message.encode()


def covariates(robot_id, values):
    """Other quantities that may explain the power; a value is valid until the next one of its name."""
    message = robot_covariates_t()
    message.utime = now_us()
    message.robot_id = robot_id
    message.n = len(values)
    message.name = list(values)
    message.value = [float(value) for value in values.values()]
    return message.encode()


def main():
    robot_id = sys.argv[1] if len(sys.argv) > 1 else "amr"
    duration_s = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    lcm = Signer(Publisher(), os.environ.get("ROBOT_KEY", ""))
    mission_id = f"tour-{now_us()}"
    lcm.publish(f"MISSION_EVENT.{robot_id}", mission_event(robot_id, mission_id, mission_event_t.STARTED))
    lcm.publish(f"ROBOT_COVARIATES.{robot_id}", covariates(robot_id, {"surface=concrete": 1, "heater_w": 0}))
    begin = time.monotonic()
    for sequence in range(RATE_HZ * duration_s):
        if sequence % RATE_HZ == 0:
            load = os.getloadavg()[0] / os.cpu_count()
            lcm.publish(f"ROBOT_COVARIATES.{robot_id}", covariates(robot_id, {"cpu_load": load}))
        lcm.publish(f"ROBOT_TELEMETRY.{robot_id}", sample(robot_id, sequence))
        time.sleep(max(0.0, begin + (sequence + 1) / RATE_HZ - time.monotonic()))
    lcm.publish(f"MISSION_EVENT.{robot_id}", mission_event(robot_id, mission_id, mission_event_t.FINISHED))
    print(f"{robot_id} drove mission {mission_id}")


if __name__ == "__main__":
    main()
