"""ROS messages for tests: written from their definitions, independently of the readers that the project uses."""

import struct

HEADER = "std_msgs/Header header"
DEFINITIONS = {
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance",
    "geometry_msgs/PoseStamped": f"{HEADER}\ngeometry_msgs/Pose pose",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist\nfloat64[36] covariance",
    "geometry_msgs/TwistStamped": f"{HEADER}\ngeometry_msgs/Twist twist",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/TransformStamped": f"{HEADER}\nstring child_frame_id\ngeometry_msgs/Transform transform",
    "nav_msgs/Odometry": f"{HEADER}\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
                         "geometry_msgs/TwistWithCovariance twist",
    "sensor_msgs/BatteryState": f"{HEADER}\nfloat32 voltage\nfloat32 temperature\nfloat32 current\nfloat32 charge\n"
                                "float32 capacity\nfloat32 design_capacity\nfloat32 percentage\nuint8 power_supply_status\n"
                                "uint8 power_supply_health\nuint8 power_supply_technology\nbool present\n"
                                "float32[] cell_voltage\nfloat32[] cell_temperature\nstring location\nstring serial_number",
    "sensor_msgs/Imu": f"{HEADER}\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
                       "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
                       "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance",
    "sensor_msgs/JointState": f"{HEADER}\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort",
    "sensor_msgs/Temperature": f"{HEADER}\nfloat64 temperature\nfloat64 variance",
    "std_msgs/String": "string data",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
}
NUMBERS = {"float64": "d", "float32": "f", "uint8": "B", "bool": "B", "int32": "i", "uint32": "I"}
STAMP = {1: ("time", "uint32 secs\nuint32 nsecs"), 2: ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec")}
# The robot's clock reads this where a message has no stamp.
NO_TIME = 0


def fields_of(kind, ros):
    """(type, length or None, name) of each field; a length of -1 is any."""
    if kind == STAMP[ros][0]:
        text = STAMP[ros][1]
    elif kind == "std_msgs/Header":
        text = ("uint32 seq\n" if ros == 1 else "") + f"{STAMP[ros][0]} stamp\nstring frame_id"
    else:
        text = DEFINITIONS[kind]
    for line in text.split("\n"):
        kind, name = line.split()
        kind, _, length = kind.partition("[")
        yield kind, (int(length[:-1] or -1) if length else None), name


def definition(kind, ros):
    """The text of a type with those that it uses, as recorders keep it."""
    parts, todo = [], [kind]
    for each in todo:
        body = "\n".join(f"{k}{'' if n is None else '[]' if n < 0 else f'[{n}]'} {name}" for k, n, name in fields_of(each, ros))
        parts.append(body if each == kind else f"MSG: {each}\n{body}")
        todo += [k for k, _, _ in fields_of(each, ros) if "/" in k and k not in todo]
    return ("\n" + "=" * 80 + "\n").join(parts) + "\n"


class Encoder:
    """ROS 1's serialization (ros=1) or CDR, little-endian (ros=2), of messages that are dictionaries. Missing fields are 0
    or empty."""

    def __init__(self, ros):
        self.ros, self.out = ros, bytearray()

    def number(self, code, value):
        size = struct.calcsize(code)
        if self.ros == 2:
            self.out += b"\0" * (-len(self.out) % size)
        self.out += struct.pack("<" + code, value)

    def one(self, kind, value):
        if kind in NUMBERS:
            self.number(NUMBERS[kind], value or 0)
        elif kind == "string":
            data = (value or "").encode() + (b"\0" if self.ros == 2 else b"")
            self.number("I", len(data))
            self.out += data
        elif kind == STAMP[self.ros][0]:
            self.number("i", (value or 0) // 10**9)
            self.number("I", (value or 0) % 10**9)
        else:
            for each, length, name in fields_of(kind, self.ros):
                part = (value or {}).get(name)
                if length is None:
                    self.one(each, part)
                    continue
                items = list(part or [0] * max(length, 0))
                if length < 0:
                    self.number("I", len(items))
                for item in items:
                    self.one(each, item)


def encode(kind, message, ros):
    encoder = Encoder(ros)
    encoder.one(kind, message)
    return (b"\0\1\0\0" if ros == 2 else b"") + bytes(encoder.out)
