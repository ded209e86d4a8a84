"""A ROS 2 node that forwards a differential-drive robot's topics to joulecast.

    lcm-gen -p --ppath generated lcmtypes/*.lcm
    PYTHONPATH=generated python3 deploy/connect/ros2_bridge.py --robot-id amr-01

It finds topics in the graph by type and logs one line for each source found or missing:

| source | types | becomes |
|---|---|---|
| wheels | JointState | wheel_velocity, the sample's time: one sample for a message with both wheels |
| battery | BatteryState | battery_voltage, battery_current |
| imu | Imu | yaw_rate, pitch |
| pose | Odometry, or TFMessage with --map-frame | pose |
| command | Twist, TwistStamped | velocity_command |

Units and signs are those of joulecast, except that battery current is negative while discharging in ROS and positive in
joulecast. A value is valid for three periods of its topic, then NaN (not measured). A faulty message is counted, logged
once for each kind of fault, and skipped.
"""

import argparse
import importlib
import math
import re
import sys
import time
from collections import Counter, deque
from itertools import zip_longest

NAN = math.nan
HOLD_PERIODS = 3  # a value holds over two lost messages
TYPES = {
    "sensor_msgs/msg/JointState": "wheels",
    "sensor_msgs/msg/BatteryState": "battery",
    "sensor_msgs/msg/Imu": "imu",
    "nav_msgs/msg/Odometry": "pose",
    "geometry_msgs/msg/Twist": "command",
    "geometry_msgs/msg/TwistStamped": "command",
    "tf2_msgs/msg/TFMessage": "transforms",
}
BASES = ("base_footprint", "base_link", "base")
# Preferred if a source has several topics; of others the first by name is used.
USUAL = {"battery": "battery_state", "imu": "imu/data", "pose": "odom", "command": "cmd_vel"}


def nanoseconds(stamp):
    return stamp.sec * 10**9 + stamp.nanosec


def yaw_of(q):
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def nose_up_of(q):
    """ROS turns about y to the left of the robot, so nose down is positive there; nose up is positive here."""
    return -math.asin(max(-1.0, min(1.0, 2 * (q.w * q.y - q.z * q.x))))


def wheel_joints(names, side):
    """Returns the joint names of a side's wheels, such as wheel_right, r_wheel, wheelR; else those of its drive."""
    letter = side[0]
    ours = re.compile(rf"(?i:{side}|(?<![a-z])[fmbr]?{letter}(?=wheel|[^a-z]|$))|[a-z0-9]{letter.upper()}$")
    for driven in ("wheel|whl", "drive|track|tread"):
        found = [name for name in names if re.search(driven, name, re.I) and ours.search(name)
                 and not re.search("cast[eo]r|steer|swivel|pivot", name, re.I)]
        if found:
            return found
    return []


class Held:
    """The newest value of a source. It is valid for `hold_s`, or three of the topic's periods; without limit after a
    single message."""

    def __init__(self, hold_s=None):
        self.value, self.came_s, self.hold_s, self.gaps_s = None, -math.inf, hold_s, deque(maxlen=50)

    def put(self, value, now_s):
        if self.value is not None and now_s > self.came_s:
            self.gaps_s.append(now_s - self.came_s)
        self.value, self.came_s = value, now_s

    def get(self, now_s):
        # Not the median: a topic that is published on change has long pauses.
        period_s = sorted(self.gaps_s)[int(0.9 * (len(self.gaps_s) - 1))] if self.gaps_s else math.inf
        hold_s = HOLD_PERIODS * period_s if self.hold_s is None else self.hold_s
        return self.value if now_s - self.came_s <= hold_s else None


