"""The ROS 2 bridge without ROS: messages are plain objects with the fields of ROS's own, and stand-ins for rclpy run its
main(). ros2_bridge_test.py CONNECT, the folder of the bridge."""

import atexit
import contextlib
import io
import math
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from types import ModuleType, SimpleNamespace as Message
from unittest import mock

CONNECT = Path(sys.argv.pop(1)).resolve()
GENERATED = tempfile.mkdtemp(prefix="joulecast-bridge-")
atexit.register(shutil.rmtree, GENERATED)
subprocess.run(["lcm-gen", "-p", "--ppath", GENERATED, *map(str, (CONNECT / "../../lcmtypes").glob("*.lcm"))], check=True)
sys.path[:0] = [str(CONNECT), GENERATED]
import joulecast
import ros2_bridge

RELIABLE, BEST_EFFORT, TRANSIENT_LOCAL, VOLATILE = "reliable", "best effort", "transient local", "volatile"
T0 = 1_700_000_000


def quaternion(roll, pitch, yaw):
    """Of the rotation Rz(yaw) Ry(pitch) Rx(roll)."""
    def half(angle):
        return math.cos(angle / 2), math.sin(angle / 2)
    (cr, sr), (cp, sp), (cy, sy) = half(roll), half(pitch), half(yaw)
    return Message(w=cr * cp * cy + sr * sp * sy, x=sr * cp * cy - cr * sp * sy, y=cr * sp * cy + sr * cp * sy,
                   z=cr * cp * sy - sr * sp * cy)


def joints(right=3.0, left=2.0, at_s=0.25, names=("caster", "wheel_left", "wheel_right"), position=()):
    at_s, part = divmod(at_s, 1)
    velocity = [] if right is None else [9.0, left, right][:len(names)]
    return Message(header=Message(stamp=Message(sec=T0 + int(at_s), nanosec=round(part * 1e9))), name=list(names),
                   velocity=velocity, position=list(position))


def battery(volts=25.0, amps=-4.0):
    return Message(voltage=volts, current=amps)


def imu(turns=0.4, orientation=quaternion(0, 0, 0), without_orientation=False):
    return Message(angular_velocity=Message(z=turns), angular_velocity_covariance=[0.0] * 9, orientation=orientation,
                   orientation_covariance=[-1.0 if without_orientation else 0.0] + [0.0] * 8)


def odometry(x, y, yaw):
    return Message(pose=Message(pose=Message(position=Message(x=x, y=y), orientation=quaternion(0, 0, yaw))))


def twist(v, w):
    return Message(linear=Message(x=v), angular=Message(z=w))


def link(parent, child, x, y, yaw):
    return Message(header=Message(frame_id=parent), child_frame_id=child,
                   transform=Message(translation=Message(x=x, y=y), rotation=quaternion(0, 0, yaw)))


class Node:
    """rclpy's node, with a graph of topics: name to (type, reliability, durability)."""

    def __init__(self, graph):
        self.graph, self.lines, self.timers, self.subscriptions, self.services = graph, [], [], {}, {}

    def get_topic_names_and_types(self):
        return [(topic, [kind]) for topic, (kind, _, _) in self.graph.items()]

    def get_publishers_info_by_topic(self, topic):
        kind, reliability, durability = self.graph[topic]
        return [Message(topic_type=kind, qos_profile=Message(reliability=reliability, durability=durability))] if kind else []

    def create_timer(self, _, call):
        self.timers.append(call)

    def create_subscription(self, kind, topic, call, qos):
        assert topic not in self.subscriptions, topic
        self.subscriptions[topic] = Message(kind=kind, call=call, qos=qos)

    def create_service(self, _, name, call):
        self.services[name] = call

    def get_logger(self):
        return Message(info=self.lines.append, warning=self.lines.append)

    def look(self, times=1):
        for _ in range(times):
            for call in self.timers:
                call()

    def deliver(self, topic, message):
        self.subscriptions[topic].call(message)

    def logged(self, part):
        return [line for line in self.lines if part in line]


