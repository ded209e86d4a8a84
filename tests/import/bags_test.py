"""One simulated drive in every container of ROS gives the energies of its LCM log; topics, joints, signs and clocks that
differ are recognised or reported: bags_test.py CLIENT SOURCE PACKAGES, where PACKAGES has node_modules with @mcap/core."""

import base64
import json
import math
import os
import re
import shutil
import sqlite3
import struct
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import messages

try:
    import rosbag
    import rospy
    import roslib.message
except ImportError:
    sys.exit(print("web test skipped: python3-rosbag is missing"))

CLIENT, SOURCE, PACKAGES = (Path(argument).resolve() for argument in sys.argv[1:4])
del sys.argv[1:4]
ROBOT = SOURCE / "deploy/robots/amr.json"
HERE = Path(__file__).resolve().parent
NAMES = ["utime", "right", "left", "volts", "amps", "v", "w", "yaw_rate", "pitch", "x", "y", "heading"]
JOINTS = ["wheel_right_joint", "wheel_left_joint"]


def run(*words, code=0, **how):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False, **how)
    if done.returncode != code:
        raise AssertionError(f"{words}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout + done.stderr


def telemetry_of(log):
    """(robot id, encoded message) of each sample in an LCM event log."""
    data, at = log.read_bytes(), 0
    while at < len(data):
        _, _, _, channel, length = struct.unpack_from(">IQQII", data, at)
        at += 28
        name, body = data[at:at + channel].decode(), data[at + channel:at + channel + length]
        at += channel + length
        if name.startswith("ROBOT_TELEMETRY."):
            yield name.partition(".")[2], body


def samples_of(log):
    """The telemetry of an LCM event log, each sample a dictionary of NAMES."""
    samples = []
    for _, body in telemetry_of(log):
        (utime, _, text), rest = struct.unpack_from(">qqI", body, 8), 28
        d = struct.unpack_from(">18d", body, rest + text)
        samples.append(dict(zip(NAMES, [utime, d[0], d[1], d[6], d[7], d[8], d[9], d[10], d[11], d[12], d[13], d[14]])))
    return samples


def quaternion(yaw, pitch_down=0.0):
    """Of the rotation Rz(yaw) Ry(pitch_down)."""
    (cy, sy), (cp, sp) = ((math.cos(a / 2), math.sin(a / 2)) for a in (yaw, pitch_down))
    return {"w": cy * cp, "x": -sy * sp, "y": cy * sp, "z": sy * cp}


def twist(v, w):
    return {"linear": {"x": v}, "angular": {"z": w}}


class Drive:
    """Messages (time in ns, topic, type, message) of a drive."""

    def __init__(self, samples):
        self.samples, self.list = samples, []

    def add(self, topic, kind, make, every=1, stamp=True):
        for sample in self.samples[::every]:
            self.put(sample["utime"] * 1000, topic, kind, make(sample), stamp)
        return self

    def put(self, at_ns, topic, kind, message, stamp=True):
        if "Header header" in messages.DEFINITIONS[kind]:
            message = {"header": {"stamp": at_ns if stamp else messages.NO_TIME, "frame_id": "odom"}, **message}
        self.list.append((at_ns, topic, kind, message))

    def wheels(self, stamp=True, name=tuple(JOINTS), topic="/joint_states"):
        return self.add(topic, "sensor_msgs/JointState", lambda s: {
            "name": name, "position": [0, 0], "velocity": [s["right"], s["left"]]}, stamp=stamp)

    def battery(self, every=1, sign=-1, stamp=True):
        return self.add("/battery_state", "sensor_msgs/BatteryState", lambda s: {
            "voltage": s["volts"], "current": sign * s["amps"]}, every, stamp)

    def rest(self):
        self.add("/imu/data", "sensor_msgs/Imu", lambda s: {
            "orientation": quaternion(0.3, -s["pitch"]), "angular_velocity": {"z": s["yaw_rate"]}})
        self.add("/odom", "nav_msgs/Odometry", lambda s: {
            "pose": {"pose": {"position": {"x": s["x"], "y": s["y"]}, "orientation": quaternion(s["heading"])}},
            "twist": {"twist": twist(0, 0)}})
        return self.add("/cmd_vel", "geometry_msgs/Twist", lambda s: twist(s["v"], s["w"]))

    def all(self):
        return self.wheels().battery().rest()


def fill(target, values):
    """Puts a dictionary into a message of Debian's ROS packages."""
    for name, value in values.items():
        old = getattr(target, name)
        if isinstance(value, dict):
            fill(old, value)
        elif isinstance(old, rospy.rostime.genpy.Time):
            setattr(target, name, rospy.Time.from_sec(0) if value == 0 else rospy.Time(value // 10**9, value % 10**9))
        elif isinstance(value, (list, tuple)) and value and isinstance(value[0], dict):
            kind = roslib.message.get_message_class("geometry_msgs/TransformStamped")
            setattr(target, name, [fill(kind(), each) for each in value])
        else:
            setattr(target, name, list(value) if isinstance(value, tuple) else value)
    return target


def write_ros1(path, drive, compression="none"):
    with rosbag.Bag(str(path), "w", compression=compression) as bag:
        for at, topic, kind, message in sorted(drive.list, key=lambda each: each[0]):
            made = fill(roslib.message.get_message_class(kind)(), message)
            bag.write(topic, made, rospy.Time(at // 10**9, at % 10**9))


def write_mcap(path, drive, ros=2, definitions=True, compression=""):
    encoding = {1: ["ros1", "ros1msg"], 2: ["cdr", "ros2msg"]}[ros]
    rows = []
    for at, topic, kind, message in drive.list:
        name = kind if ros == 1 else kind.replace("/", "/msg/")
        text = messages.definition(kind, ros) if definitions else ""
        rows.append([at, topic, name, text, base64.b64encode(messages.encode(kind, message, ros)).decode()])
    given = path.with_suffix(".in.json")
    given.write_text(json.dumps({"encoding": encoding[0], "schemaEncoding": encoding[1], "compression": compression, "messages": rows}))
    run("node", HERE / "write_mcap.mjs", PACKAGES, given, path)
    given.unlink()


def write_db3(path, drive, journal="memory"):
    """rosbag2_storage_sqlite3's schema."""
    base = sqlite3.connect(path)
    base.execute(f"PRAGMA journal_mode={journal}")
    base.executescript("""
        CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
        CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);
        CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
            serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
        CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL);
        CREATE INDEX timestamp_idx ON messages (timestamp ASC);
        INSERT INTO schema VALUES (3, 'humble');""")
    ids = {}
    for at, topic, kind, message in drive.list:
        if topic not in ids:
            ids[topic] = len(ids) + 1
            base.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')", (ids[topic], topic, kind.replace("/", "/msg/")))
        base.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)",
                     (ids[topic], at, messages.encode(kind, message, 2)))
    base.commit()
    base.close()


def write_folder(path, drive, storage, parts=1):
    """A folder as `ros2 bag record` leaves it, split into files of one duration."""
    path.mkdir()
    ordered = sorted(drive.list, key=lambda each: each[0])
    files = []
    for k in range(parts):
        part = Drive([])
        part.list = ordered[k * len(ordered) // parts:(k + 1) * len(ordered) // parts]
        files.append(f"{path.name}_{k}.{storage}")
        (write_db3 if storage == "db3" else write_mcap)(path / files[-1], part)
    names = "".join(f"    - {name}\n" for name in files)
    (path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n"
        f"  relative_file_paths:\n{names}  compression_format: \"\"\n  compression_mode: \"\"\n")
    return [path / name for name in files]


class Bags(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.home = Path(tempfile.mkdtemp(prefix="joulecast-bags-"))
        cls.log = cls.home / "original.lcmlog"
        run(CLIENT, "simulate", "--robots", 1, "--robot", ROBOT, "--seed", 7, "--missions", 1, "--mission-duration", 40,
            "--rate", 20, "--speed", 0, "--pitch", "--no-motor-channels", "--start", "2026-03-01T08:00:00Z", "--log", cls.log, "--quiet")
        cls.samples = samples_of(cls.log)
        cls.original = cls.energy(cls, cls.log)[0]["energy"]

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.home)

    def setUp(self):
        self.place = Path(tempfile.mkdtemp(dir=self.home))

    def energy(self, log):
        """The missions of a log, as a daemon accounts for them."""
        store = Path(tempfile.mkdtemp(dir=self.home)) / "store.db"
        robot = store.with_name("robot.json")
        robot.write_text(re.sub(r'("robot_id": *)"[^"]*"', rf'\1"{next(telemetry_of(log))[0]}"', ROBOT.read_text(), count=1))
        return json.loads(run(CLIENT, "replay", log, "--into", store, "--robot", robot, "--json"))["missions"]

    def bring(self, *words, code=0):
        """The log and the output of the import."""
        log = self.place / "out.lcmlog"
        text = run(CLIENT, "import", *words, "--robot", ROBOT, "--out", log, "--force", code=code)
        return log, text

    def mcap(self, drive, name="drive.mcap", **how):
        path = self.place / name
        write_mcap(path, drive, **how)
        return path

    def assert_same(self, log, relative=1e-6):
        missions = self.energy(log)
        self.assertEqual(len(missions), 1)
        for name in ("battery_j", "modelled_j", "distance_m"):
            self.assertAlmostEqual(missions[0]["energy"][name] / self.original[name], 1, delta=relative, msg=name)

    def test_ros1_bags(self):
        for compression in ("none", "bz2", "lz4"):
            with self.subTest(compression):
                path = self.place / f"{compression}.bag"
                write_ros1(path, Drive(self.samples).all(), compression)
                self.assert_same(self.bring(path)[0])

    def test_mcap_of_both_ros(self):
        for ros in (1, 2):
            with self.subTest(ros):
                self.assert_same(self.bring(self.mcap(Drive(self.samples).all(), ros=ros))[0])

    def test_mcap_without_definitions(self):
        self.assert_same(self.bring(self.mcap(Drive(self.samples).all(), definitions=False))[0])

    def test_compressed_mcap(self):
        self.assert_same(self.bring(self.mcap(Drive(self.samples).all(), compression="zstd"))[0])

    def test_ros2_sqlite(self):
        for journal in ("memory", "wal"):
            with self.subTest(journal):
                path = self.place / f"{journal}.db3"
                write_db3(path, Drive(self.samples).all(), journal)
                self.assert_same(self.bring(path)[0])

    def test_ros2_folders(self):
        for storage, parts in (("db3", 1), ("db3", 3), ("mcap", 2)):
            with self.subTest(storage, parts=parts):
                files = write_folder(self.place / f"{storage}{parts}", Drive(self.samples).all(), storage, parts)
                self.assert_same(self.bring(self.place / f"{storage}{parts}")[0])
                self.assert_same(self.bring(*files)[0])
                (files[0].parent / "metadata.yaml").unlink()
                self.assert_same(self.bring(files[0].parent)[0])

    def test_samples_are_the_original(self):
        imported = samples_of(self.bring(self.mcap(Drive(self.samples).all()))[0])
        self.assertEqual(len(imported), len(self.samples))
        for had, has in zip(self.samples, imported):
            for name in NAMES:
                turns = 2 * math.pi * round((had[name] - has[name]) / (2 * math.pi)) if name == "heading" else 0
                self.assertAlmostEqual(had[name], has[name] + turns, delta=1e-5 * max(1, abs(had[name])), msg=name)

    def test_positions_give_speeds(self):
        for wraps in (False, True):
            at, before = [0.0, 0.0], None
            drive = Drive(self.samples).battery().rest()
            for sample in self.samples:
                if before:
                    at = [at[k] + (sample[n] + before[n]) / 2 * 1e-6 * (sample["utime"] - before["utime"]) for k, n in enumerate(("right", "left"))]
                before = sample
                position = [math.remainder(a, 2 * math.pi) for a in at] if wraps else at
                drive.put(sample["utime"] * 1000, "/joint_states", "sensor_msgs/JointState", {
                    "name": JOINTS, "position": position, "velocity": [] if wraps else [0, 0]})
            log, text = self.bring(self.mcap(drive))
            self.assertIn("positions of wheel_right_joint and wheel_left_joint", text)
            self.assert_same(log, 0.02)

    def test_wheel_odometry_gives_speeds(self):
        kinematics = json.loads(ROBOT.read_text())["kinematics"]
        r, b = kinematics["wheel_radius_m"], kinematics["half_track_m"]
        drive = Drive(self.samples).battery().add("/odom", "nav_msgs/Odometry", lambda s: {
            "pose": {"pose": {"position": {"x": s["x"], "y": s["y"]}, "orientation": quaternion(s["heading"])}},
            "twist": {"twist": twist(r * (s["right"] + s["left"]) / 2, r * (s["right"] - s["left"]) / (2 * b))}})
        imported = samples_of(self.bring(self.mcap(drive))[0])
        for had, has in zip(self.samples, imported):
            self.assertAlmostEqual(had["right"], has["right"], places=9)
            self.assertAlmostEqual(had["left"], has["left"], places=9)
            self.assertAlmostEqual(had["x"], has["x"], places=9)

    def test_other_robots_are_left_out(self):
        lists = {}
        for robot, samples in (("amr_1", self.samples), ("amr_2", [{**s, "amps": 3 * s["amps"]} for s in self.samples + 99 * self.samples[-1:]])):
            drive = Drive(samples).all()
            lists[robot] = [(at, f"/{robot}{topic}", kind, message) for at, topic, kind, message in drive.list]
        both, own = Drive([]), Drive([])
        both.list, own.list = lists["amr_2"] + lists["amr_1"], lists["amr_1"]
        mapping = self.place / "mapping.json"
        mapping.write_text(json.dumps({"topics": {"wheels": "/amr_1/joint_states"}}))
        log, text = self.bring(self.mcap(both), "--mapping", mapping)
        self.assertIn("topics below /amr_2/ belong to other robots", text)
        self.assertNotIn("packs in parallel", text)
        self.assert_same(log)
        self.assertNotIn("left out", self.bring(self.mcap(own))[1])

    def test_other_odometry_is_no_robot(self):
        drive = Drive(self.samples).battery().rest()
        drive.list += [(at, "/camera/odom", kind, message) for at, topic, kind, message in drive.list if topic == "/odom"]
        names = {"/odom": "/base/odom", "/imu/data": "/camera/imu"}
        drive.list = [(at, names.get(topic, topic), kind, message) for at, topic, kind, message in drive.list]
        log, text = self.bring(self.mcap(drive))
        self.assertNotIn("other robots", text)
        self.assertTrue(any(math.isfinite(sample["yaw_rate"]) for sample in samples_of(log)))

    def test_other_joints_are_passed_over(self):
        drive = Drive(self.samples).all().wheels(name=("shoulder", "elbow"))
        drive.add("/arm/joint_states", "sensor_msgs/JointState", lambda s: {"name": ["gripper"], "position": [1]})
        log, text = self.bring(self.mcap(drive))
        self.assertIn(f"{len(self.samples)} messages without both", text)
        self.assertIn("/arm/joint_states (sensor_msgs/msg/JointState, %d messages): not used" % len(self.samples), text)
        self.assert_same(log)

    def test_wheels_in_messages_of_their_own(self):
        drive = Drive(self.samples).battery().rest()
        for k, side in enumerate(("left", "right")):
            drive.add("/joint_states", "sensor_msgs/JointState", lambda s, side=side, k=k: {
                "name": [f"wheel_{side}_joint"], "position": [0], "velocity": [s[side]]})
        self.assert_same(self.bring(self.mcap(drive))[0])

    def test_joints_are_named_by_a_mapping(self):
        path = self.mcap(Drive(self.samples).battery().rest().wheels(name=("rad_r", "rad_l")))
        _, text = self.bring(path, code=1)
        self.assertIn("rad_l, rad_r", text)
        mapping = self.place / "mapping.json"
        mapping.write_text(json.dumps({"joints": {"right": "rad_r", "left": "rad_l"}}))
        self.assert_same(self.bring(path, "--mapping", mapping)[0])

    def test_usual_names_of_joints(self):
        for right, left in (("rwheel_joint", "lwheel_joint"), ("wheelR", "wheelL"), ("right_drive_joint", "left_drive_joint"),
                            ("right_track", "left_track"), ("amr/front_right_wheel", "amr/front_left_wheel")):
            drive = Drive(self.samples).battery().rest().wheels(name=(right, left))
            self.assertIn(f"velocities of {right} and {left}", self.bring(self.mcap(drive))[1])
        for right, left in (("arm_right", "arm_left"), ("right_caster_wheel", "left_caster_wheel"), ("motor_r", "motor_l")):
            drive = Drive(self.samples).battery().rest().wheels(name=(right, left))
            self.assertIn("--mapping names them", self.bring(self.mcap(drive), code=1)[1])

    def test_currents_without_numbers_are_named(self):
        drive = Drive(self.samples).wheels().add("/battery", "sensor_msgs/BatteryState", lambda s: {"voltage": s["volts"], "current": math.nan})
        self.assertIn("its current is never a number", self.bring(self.mcap(drive))[1])

    def test_packs_in_parallel_are_named(self):
        drive = Drive(self.samples).wheels().battery().add("/second/battery", "sensor_msgs/BatteryState", lambda s: {"voltage": s["volts"], "current": 0})
        self.assertIn("/second/battery: packs in parallel to /battery_state are not added", self.bring(self.mcap(drive))[1])

    def test_live_battery_is_used(self):
        """Of two topics, not the first by name or the one with more messages: of another voltage, dead, or without currents."""
        for voltage, current in ((12, 0.5), (26, 0), (26, math.nan)):
            drive = Drive(self.samples).wheels().rest().battery(2)
            drive.add("/aux/battery", "sensor_msgs/BatteryState", lambda s: {"voltage": voltage, "current": -current * (1 + s["amps"])})
            log, text = self.bring(self.mcap(drive))
            self.assertIn("/aux/battery: packs in parallel to /battery_state are not added", text)
            self.assertIn('{"topics": {"battery": "/aux/battery"}} uses it', text)
            self.assert_same(log, 0.02)

    def test_cut_bags_are_named(self):
        bag, base = self.place / "cut.bag", self.place / "cut.db3"
        write_ros1(bag, Drive(self.samples).all())
        write_db3(base, Drive(self.samples).all())
        for path, repair in ((bag, "`rosbag reindex` repairs it"), (base, "cut.db3 .recover")):
            path.write_bytes(path.read_bytes()[:path.stat().st_size * 2 // 3])
            self.assertIn(repair, self.bring(path, code=1)[1])

    def test_mapping_mistakes_are_named(self):
        path, mapping = self.mcap(Drive(self.samples).all()), self.place / "mapping.json"
        for wrong, part in (({"topic": {}}, "unknown member 'topic'"), ({"topics": {"wheel": "/a"}}, "'wheel' is none of"),
                            ({"topics": {"battery": "/bms"}}, "there are /battery_state"),
                            ({"battery_current": "reversed"}, "positive_discharging")):
            mapping.write_text(json.dumps(wrong))
            self.assertIn(part, self.bring(path, "--mapping", mapping, code=2)[1])

    def test_check_reads_mappings(self):
        mapping = self.place / "mapping.json"
        for members, code, part in (({"topics": {"battery": "/bms", "pose": None}, "robot_id": "amr"}, 0, "no problems found"),
                                    ({"topics": {"wheel": "/a"}}, 1, "'wheel' is none of"), ({"joints": {}, "topic": {}}, 1, "unknown member 'topic'"),
                                    ({"battery_current": "reversed"}, 1, "positive_discharging")):
            mapping.write_text(json.dumps(members))
            text = run(CLIENT, "check", mapping, code=code)
            self.assertIn("mapping.json: mapping of bags", text)
            self.assertIn(part, text)

    def test_sign_of_the_current(self):
        path, mapping = self.mcap(Drive(self.samples).wheels().battery(sign=1).rest()), self.place / "mapping.json"
        self.assertIn('by its sign the battery charges', self.bring(path)[1])
        mapping.write_text(json.dumps({"battery_current": "positive_discharging"}))
        log, text = self.bring(path, "--mapping", mapping)
        self.assertNotIn("charges", text)
        self.assert_same(log)

    def test_slow_batteries_are_measured(self):
        for every in (20, 40, 200):
            log, _ = self.bring(self.mcap(Drive(self.samples).wheels().rest().battery(every)))
            measured = [s for s in samples_of(log) if not math.isnan(s["volts"])]
            self.assertEqual(len(measured), len(self.samples), every)

    def test_silent_batteries_are_not_measured(self):
        drive = Drive(self.samples).wheels().rest()
        drive.list += Drive(self.samples[:len(self.samples) // 2]).battery(20).list
        measured = [s for s in samples_of(self.bring(self.mcap(drive))[0]) if not math.isnan(s["volts"])]
        self.assertAlmostEqual(len(measured) / len(self.samples), 0.5, delta=0.1)

    def test_commands_of_both_kinds(self):
        drive = Drive(self.samples).wheels().battery().add("/cmd_vel", "geometry_msgs/TwistStamped",
                                                           lambda s: {"twist": twist(s["v"], s["w"])})
        for had, has in zip(self.samples, samples_of(self.bring(self.mcap(drive))[0])):
            self.assertEqual((had["v"], had["w"]), (has["v"], has["w"]))

    def test_pose_from_transforms(self):
        drive = Drive(self.samples).wheels().battery()
        for k, s in enumerate(self.samples):
            at = s["utime"] * 1000
            # The map turned by 90 degrees against odometry's frame.
            x, y, yaw = s["y"], -s["x"], s["heading"] - math.pi / 2
            links = [("odom", "base_link", x, y, yaw)] + [("map", "odom", 0, 0, math.pi / 2)] * (k % 5 == 0)
            drive.put(at, "/tf", "tf2_msgs/TFMessage", {"transforms": [
                {"header": {"stamp": at, "frame_id": parent}, "child_frame_id": child,
                 "transform": {"translation": {"x": px, "y": py}, "rotation": quaternion(turn)}}
                for parent, child, px, py, turn in links]})
        for ros in (1, 2):
            had, has = self.samples[-1], samples_of(self.bring(self.mcap(drive, ros=ros))[0])[-1]
            for name in ("x", "y"):
                self.assertAlmostEqual(had[name], has[name], places=6)
            self.assertAlmostEqual(math.remainder(had["heading"] - has["heading"], 2 * math.pi), 0, places=6)

    def test_poses_and_goals(self):
        drive = Drive(self.samples).wheels().battery()
        drive.add("/goal_pose", "geometry_msgs/PoseStamped", lambda s: {"pose": {"position": {"x": 9}, "orientation": quaternion(0)}})
        self.assertTrue(math.isnan(samples_of(self.bring(self.mcap(drive))[0])[-1]["x"]))
        drive.add("/localization", "geometry_msgs/PoseStamped", lambda s: {
            "pose": {"position": {"x": s["x"], "y": s["y"]}, "orientation": quaternion(s["heading"])}})
        self.assertAlmostEqual(samples_of(self.bring(self.mcap(drive))[0])[-1]["x"], self.samples[-1]["x"])

    def test_temperatures_are_covariates(self):
        drive = Drive(self.samples).all().add("/ambient/temperature", "sensor_msgs/Temperature", lambda s: {"temperature": 21.5})
        text = run(CLIENT, "import", self.mcap(drive), "--robot", ROBOT, "--out", self.place / "out.lcmlog", "--json")
        report = json.loads(text)
        self.assertEqual(report["recordings"][0]["covariates"], [{"name": "ambient_temperature_c", "changes": 1}])
        self.assertIn("/ambient/temperature (sensor_msgs/msg/Temperature", "".join(report["sources"][0]["topics"]))

    def test_messages_without_stamps(self):
        self.assert_same(self.bring(self.mcap(Drive(self.samples).wheels(stamp=False).battery().rest()))[0])

    def test_foreign_clocks_are_left_out(self):
        drive = Drive(self.samples).wheels().rest()
        other = Drive(self.samples).battery()
        for at, topic, kind, message in other.list:
            message["header"]["stamp"] += 37 * 10**9
            drive.list.append((at, topic, kind, message))
        log, text = self.bring(self.mcap(drive))
        self.assertIn("its stamps are 37.0 s ahead of the wheels'", text)
        self.assert_same(log)

    def test_simulated_time_gets_a_day(self):
        drive = Drive(self.samples).wheels().battery()
        begin = drive.list[0][0]
        for _, _, _, message in drive.list:
            message["header"]["stamp"] -= begin - 10**9
        imported = samples_of(self.bring(self.mcap(drive))[0])
        self.assertEqual(imported[0]["utime"], self.samples[0]["utime"])

    def test_restarted_clock_begins_mission(self):
        drive = Drive([])
        for k in range(2):
            shift_us = k * 60 * 10**6
            part = Drive([{**s, "utime": s["utime"] + shift_us} for s in self.samples]).all()
            for _, _, _, message in part.list:
                if "header" in message:
                    message["header"]["stamp"] -= (self.samples[0]["utime"] + shift_us) * 1000 - 10**9
            drive.list += part.list
        log, text = self.bring(self.mcap(drive))
        self.assertIn("the clock of the wheels starts again", text)
        missions = self.energy(log)
        self.assertEqual([m["mission_id"] for m in missions], ["drive", "drive-2"])
        for mission in missions:
            self.assertAlmostEqual(mission["energy"]["battery_j"] / self.original["battery_j"], 1, delta=1e-6)
        numbers = [struct.unpack_from(">q", body, 16)[0] for _, body in telemetry_of(log)]
        self.assertEqual(numbers, list(range(2 * len(self.samples))))
        path = self.place / "drive.mcap"
        path.write_bytes(path.read_bytes()[:-8])
        self.assertIn("ends before its footer", self.bring(path)[1])

    def test_several_drives_are_missions(self):
        later = [{**s, "utime": s["utime"] + 600 * 10**6} for s in self.samples]
        paths = [self.mcap(Drive(self.samples).all(), "a.mcap"), self.mcap(Drive(later).all(), "b.mcap")]
        missions = self.energy(self.bring(*paths)[0])
        self.assertEqual([m["mission_id"] for m in missions], ["a", "b"])

    def test_topics_in_files_of_their_own(self):
        paths = [self.mcap(Drive(self.samples).battery(), "power.mcap"), self.mcap(Drive(self.samples).wheels().rest(), "base.mcap")]
        self.assert_same(self.bring(*paths)[0])

    def test_cut_recordings_are_read_up_to_the_cut(self):
        path = self.mcap(Drive(self.samples).all())
        path.write_bytes(path.read_bytes()[:path.stat().st_size // 2])
        log, text = self.bring(path)
        self.assertIn("ends before its footer", text)
        self.assertGreater(len(samples_of(log)), len(self.samples) // 3)

    def test_undecodable_messages_are_left_out(self):
        path = self.place / "truncated.db3"
        write_db3(path, Drive(self.samples).all(), "memory")
        with sqlite3.connect(path) as bag:
            bag.execute("UPDATE messages SET data = substr(data, 1, 40) WHERE id IN (SELECT messages.id FROM messages "
                        "JOIN topics ON topics.id = topic_id WHERE type LIKE '%JointState' LIMIT 2 OFFSET 100)")
        bag.close()
        log, text = self.bring(path)
        self.assertIn("messages that cannot be decoded are left out", text)
        self.assertEqual(len(samples_of(log)), len(self.samples) - 2)

    def test_unusable_files_are_named(self):
        path = self.place / "empty.bag"
        path.write_text("nothing")
        self.assertIn("empty.bag: is neither a ROS 1 bag nor MCAP", self.bring(path, code=1)[1])
        self.assertIn("is a folder without a bag", self.bring(self.home, code=1)[1])
        self.assertIn("no JointState and no Odometry", self.bring(self.mcap(Drive(self.samples).battery()), code=1)[1])
        self.assertIn("nowhere.mcap", self.bring(self.place / "nowhere.mcap", code=1)[1])

    def test_missing_node_is_named(self):
        text = run(CLIENT, "import", self.mcap(Drive(self.samples).all()), "--robot", ROBOT, "--out", self.place / "o.lcmlog",
                   code=3, env={"PATH": "/nonexistent"})
        self.assertIn("apt install nodejs", text)

    def test_documented_commands(self):
        """A bag of each kind to a diagnosis by the two commands of import.md."""
        text = (SOURCE / "deploy/documents/import.md").read_text()
        commands = re.findall(r"^joulecast (?:import|gap) .*$", re.search(r"```text\n(joulecast import drive.*?)```", text, re.S)[1], re.M)
        self.assertEqual([command.split()[1] for command in commands], ["import", "gap"])
        drive = Drive(self.samples).all()
        write_ros1(self.place / "drive.bag", drive)
        write_db3(self.place / "drive.db3", drive)
        write_folder(self.place / "drive", drive, "mcap")
        self.mcap(drive)
        shutil.copy(ROBOT, self.place / "robot.json")
        for bag in ("drive.bag", "drive.db3", "drive.mcap", "drive"):
            with self.subTest(bag):
                path = f"{CLIENT.parent}:{os.environ['PATH']}"
                printed = [run("bash", "-c", command.replace("drive.mcap", bag), cwd=self.place, env={**os.environ, "PATH": path})
                           for command in commands]
                self.assertIn("battery", printed[0])
                self.assertIn("gap", printed[1].lower())
                (self.place / "drive.lcmlog").unlink()


unittest.main()