class Wheels:
    """Speeds of the right and left wheels from joint states."""

    def __init__(self, right=None, left=None):
        self.named, self.before, self.farthest = (right, left), None, 0.0
        self.skipped, self.part = 0, {}  # readings of joints until both wheels have one

    def read(self, message, time_ns):
        """Returns (time in ns, [right, left] in rad/s), or None if this and the messages since the last sample do not give both."""
        read = dict(zip(message.name, zip_longest(message.velocity, message.position, fillvalue=NAN)))
        self.part = read if self.part.keys() & read else self.part | read
        sides = [[given] if given else wheel_joints(list(self.part), side)
                 for given, side in zip(self.named, ("right", "left"))]

        def mean(field):
            values = [[self.part.get(name, (NAN, NAN))[field] for name in side] or [NAN] for side in sides]
            return [sum(each) / len(each) for each in values]

        speed, position = mean(0), mean(1)
        before, known = self.before, not any(map(math.isnan, position))
        if known or not any(map(math.isnan, speed)):
            self.part = {}
        if known:
            self.before = (time_ns, position)
            self.farthest = max(self.farthest, *map(abs, position))
        step = [self.turned(now, then) for now, then in zip(position, before[1])] if known and before else None
        if not any(map(math.isnan, speed)) and (any(speed) or not step or not any(step)):
            return time_ns, speed
        # Publishers that do not measure velocity omit it or send zeros.
        if step and time_ns > before[0]:
            return (time_ns + before[0]) // 2, [each / (time_ns - before[0]) * 1e9 for each in step]
        if not known:
            self.skipped += 1
        return None

    def turned(self, now, then):
        """Returns the difference of two positions, the shorter one if positions stay within a turn."""
        way = now - then
        return math.remainder(way, 2 * math.pi) if self.farthest <= 2 * math.pi + 0.01 else way


class Transforms:
    """The robot's pose in the map, from the transforms between."""

    def __init__(self, map_frame, base_frame):
        self.map_frame, self.base_frame, self.links = map_frame, base_frame, {}

    def read(self, message):
        """Returns [x, y, heading] if a link of the chain from the robot to the map has moved, else None."""
        moved = set()
        for each in message.transforms:
            at, child = each.transform.translation, each.child_frame_id.lstrip("/")
            self.links[child] = (each.header.frame_id.lstrip("/"), at.x, at.y, yaw_of(each.transform.rotation))
            moved.add(child)
        base = self.base_frame or next((name for name in BASES if name in self.links), None)
        x, y, yaw, frame, ours = 0.0, 0.0, 0.0, base, False
        for _ in range(len(self.links)):
            if frame not in self.links:
                break
            parent, px, py, turn = self.links[frame]
            x, y = px + math.cos(turn) * x - math.sin(turn) * y, py + math.sin(turn) * x + math.cos(turn) * y
            yaw, ours, frame = yaw + turn, ours or frame in moved, parent
        return [x, y, math.remainder(yaw, 2 * math.pi)] if ours and frame == self.map_frame else None