def modules():
    """Stand-ins for ROS's Python packages, each message type its own name."""
    made = {}

    def module(name, **members):
        made[name] = ModuleType(name)
        vars(made[name]).update(members)
    module("rclpy", init=lambda: None)
    module("rclpy.utilities", remove_ros_args=lambda words: words)
    module("rclpy.executors", ExternalShutdownException=type("ExternalShutdownException", (Exception,), {}))
    module("rclpy.qos", QoSProfile=lambda **policies: Message(**policies),
           ReliabilityPolicy=Message(RELIABLE=RELIABLE, BEST_EFFORT=BEST_EFFORT),
           DurabilityPolicy=Message(TRANSIENT_LOCAL=TRANSIENT_LOCAL, VOLATILE=VOLATILE))
    kinds = {}
    for kind in [*ros2_bridge.TYPES, "std_msgs/msg/String", "std_srvs/srv/Trigger"]:
        package, part, name = kind.split("/")
        kinds.setdefault(f"{package}.{part}", {})[name] = kind
    for name, members in kinds.items():
        module(name.partition(".")[0])
        module(name, **members)
    return made


GRAPH = {
    "/joint_states": ("sensor_msgs/msg/JointState", RELIABLE, VOLATILE),
    "/battery_state": ("sensor_msgs/msg/BatteryState", RELIABLE, VOLATILE),
    "/imu/data": ("sensor_msgs/msg/Imu", BEST_EFFORT, VOLATILE),
    "/odom": ("nav_msgs/msg/Odometry", RELIABLE, VOLATILE),
    "/cmd_vel": ("geometry_msgs/msg/Twist", RELIABLE, VOLATILE),
}


