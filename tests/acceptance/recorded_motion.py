"""Public recordings of motion, imported as by a user: cars on a dynamometer and on the road, a robot with currents held for a
second, one on six grounds. One folder contains a log and a robot file of each."""
import gzip
import json
import os
import shutil

from harness import shared_folder

CAR_WHEEL_M = 0.33
GROUNDS = ("FLOORING", "ASPHALT", "ICE", "SANDY_LOAM", "SNOW", "MIXED")


def car_mapping(robot_id, time, speed, voltage, current):
    wheel = {"column": speed, "divide_by": CAR_WHEEL_M}
    return {"robot_id": robot_id, "time": {"column": time, "unit": "s"},
            "fields": {"wheel_velocity": [wheel, wheel], "battery_voltage": voltage, "battery_current": current}}


def car(robot_id):
    """Public data of such a car; the trial estimates friction and idle power."""
    return {"robot_id": robot_id,
            "kinematics": {"wheel_radius_m": CAR_WHEEL_M, "half_track_m": 0.8},
            "mass": {"chassis_kg": 1700, "wheel_kg": 25, "yaw_inertia_kg_m2": 2500, "wheel_inertia_kg_m2": 1.2},
            "motor": {"resistance_ohm": 0.01, "torque_constant_nm_a": 0.3, "voltage_constant_v_s_rad": 0.3,
                      "gear_ratio": 9, "viscous_friction_nm_s_rad": 0, "friction_torque_nm": [30, 30]},
            "battery": {"nominal_voltage_v": 380, "capacity_ah": 170, "internal_resistance_ohm": 0.08,
                        "reserve_fraction": 0.1},
            "idle_power_w": 300,
            "limits": {"speed_m_s": 45, "acceleration_m_s2": 4, "yaw_rate_rad_s": 1, "current_a": 400,
                       "payload_kg": 400}}


class Importer:
    def __init__(self, programs, options):
        self.programs, self.options = programs, options
        self.folder = programs.path("motion")
        os.mkdir(self.folder)

    def write(self, name, document):
        with open(os.path.join(self.folder, name), "w", encoding="utf-8") as file:
            json.dump(document, file)

    def deployed(self, *parts):
        with open(os.path.join(self.options.source, "deploy", *parts), encoding="utf-8") as file:
            return json.load(file)

    def take(self, name, tables, mapping, robot, *more):
        mapping_file = self.programs.path(name + ".mapping.json")
        with open(mapping_file, "w", encoding="utf-8") as file:
            json.dump(mapping, file)
        self.programs.run("import", *tables, "--mapping", mapping_file, *more,
                          "--out", os.path.join(self.folder, name + ".lcmlog"))
        self.write(name + ".json", robot)

    def unpacked(self, table):
        plain = self.programs.path(table.name.removesuffix(".gz"))
        with gzip.open(table) as packed, open(plain, "wb") as file:
            shutil.copyfileobj(packed, file)
        return plain


def import_all(importer, options):
    start = ("--start", "2024-01-01T10:00:00Z")
    volt = {"column": "pack_V"}
    bev = shared_folder(options, "real", "motives_bev")
    for table in sorted((bev / "lab").glob("*.csv.gz")):
        importer.take(table.name.removesuffix(".csv.gz"), [importer.unpacked(table)],
                      car_mapping("bev", "t_s", "v_mps", volt, {"column": "I_total_dis_A"}), car("bev"), *start)
    for table in sorted((bev / "road").glob("*.csv.gz")):
        importer.take(table.name.removesuffix(".csv.gz"), [importer.unpacked(table)],
                      car_mapping("bev", "t_s", "v_mps", volt, {"column": "pack_I_dis_A"}), car("bev"), *start)
    # Power was recorded without voltage: a constant voltage converts it into a current.
    tesla = shared_folder(options, "real", "evpino_tesla3") / "Tesla3_full.csv.gz"
    importer.take("tesla", [importer.unpacked(tesla)],
                  car_mapping("tesla", "Time", "Speed", {"constant": 350}, {"column": "BatteryPower", "divide_by": 350}),
                  car("tesla"), *start)
    # Both currents as logged: the inner wheel of a turn returns power.
    warthog = importer.deployed("import", "warthog_grass.json")
    warthog["fields"]["battery_current"] = {"columns": ["right_wheel_current", "left_wheel_current"], "combine": "sum"}
    importer.take("warthog", sorted(shared_folder(options, "real", "warthog_grass").glob("*.csv")), warthog,
                  importer.deployed("robots", "warthog-grass.json"))
    # No voltage either: the motors' currents at the 24 V bus replace battery power.
    husky = importer.deployed("import", "borealtc_husky.json")
    husky["fields"].pop("motor_current", None)
    husky["fields"] |= {"battery_voltage": {"constant": 24},
                        "battery_current": {"columns": ["curL", "curR"], "combine": "sum"}}
    folder = shared_folder(options, "real", "borealtc_husky")
    for day, ground in enumerate(GROUNDS, start=1):
        importer.take("husky-" + ground, sorted((folder / ground).glob("pro_*.csv")), husky,
                      importer.deployed("robots", "borealtc-husky.json"), "--start", f"2024-01-0{day}T10:00:00Z")