class Bridge:
    """`node` is rclpy's, `publish(channel, bytes)` sends, `types` has the LCM types of lcmtypes."""

    def __init__(self, node, publish, types, options):
        self.node, self.send, self.types, self.options = node, publish, types, options
        self.sequence, self.mission, self.faults = 0, None, Counter()
        self.wheels, self.wheel_topic = Wheels(options.right_joint, options.left_joint), None
        self.transforms = Transforms(options.map_frame, options.base_frame)
        self.held = {source: Held() for source in ("imu", "pose", "command")}
        self.held["battery"] = Held(options.battery_hold_s)
        self.chosen = dict(each.split("=", 1) for each in options.topic)
        if unknown := set(self.chosen) - set(TYPES.values()):
            raise SystemExit(f"--topic: {min(unknown)} is none of {', '.join(sorted(set(TYPES.values())))}")
        self.used, self.looks = {}, 0  # the source of each topic that is subscribed to
        node.create_timer(1.0, self.guarded("discovery", self.discover))
        if options.mission_topic:
            text = importlib.import_module("std_msgs.msg").String
            node.create_subscription(text, options.mission_topic, self.guarded("mission", self.on_mission), 10)
        trigger = importlib.import_module("std_srvs.srv").Trigger
        for name in ("start", "finish", "abort"):
            node.create_service(trigger, f"~/{name}_mission", self.answering(name))

    def guarded(self, name, work):
        """Returns `work` with its exceptions counted and logged once for each kind."""
        def call(*given):
            try:
                return work(*given)
            except Exception as error:  # pylint: disable=broad-except
                self.fault(f"{name}: {type(error).__name__}", str(error))
                return None
        return call

    def fault(self, kind, text):
        self.faults[kind] += 1
        if self.faults[kind] == 1:
            self.node.get_logger().warning(f"{kind}: {text} (logged once)")

    # Sources.

    def discover(self):
        """Subscribes to one topic of each source that has none yet, but to all joint states, which may have several
        publishers, and to all transforms."""
        wanted = {source for source in TYPES.values() if source not in self.used.values() or source in ("wheels", "transforms")}
        wanted.discard("pose" if self.options.map_frame else "transforms")
        found = {}
        for topic, _ in sorted(self.node.get_topic_names_and_types()):
            publishers = self.node.get_publishers_info_by_topic(topic)
            source = TYPES.get(publishers[0].topic_type) if publishers else None
            ours = source == "transforms" or topic.startswith(self.options.namespace)
            if source in wanted and topic not in self.used and ours:
                found.setdefault(source, []).append((topic, publishers))
        for source, topics in found.items():
            if source in self.chosen:
                topics = [each for each in topics if each[0] == self.chosen[source]]
            elif source in USUAL:
                topics = sorted(topics, key=lambda each: (not each[0].endswith("/" + USUAL[source]), each[0]))
            others = [topic for topic, _ in topics[1:]] if source in USUAL else []
            for topic, publishers in topics[:1] if source in USUAL else topics:
                self.subscribe(source, topic, publishers, others)
        self.looks += 1
        if self.looks == 5:  # seconds until the graph is complete
            for source in sorted(wanted - set(self.used.values())):
                kinds = [kind for kind, each in TYPES.items() if each == source]
                self.node.get_logger().warning(f"{source}: missing, no topic of {' or '.join(kinds)}"
                                               f"{' called ' + self.chosen[source] if source in self.chosen else ''}")

    def subscribe(self, source, topic, publishers, others):
        qos = importlib.import_module("rclpy.qos")
        kind = publishers[0].topic_type
        package, _, name = kind.split("/")
        offered = [publisher.qos_profile for publisher in publishers]

        def all_offer(policy, value):
            return all(getattr(each, policy) == value for each in offered)

        reliable, latched = qos.ReliabilityPolicy.RELIABLE, qos.DurabilityPolicy.TRANSIENT_LOCAL
        profile = qos.QoSProfile(
            depth=10,
            reliability=reliable if all_offer("reliability", reliable) else qos.ReliabilityPolicy.BEST_EFFORT,
            durability=latched if all_offer("durability", latched) else qos.DurabilityPolicy.VOLATILE)
        call = getattr(self, f"on_{source}")
        self.node.create_subscription(getattr(importlib.import_module(f"{package}.msg"), name), topic,
                                      self.guarded(topic, lambda message: call(message, topic)), profile)
        self.used[topic] = source
        aside = f"; not used: {', '.join(others)}" if others else ""
        self.node.get_logger().info(f"{source}: {topic} ({kind}){aside}")

    def on_battery(self, message, _):
        sign = 1 if self.options.discharging_positive else -1
        self.held["battery"].put((message.voltage, sign * message.current), time.monotonic())

    def on_imu(self, message, _):
        # An IMU that does not estimate a quantity sets the first element of its covariance to -1.
        turns, level = message.angular_velocity_covariance[0] >= 0, message.orientation_covariance[0] >= 0
        self.held["imu"].put((message.angular_velocity.z if turns else NAN,
                              nose_up_of(message.orientation) if level else NAN), time.monotonic())

    def on_pose(self, message, _):
        pose = message.pose.pose
        self.held["pose"].put([pose.position.x, pose.position.y, yaw_of(pose.orientation)], time.monotonic())

    def on_transforms(self, message, _):
        if pose := self.transforms.read(message):
            self.held["pose"].put(pose, time.monotonic())

    def on_command(self, message, _):
        twist = getattr(message, "twist", message)
        self.held["command"].put([twist.linear.x, twist.angular.z], time.monotonic())

    def on_wheels(self, message, topic):
        if self.wheel_topic not in (None, topic):
            return
        skipped = self.wheels.skipped
        read = self.wheels.read(message, nanoseconds(message.header.stamp) or time.time_ns())
        if self.wheels.skipped > skipped:
            self.fault("wheels", f"{topic}: messages without both wheels are skipped; joints: {', '.join(message.name)}; "
                                 "--right-joint and --left-joint name the wheels'")
        if not read:
            return
        if self.wheel_topic is None:
            self.wheel_topic = topic
            self.node.get_logger().info(f"wheels: speeds come from {topic}")
        self.send(f"ROBOT_TELEMETRY.{self.options.robot_id}", self.sample(*read, time.monotonic()).encode())
        self.sequence += 1

    def sample(self, time_ns, speeds, now_s):
        """Returns a robot_telemetry_t at `time_ns` of the robot's clock, with the values valid at `now_s` of the monotonic one."""
        sample = self.types.robot_telemetry_t()
        sample.utime, sample.sequence = time_ns // 1000, self.sequence
        sample.robot_id, sample.wheel_velocity = self.options.robot_id, speeds
        sample.motor_voltage = sample.motor_current = sample.motor_temperature = [NAN, NAN]
        sample.battery_voltage, sample.battery_current = self.held["battery"].get(now_s) or (NAN, NAN)
        sample.yaw_rate, sample.pitch = self.held["imu"].get(now_s) or (NAN, NAN)
        sample.pose = self.held["pose"].get(now_s) or [NAN] * 3
        sample.velocity_command = self.held["command"].get(now_s) or [NAN, NAN]
        sample.payload_mass = self.options.payload_kg
        return sample

    # Missions.

    def on_mission(self, message):
        """The id of the mission that begins; an empty text ends it."""
        self.end("FINISHED")
        if message.data:
            self.start(message.data)

    def answering(self, name):
        """The service start_mission, finish_mission or abort_mission."""
        def answer(_, response):
            known = self.mission
            if name == "start":
                self.end("FINISHED")
                self.start(f"mission-{time.time_ns() // 1000}")
            else:
                self.end({"finish": "FINISHED", "abort": "ABORTED"}[name])
            response.success = name == "start" or known is not None
            response.message = self.mission or known or "no mission is open"
            return response

        def call(request, response):
            return self.guarded(f"{name}_mission", answer)(request, response) or response
        return call

    def start(self, mission_id):
        self.publish_event(mission_id, "STARTED")
        self.mission = mission_id

    def end(self, event):
        if self.mission is not None:
            self.publish_event(self.mission, event)
        self.mission = None

    def publish_event(self, mission_id, event):
        message = self.types.mission_event_t()
        message.utime, message.robot_id, message.mission_id = time.time_ns() // 1000, self.options.robot_id, mission_id
        message.event, message.payload_mass, message.note = getattr(message, event), self.options.payload_kg, ""
        self.send(f"MISSION_EVENT.{self.options.robot_id}", message.encode())
        self.node.get_logger().info(f"mission {mission_id}: {event}")