class Bridge(unittest.TestCase):
    def setUp(self):
        self.now_s, self.sent = 100.0, []
        for patch in (mock.patch.dict(sys.modules, modules()),
                      mock.patch.object(ros2_bridge.time, "monotonic", lambda: self.now_s)):
            patch.start()
            self.addCleanup(patch.stop)

    def bridge(self, *words, graph=None, looks=5):
        node = Node(GRAPH if graph is None else graph)
        self.made = ros2_bridge.Bridge(node, lambda channel, data: self.sent.append((channel, data)), joulecast,
                                       ros2_bridge.parse(["--robot-id", "amr", *words]))
        node.look(looks)
        return node

    def samples(self):
        return [joulecast.robot_telemetry_t.decode(data) for channel, data in self.sent if channel == "ROBOT_TELEMETRY.amr"]

    def events(self):
        return [joulecast.mission_event_t.decode(data) for channel, data in self.sent if channel == "MISSION_EVENT.amr"]

    def sample(self, node, **how):
        node.deliver("/joint_states", joints(**how))
        return self.samples()[-1]

    def test_time_and_wheels_of_the_joint_state(self):
        sample = self.sample(self.bridge("--payload-kg", "12.5"))
        self.assertEqual(sample.utime, T0 * 10**6 + 250_000)
        self.assertEqual(sample.wheel_velocity, (3.0, 2.0))
        self.assertEqual((sample.sequence, sample.robot_id, sample.payload_mass), (0, "amr", 12.5))

    def test_discharging_battery_is_positive(self):
        node = self.bridge()
        node.deliver("/battery_state", battery())
        sample = self.sample(node)
        self.assertEqual((sample.battery_voltage, sample.battery_current), (25.0, 4.0))
        node = self.bridge("--discharging-positive")
        node.deliver("/battery_state", battery(amps=4.0))
        self.assertEqual(self.sample(node).battery_current, 4.0)

    def test_nose_up_and_left_are_positive(self):
        node = self.bridge()
        # A turn of +0.1 about y, which points left, puts the nose down.
        node.deliver("/imu/data", imu(0.4, quaternion(0.02, 0.1, 1.0)))
        node.deliver("/odom", odometry(1.0, 2.0, 0.7))
        sample = self.sample(node)
        self.assertAlmostEqual(sample.pitch, -0.1)
        self.assertEqual(sample.yaw_rate, 0.4)
        self.assertAlmostEqual(sample.pose[2], 0.7)

    def test_imu_without_orientation_measures_no_pitch(self):
        node = self.bridge()
        node.deliver("/imu/data", imu(without_orientation=True))
        self.assertTrue(math.isnan(self.sample(node).pitch))

    def test_missing_topics_are_not_measured(self):
        sample = self.sample(self.bridge())
        self.assertTrue(math.isnan(sample.battery_voltage) and math.isnan(sample.yaw_rate))
        self.assertTrue(all(math.isnan(v) for v in sample.pose + sample.motor_current + sample.velocity_command))
        self.assertTrue(math.isnan(sample.payload_mass))

    def test_values_hold_for_their_own_period(self):
        for period_s in (0.1, 1.0, 2.0, 10.0):
            node = self.bridge()
            for _ in range(4):
                self.now_s += period_s
                node.deliver("/battery_state", battery())
            for periods, measured in ((0.9, True), (2.9, True), (3.2, False)):
                with mock.patch.object(ros2_bridge.time, "monotonic", lambda: self.now_s + periods * period_s):
                    self.assertEqual(not math.isnan(self.sample(node).battery_voltage), measured, (period_s, periods))

    def test_single_value_holds(self):
        node = self.bridge()
        node.deliver("/battery_state", battery())
        self.now_s += 1000
        self.assertEqual(self.sample(node).battery_voltage, 25.0)

    def test_pauses_of_a_topic_on_change(self):
        node = self.bridge()
        for pause_s in (0.1, 0.1, 6.0, 0.1, 5.0, 0.1, 7.0, 0.1, 6.0):
            self.now_s += pause_s
            node.deliver("/battery_state", battery())
        self.now_s += 10
        self.assertEqual(self.sample(node).battery_voltage, 25.0)

    def test_battery_hold_is_an_option(self):
        node = self.bridge("--battery-hold-s", "5")
        node.deliver("/battery_state", battery())
        self.now_s += 4.9
        self.assertEqual(self.sample(node).battery_voltage, 25.0)
        self.now_s += 0.2
        self.assertTrue(math.isnan(self.sample(node).battery_voltage))

    def test_commands_of_both_kinds(self):
        for kind, message in (("Twist", twist(0.5, 0.2)), ("TwistStamped", Message(twist=twist(0.5, 0.2)))):
            node = self.bridge(graph={**GRAPH, "/cmd_vel": (f"geometry_msgs/msg/{kind}", RELIABLE, VOLATILE)})
            self.assertEqual(node.subscriptions["/cmd_vel"].kind, f"geometry_msgs/msg/{kind}")
            node.deliver("/cmd_vel", message)
            self.assertEqual(self.sample(node).velocity_command, (0.5, 0.2))

    def test_quality_of_service_follows_the_publisher(self):
        node = self.bridge(graph={**GRAPH, "/battery_state": ("sensor_msgs/msg/BatteryState", RELIABLE, TRANSIENT_LOCAL)})
        offered = {topic: (each.qos.reliability, each.qos.durability) for topic, each in node.subscriptions.items()}
        self.assertEqual(offered["/battery_state"], (RELIABLE, TRANSIENT_LOCAL))
        self.assertEqual(offered["/imu/data"], (BEST_EFFORT, VOLATILE))

    def test_joint_states_without_both_wheels(self):
        node = self.bridge()
        for names in (["gripper"], ["gripper"], ["wheel_left"]):
            node.deliver("/joint_states", joints(names=names))
        self.assertEqual(self.samples(), [])
        self.assertEqual(self.made.wheels.skipped, 3)
        self.assertEqual(len(node.logged("without both wheels")), 1)
        self.assertIn("joints: gripper", node.logged("without both wheels")[0])
        self.assertEqual(self.sample(node).wheel_velocity, (3.0, 2.0))

    def test_wheels_in_messages_of_their_own(self):
        node = self.bridge()
        for k in range(3):
            for name, speed in (("wheel_left", 1.0 + k), ("gripper", 9.0), ("wheel_right", 2.0 + k)):
                message = joints(at_s=0.1 * k, names=[name])
                message.velocity = [speed]
                node.deliver("/joint_states", message)
        self.assertEqual([sample.wheel_velocity for sample in self.samples()], [(2.0, 1.0), (3.0, 2.0), (4.0, 3.0)])

    def test_wheels_of_several_publishers(self):
        node = self.bridge(graph={**GRAPH, "/arm/joint_states": GRAPH["/joint_states"], "/z/joint_states": GRAPH["/joint_states"]})
        node.deliver("/arm/joint_states", joints(names=["elbow"]))
        self.sample(node)
        node.deliver("/z/joint_states", joints(at_s=0.26))
        self.assertEqual(len(self.samples()), 1)

    def test_named_joints(self):
        node = self.bridge("--right-joint", "r", "--left-joint", "l")
        self.assertEqual(self.sample(node, names=("x", "l", "r")).wheel_velocity, (3.0, 2.0))

    def test_usual_names_of_joints(self):
        for names in (("x", "wheelL", "wheelR"), ("x", "l_wheel", "r_wheel"), ("x", "left_drive_joint", "right_drive_joint"),
                      ("x", "left_track", "right_track")):
            node = self.bridge()
            self.assertEqual(self.sample(node, names=names).wheel_velocity, (3.0, 2.0), names)

    def test_wheels_of_four_are_averaged(self):
        node = self.bridge()
        message = joints()
        message.name = ["front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel"]
        message.velocity = [1.0, 2.0, 3.0, 6.0]
        node.deliver("/joint_states", message)
        self.assertEqual(self.samples()[-1].wheel_velocity, (4.0, 2.0))

    def test_positions_give_speeds(self):
        for velocity in (None, 0.0):
            for turn in (lambda a: a, lambda a: math.remainder(a, 2 * math.pi)):
                self.sent.clear()
                node = self.bridge()
                for k in range(1, 60):
                    node.deliver("/joint_states", joints(velocity, velocity, at_s=0.1 * k, position=[0, turn(0.4 * k), turn(-0.3 * k)]))
                last = self.samples()[-1]
                self.assertAlmostEqual(last.wheel_velocity[0], -3.0)
                self.assertAlmostEqual(last.wheel_velocity[1], 4.0)
                self.assertEqual(last.utime, T0 * 10**6 + 5_850_000)

    def test_standing_wheels_are_measured(self):
        node = self.bridge()
        for k in range(3):
            node.deliver("/joint_states", joints(0.0, 0.0, at_s=0.1 * k, position=[0, 1, 1]))
        self.assertEqual([sample.wheel_velocity for sample in self.samples()], [(0.0, 0.0)] * 3)

    def test_map_pose_from_transforms(self):
        graph = {**GRAPH, "/tf": ("tf2_msgs/msg/TFMessage", RELIABLE, VOLATILE),
                 "/tf_static": ("tf2_msgs/msg/TFMessage", RELIABLE, TRANSIENT_LOCAL)}
        node = self.bridge("--map-frame", "map", graph=graph)
        self.assertNotIn("/odom", node.subscriptions)
        node.deliver("/tf_static", Message(transforms=[link("base_footprint", "base_link", 0.0, 0.0, 0.0)]))
        node.deliver("/tf", Message(transforms=[link("odom", "base_footprint", 2.0, 1.0, 0.5)]))
        self.assertTrue(math.isnan(self.sample(node).pose[0]))
        node.deliver("/tf", Message(transforms=[link("map", "odom", 10.0, 0.0, math.pi / 2)]))
        for got, expected in zip(self.sample(node).pose, (9.0, 2.0, math.pi / 2 + 0.5)):
            self.assertAlmostEqual(got, expected)

    def test_usual_frames_of_robots(self):
        graph = {**GRAPH, "/tf": ("tf2_msgs/msg/TFMessage", RELIABLE, VOLATILE)}
        for frame in ("base_footprint", "base_link", "base"):
            node = self.bridge("--map-frame", "map", graph=graph)
            node.deliver("/tf", Message(transforms=[link("map", frame, 2.0, 1.0, 0.5)]))
            self.assertEqual(self.sample(node).pose[:2], (2.0, 1.0), frame)

    def test_missions_by_topic(self):
        node = self.bridge("--mission-topic", "/task", "--payload-kg", "7")
        for text in ("tour-1", "tour-2", ""):
            node.deliver("/task", Message(data=text))
        event = joulecast.mission_event_t
        self.assertEqual([(each.mission_id, each.event) for each in self.events()], [
            ("tour-1", event.STARTED), ("tour-1", event.FINISHED), ("tour-2", event.STARTED), ("tour-2", event.FINISHED)])
        self.assertEqual(self.events()[0].payload_mass, 7.0)

    def test_missions_by_service(self):
        node, event = self.bridge(), joulecast.mission_event_t

        def ask(name):
            return node.services[f"~/{name}_mission"](Message(), Message(success=False, message=""))
        begun = ask("start")
        self.assertTrue(begun.success)
        self.assertEqual(ask("abort").message, begun.message)
        self.assertFalse(ask("finish").success)
        self.assertEqual([(each.mission_id, each.event) for each in self.events()],
                         [(begun.message, event.STARTED), (begun.message, event.ABORTED)])

    def test_sources_are_logged(self):
        graph = {topic: kind for topic, kind in GRAPH.items() if topic not in ("/imu/data", "/battery_state")}
        graph |= {"/other/cmd_vel": GRAPH["/cmd_vel"], "/battery_state": (None, None, None), "/rosout": ("rcl_interfaces/msg/Log", RELIABLE, VOLATILE)}
        node = self.bridge(graph=graph, looks=20)
        self.assertEqual(len(node.logged("command: /cmd_vel (geometry_msgs/msg/Twist); not used: /other/cmd_vel")), 1)
        self.assertEqual(len(node.logged("pose: /odom (nav_msgs/msg/Odometry)")), 1)
        self.assertEqual(len(node.logged("imu: missing, no topic of sensor_msgs/msg/Imu")), 1)
        self.assertEqual(len(node.logged("battery: missing")), 1)
        node.graph["/imu/late"] = GRAPH["/imu/data"]
        node.look()
        self.assertEqual(len(node.logged("imu: /imu/late")), 1)

    def test_topics_are_chosen(self):
        graph = {**GRAPH, "/bms/state": GRAPH["/battery_state"], "/b/odom": GRAPH["/odom"], "/a/odom": GRAPH["/odom"]}
        self.assertIn("/bms/state", self.bridge("--topic", "battery=/bms/state", graph=graph).subscriptions)
        self.assertEqual({topic for topic in self.bridge("--namespace", "/b/", graph=graph).subscriptions}, {"/b/odom"})
        with self.assertRaisesRegex(SystemExit, "'?gyro'? is none of"):
            self.bridge("--topic", "gyro=/imu")

    def test_faulty_messages_end_nothing(self):
        node = self.bridge()
        for _ in range(3):
            node.deliver("/battery_state", Message(voltage="flat"))
            node.deliver("/joint_states", Message(name=None))
        node.deliver("/imu/data", imu(turns="fast"))
        self.assertEqual(self.made.faults["/battery_state: AttributeError"], 3)
        self.assertEqual(len(node.logged("/battery_state: AttributeError")), 1)
        self.assertEqual(self.samples(), [])
        node.deliver("/joint_states", joints())  # cannot be encoded
        node.deliver("/imu/data", imu())
        self.assertEqual(self.sample(node).yaw_rate, 0.4)
        node.get_topic_names_and_types = None
        node.look()
        self.assertEqual(self.made.faults["discovery: TypeError"], 1)

    def test_main_spins_the_bridge(self):
        node, sent = Node(GRAPH), []

        def spin(spun):
            spun.look(5)
            spun.deliver("/battery_state", Message())
            spun.deliver("/joint_states", joints())
            raise KeyboardInterrupt
        sys.modules["rclpy"].create_node, sys.modules["rclpy"].spin = lambda _: node, spin
        printed = io.StringIO()
        with mock.patch("lcm_udp.Publisher", lambda: Message(publish=lambda channel, data: sent.append(channel))), \
                mock.patch.object(sys, "argv", ["ros2_bridge.py", "--robot-id", "amr"]), contextlib.redirect_stderr(printed):
            ros2_bridge.main()
        self.assertEqual(sent, ["ROBOT_TELEMETRY.amr"])
        self.assertIn("/battery_state: AttributeError: 1 times", printed.getvalue())


unittest.main()