def parse(words):
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--robot-id", required=True)
    arguments.add_argument("--namespace", default="/", help="the robot's topics begin with this, such as /amr_07/")
    arguments.add_argument("--topic", action="append", default=[], metavar="SOURCE=TOPIC", help="such as battery=/bms/state")
    arguments.add_argument("--right-joint", help="without it, joints with wheel and right in their names")
    arguments.add_argument("--left-joint")
    arguments.add_argument("--battery-hold-s", type=float, help="for a battery that publishes on change only")
    arguments.add_argument("--discharging-positive", action="store_true", help="the battery's current has joulecast's sign")
    arguments.add_argument("--map-frame", default="", help="take the pose from tf, in this frame, such as map")
    arguments.add_argument("--base-frame", help=f"the robot's frame in tf, without it the first of {', '.join(BASES)}")
    arguments.add_argument("--mission-topic", help="std_msgs/String: the id of a mission that begins, empty at its end")
    arguments.add_argument("--payload-kg", type=float, default=NAN)
    return arguments.parse_args(words)


def main():
    import joulecast
    import rclpy
    from lcm_udp import Publisher
    from rclpy.executors import ExternalShutdownException
    from rclpy.utilities import remove_ros_args

    options = parse(remove_ros_args(sys.argv)[1:])
    rclpy.init()
    node = rclpy.create_node("joulecast_bridge")
    bridge = Bridge(node, Publisher().publish, joulecast, options)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    for kind, count in bridge.faults.items():
        print(f"{kind}: {count} times", file=sys.stderr)


if __name__ == "__main__":
    main()
