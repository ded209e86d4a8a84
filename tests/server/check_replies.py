#!/usr/bin/env python3
"""Compares the OpenAPI document and the schemas with the daemon's replies.

  check_replies.py --source DIR --daemon PROGRAM   starts a daemon of its own
  check_replies.py --source DIR --url URL          queries a running one and checks its missions too

Exits with 77 if python3-jsonschema is missing.
"""
import argparse
import gzip
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import urllib.error
import urllib.request

try:
    import jsonschema
except ImportError:
    print("python3-jsonschema is not installed")
    sys.exit(77)

PATH = [{"kind": "straight", "length_m": 5.0}]


class Daemon:
    """A daemon on a free port with an empty store, stopped at the end."""

    def __init__(self, program):
        self.folder = tempfile.TemporaryDirectory()
        self.process = subprocess.Popen(
            [program, "--http-port", "0", "--store-path", self.folder.name + "/store.db", "--log-format", "json",
             "--lcm-url", "memq://"],
            stderr=subprocess.PIPE, text=True)
        self.url = None
        for line in self.process.stderr:
            event = json.loads(line)
            if event["message"] == "ready":
                self.url = event["http"]
                break
        if self.url is None:
            raise SystemExit("the daemon did not become ready")

    def stop(self):
        self.process.terminate()
        code = self.process.wait(timeout=20)
        self.process.stderr.close()
        self.folder.cleanup()
        return code


def ask(url, method, path, body=None, headers=None):
    request = urllib.request.Request(url + path, method=method, headers=dict(headers or {}))
    if body is not None:
        request.data = body if isinstance(body, bytes) else json.dumps(body).encode()
        request.add_header("Content-Type", "application/json")
    try:
        reply = urllib.request.urlopen(request, timeout=10)
    except urllib.error.HTTPError as error:
        reply = error
    with reply:
        return reply.status, reply.headers.get_content_type(), reply.read()


class Checker:
    def __init__(self, url, document):
        self.url = url
        self.document = document
        self.faults = []
        self.checked = set()

    def fault(self, text):
        self.faults.append(text)
        print("FAULT", text)

    def check(self, method, template, path=None, body=None, expect=None, headers=None):
        """Sends the request and validates the reply with the operation's response of that status. Returns the JSON value."""
        path = path or template
        what = f"{method} {path}"
        operation = self.document["paths"][template][method.lower()]
        status, kind, text = ask(self.url, method, path, body, headers)
        self.checked.add((method, template, status))
        if expect is not None and status != expect:
            self.fault(f"{what}: status {status}, expected {expect}: {text[:300]!r}")
            return None
        response = operation["responses"].get(str(status))
        if response is None:
            self.fault(f"{what}: status {status} is not documented: {text[:300]!r}")
            return None
        if "$ref" in response:
            response = self.document["components"]["responses"][response["$ref"].rsplit("/", 1)[1]]
        if kind not in response["content"]:
            self.fault(f"{what}: content type {kind} is not documented")
            return None
        if "json" not in kind:
            return text
        value = json.loads(text)
        schema = {"components": self.document["components"], **response["content"][kind]["schema"]}
        for error in jsonschema.Draft202012Validator(schema).iter_errors(value):
            self.fault(f"{what}: {error.json_path}: {error.message[:300]}")
        if status in (404, 405, 409, 422):
            given = {p["name"] for p in operation.get("parameters", [])}
            if not value.get("constraint"):
                self.fault(f"{what}: the problem of status {status} names no constraint")
            if not value.get("field", "").startswith("/") and value.get("field") not in given:
                self.fault(f"{what}: {value.get('field')!r} is neither a JSON pointer nor a parameter")
        if status >= 400 and value.get("status") != status:
            self.fault(f"{what}: the problem names status {value.get('status')}, not {status}")
        return value


def resolved(document, schema):
    """The schema with its references resolved."""
    while "$ref" in schema:
        node = document
        for part in schema["$ref"].lstrip("#/").split("/"):
            node = node[part]
        schema = node
    return schema


def numbers_of(document, schema, value, at=""):
    """Every number of a request with its pointer and its schema."""
    schema = resolved(document, schema)
    for option in (resolved(document, option) for option in schema.get("oneOf", schema.get("anyOf", ()))):
        constants = {k: v["const"] for k, v in option.get("properties", {}).items() if "const" in v}
        if "properties" in option and isinstance(value, dict) and all(value.get(k) == v for k, v in constants.items()):
            schema = option
            break
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from numbers_of(document, schema["properties"][key], inner, f"{at}/{key}")
    elif isinstance(value, list):
        for k, inner in enumerate(value):
            yield from numbers_of(document, schema["items"], inner, f"{at}/{k}")
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield at, schema


def replaced(value, pointer, number):
    copy = json.loads(json.dumps(value))
    *way, last = pointer.strip("/").split("/")
    node = copy
    for part in way:
        node = node[int(part)] if isinstance(node, list) else node[part]
    node[int(last) if isinstance(node, list) else last] = number
    return copy


POINT = {"x_m": 1, "y_m": 1}
POSE = {**POINT, "heading_rad": 1}
SEGMENTS = [{"kind": "straight", "length_m": 1}, {"kind": "turn", "angle_rad": 1}, {"kind": "arc", "radius_m": 1, "angle_rad": 1},
            {"kind": "polyline", "points": [POINT]}, {"kind": "bezier", "control_1": {"x_m": 2, "y_m": 2}, "control_2": {"x_m": 3, "y_m": 2}, "end": {"x_m": 4, "y_m": 2}},
            {"kind": "gaussian_detour", "length_m": 4, "amplitude_m": 1, "centre_m": 2, "width_m": 1},
            {"kind": "clothoid", "length_m": 1, "start_curvature_1_m": 0, "end_curvature_1_m": 1},
            {"kind": "curvature", "way_m": [0, 1], "curvature_1_m": [0, 0]}, {"kind": "dwell", "duration_s": 1}]
PACE = {"speed_m_s": 1, "acceleration_m_s2": 1, "yaw_rate_rad_s": 1, "yaw_acceleration_rad_s2": 1}
LIMITS = {"speed_m_s": 1, "acceleration_m_s2": 1, "yaw_rate_rad_s": 1, "wheel_speed_rad_s": 1, "current_a": 1, "voltage_v": 1}
DRIVE = {"path": SEGMENTS, "start_pose": POSE, "payload_kg": 0, "deadline_s": 1e4, "value_of_time_w": 1, "regeneration": 0.5,
         "start_speed_m_s": 0, "end_speed_m_s": 0, "limits": LIMITS}
AUTONOMY = {"state_of_charge": 0.5, "state_of_charge_sd": 0.1, "reserve_fraction": 0.1, "payload_kg": 0, "value_of_time_w": 0,
            "confidence": 0.9, "start_pose": POSE, "charger": {**POINT, "detour_factor": 1}, "to_charger_m": 1, **PACE,
            "tasks": [{"task_id": "t", "path": SEGMENTS, "dwell_s": 1, "payload_kg": 0, **PACE},
                      {"pickup": POSE, "dropoff": POSE, "pickup_dwell_s": 1, "dropoff_dwell_s": 1},
                      {"turn_rad": 1, "distance_m": 1, "to_charger_m": 1}]}
# Fields without bounds in the schema: they are limited by the robot or not at all.
UNBOUNDED = {"payload_kg", "start_speed_m_s", "end_speed_m_s", "deadline_s", "way_m", *PACE, *LIMITS}


def hold_bounds(checker, name):
    """The documented bounds of numbers in requests are those that the service enforces."""
    requests = {
        "/v1/robots/{id}/profile": {**DRIVE, "pareto_points": 0},
        "/v1/robots/{id}/estimate": {"profile": {"time_s": [0, 1], "speed_m_s": [0, 1], "yaw_rate_rad_s": [0, 1], "climb_rad": [0, 0.1]}, "payload_kg": 0, "start_pose": POSE},
        "/v1/robots/{id}/autonomy": AUTONOMY,
        "/v1/autonomy": {"request": AUTONOMY},
        "/v1/energy-matrix": {"robots": [{"robot_id": name, "pose": POSE, "state_of_charge": 0.5}], "value_of_time_w": 0,
                              "regeneration": 0.5, "reserve_fraction": 0.1,
                              "tasks": [{"task_id": "t", "payload_kg": 0, "pickup": POSE, "dropoff": POSE, "pickup_dwell_s": 1,
                                         "dropoff_dwell_s": 1, "empty": {"distances_m": [1], "start_pose": POSE}, "loaded": {"distances_m": [1], "turns_rad": [1]}}]},
        "/v1/diagnoses": {"robot_id": name, "max_missions": 1, "hold_back": 0.1, "since_utime_us": 0, "missions": [1]},
    }
    held = 0
    for template, body in requests.items():
        schema = checker.document["paths"][template]["post"]["requestBody"]["content"]["application/json"]["schema"]
        for pointer, number in numbers_of(checker.document, schema, body):
            leaf = next(part for part in reversed(pointer.split("/")) if not part.isdigit())
            low = number.get("minimum", number.get("exclusiveMinimum"))
            if leaf not in UNBOUNDED and pointer != "/missions/0" and (low is None or "maximum" not in number):
                checker.fault(f"{template} {pointer}: the schema has no bounds")
            beyond = []
            if low is not None:
                beyond.append((low, low - max(1, abs(low)) if "minimum" in number else low))
            if "maximum" in number:
                beyond.append((number["maximum"], number["maximum"] + max(1, abs(number["maximum"]))))
            for bound, value in beyond:
                problem = checker.check("POST", template, template.replace("{id}", name), replaced(body, pointer, value), expect=422) or {}
                numbers = [float(n) for n in re.findall(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?", problem.get("constraint", ""))]
                positive = bound == 1 and "positive" in problem.get("constraint", "")
                if problem.get("field") != pointer or not (positive or any(abs(n - bound) <= 1e-9 * abs(bound) for n in numbers)):
                    checker.fault(f"{template} {pointer} = {value}: {problem.get('field')}: {problem.get('constraint')}; the bound of the schema is {bound}")
                held += 1
    print(f"{held} bounds of requests are enforced")
    if held < 200:
        checker.fault("fewer than 200 bounds were checked")


def hold_driving(checker, name, matrix):
    """Estimate, matrix and autonomy agree on the same path with the same driving."""
    path = [{"kind": "straight", "length_m": 40}, {"kind": "turn", "angle_rad": 1.5}, {"kind": "straight", "length_m": 20}]
    estimate = ("POST", "/v1/robots/{id}/estimate", f"/v1/robots/{name}/estimate")
    autonomy = ("POST", "/v1/robots/{id}/autonomy", f"/v1/robots/{name}/autonomy")
    usual = checker.check(*estimate, {"path": path, "driving": "usual"}, expect=200)
    least = checker.check(*estimate, {"path": path}, expect=200)
    plan = checker.check(*autonomy, {"state_of_charge": 0.9, "payload_kg": 0, "tasks": [{"task_id": "t", "path": path}]}, expect=200)["plan"]
    if least["driving"] != "minimum_energy" or not least["energy_j"] < usual["energy_j"]:
        checker.fault(f"the minimum energy is not below usual driving: {least['energy_j']}, {usual['energy_j']}")
    if abs(usual["energy_j"] - plan["expected_energy_j"]) > 1e-9 * usual["energy_j"] or usual["energy_quantiles_j"] != plan["energy_j"]:
        checker.fault(f"usual driving: estimate {usual}, autonomy {plan}")
    legs = {"distances_m": [40, 20], "turns_rad": [1.5]}  # the same way in the matrix's form
    profile = ("POST", "/v1/robots/{id}/profile", f"/v1/robots/{name}/profile")
    planned = lambda way: checker.check(*autonomy, {"state_of_charge": 0.9, "payload_kg": 0, "tasks": [{"task_id": "t", **way}]}, expect=200)["plan"]
    pairs = [(checker.check(*call, {**way, **more}, expect=200) for way in ({"path": path}, legs))
             for call, more in ((estimate, {"driving": "usual"}), (estimate, {}), (profile, {"deadline_s": 120}))]
    for by_path, by_legs in (*pairs, (planned({"path": path}), planned(legs))):
        if by_path != by_legs:
            checker.fault(f"path: {by_path}, legs: {by_legs}")
    for body, field in (({"distances_m": [0]}, "/distances_m"), ({"turns_rad": [0]}, "/turns_rad"), ({"distances_m": [-1]}, "/distances_m/0"),
                        ({"path": path, **legs}, "/distances_m")):
        problem = checker.check(*profile, body, expect=422) or {}
        if problem.get("field") != field:
            checker.fault(f"profile of {body}: {problem}")
    way = {"task_id": "t", "empty": {}, "loaded": legs}
    rows = checker.check("POST", "/v1/energy-matrix", body={"robots": [{"robot_id": name, "state_of_charge": 0.9}], "tasks": [way], "driving": "usual"}, expect=200)["rows"]
    if abs(rows[0]["energy_j"][0] - usual["energy_j"]) > 1e-3 or not rows[0]["success_probability"][0] > 0.9:
        checker.fault(f"usual driving: estimate {usual['energy_j']}, matrix {rows[0]}")
    checker.check("POST", "/v1/energy-matrix", body={**matrix, "driving": "usual"}, expect=200)
    for field, value in (("deadline_s", 90), ("columns", True), ("limits", {"speed_m_s": 1}), ("driving", "fast")):
        problem = checker.check(*estimate, {"path": path, "driving": "usual", field: value}, expect=422) or {}
        if problem.get("field") != "/" + field:
            checker.fault(f"estimate of usual driving with {field}: {problem}")
    problem = checker.check("POST", "/v1/energy-matrix", body={**matrix, "driving": "usual", "value_of_time_w": 1}, expect=422) or {}
    if problem.get("field") != "/value_of_time_w":
        checker.fault(f"matrix of usual driving with a value of time: {problem}")


def hold_pages(checker, name):
    """Lists are paged by limit and cursor; times are ISO 8601 or microseconds."""
    robot = checker.check("GET", "/v1/robots/{id}", f"/v1/robots/{name}", expect=200)["model"]
    for k in range(3):
        checker.check("PUT", "/v1/robots/{id}", f"/v1/robots/page-{k}", {**robot, "robot_id": f"page-{k}"}, expect=200)
        checker.check("PUT", "/v1/robots/{id}", f"/v1/robots/page-0", {**robot, "robot_id": "page-0", "idle_power_w": 10 + k}, expect=200)
    for template, member, key in (("/v1/robots", "robots", "robot_id"), ("/v1/robots/{id}/models", "models", "model_version"),
                                  ("/v1/audit", "entries", "id")):
        path = template.replace("{id}", "page-0")
        whole = [row[key] for row in checker.check("GET", template, path, expect=200)[member]]
        seen, cursor = [], ""
        while len(seen) <= len(whole):
            page = checker.check("GET", template, f"{path}?limit=2{cursor}", expect=200)
            seen += [row[key] for row in page[member]]
            if page["next_cursor"] is None:
                break
            cursor = "&cursor=" + page["next_cursor"]
        if len(whole) < 4 or seen != whole:
            checker.fault(f"{template} by pages: {seen}, whole: {whole}")
    for version, status in ((2, 200), (9, 404), ("x", 404)):
        one = checker.check("GET", "/v1/robots/{id}/models/{version}", f"/v1/robots/page-0/models/{version}", expect=status)
        versions = checker.check("GET", "/v1/robots/{id}/models", "/v1/robots/page-0/models", expect=200)["models"]
        if status == 200 and one != next(row for row in versions if row["model_version"] == version):
            checker.fault(f"version {version}: {one}")
    for side in ("from", "to"):
        problem = checker.check("GET", "/v1/robots/{id}/models/diff", f"/v1/robots/page-0/models/diff?{side}=99", expect=404) or {}
        if problem.get("field") != side:
            checker.fault(f"models/diff of an unknown version: {problem}")
    for template in ("/v1/diagnoses", "/v1/audit", "/v1/event-log", "/v1/robots/{id}/proposals"):
        problem = checker.check("GET", template, template.replace("{id}", name) + "?cursor=x", expect=422) or {}
        if problem.get("field") != "cursor":
            checker.fault(f"{template}: {problem}")
    for times, status in (("from=2026-11-22&to=2026-11-22T16:45:00Z", 200), ("from_utime_us=0&to=2026-11-22T17:45:00%2B01:00", 200),
                          ("from=2026-11-22T10:00:00Z&to=2026-11-22", 200), ("from=2026-11-23&to=2026-11-22T23:00:00Z", 422),
                          ("from=yesterday", 422), ("from=2026-11-22&from_utime_us=0", 422), ("to=2026-02-30", 422)):
        problem = checker.check("GET", "/v1/missions", f"/v1/missions?{times}", expect=status)
        if status == 422 and (problem or {}).get("field") != times.split("=")[0]:
            checker.fault(f"{times}: {problem}")


def hold_former_paths(checker, name):
    """Paths and members of the version before answer as the present ones, with a Deprecation header."""
    for method, former, path, body in (("GET", "/v1/robots/{id}/versions", "/v1/robots/{id}/models", None),
                                       ("GET", "/v1/robots/{id}/versions/diff", "/v1/robots/{id}/models/diff", None),
                                       ("POST", "/v1/robots/{id}/model", "/v1/robots/{id}/models", {"version": 1}),
                                       ("GET", "/v1/audit-log", "/v1/event-log", None)):
        checker.check(method, path, path.replace("{id}", name), body, expect=200)
        hold_former(checker, [(method, each.replace("{id}", name), body) for each in (former, path)])
        if former in checker.document["paths"]:
            checker.fault(f"{former} is in the document")
    for path, former, present in (
            ("/v1/robots/{id}/autonomy", {"state_of_charge": 0.9, "tasks": [{"turn_rad": 1, "distance_m": 2}]},
             {"state_of_charge": 0.9, "tasks": [{"distances_m": [0, 2], "turns_rad": [1]}]}),
            ("/v1/autonomy", {"robots": [{"robot_id": name, "request": {"state_of_charge": 0.9, "tasks": [{"distance_m": 2}]}}]},
             {"robots": [{"robot_id": name, "request": {"state_of_charge": 0.9, "tasks": [{"distances_m": [2]}]}}]}),
            ("/v1/energy-matrix", {"robots": [name], "tasks": [{"task_id": "t", "empty": {"distance_m": 2}, "loaded": {}}]},
             {"robots": [name], "tasks": [{"task_id": "t", "empty": {"distances_m": [2]}, "loaded": {}}]})):
        hold_former(checker, [("POST", path.replace("{id}", name), body) for body in (former, present)])


def hold_former(checker, requests):
    """The first request is that of the version before; its list of models has another name."""
    answers = []
    for method, path, body in requests:
        request = urllib.request.Request(checker.url + path, body and json.dumps(body).encode(), {"Content-Type": "application/json"}, method=method)
        with urllib.request.urlopen(request, timeout=10) as reply:
            answers.append((reply.headers["Deprecation"], reply.status, reply.read().replace(b'"versions":', b'"models":')))
    if answers[0][1:] != answers[1][1:] or answers[1][0] is not None or not re.fullmatch(r"@\d+", answers[0][0] or ""):
        checker.fault(f"{requests[0]} is answered {answers[0]}, {requests[1]} {answers[1]}")


def hold_logs(checker):
    """Order, kinds and times of both logs, compared with the whole logs."""
    for k in (1, 2):  # events of two kinds
        checker.check("DELETE", "/v1/robots/{id}", f"/v1/robots/page-{k}", expect=200)
        checker.check("POST", "/v1/robots/{id}/models", "/v1/robots/page-0/models", {"version": k}, expect=200)
    found = 0
    for template, member, kind in (("/v1/audit", "entries", "action"), ("/v1/event-log", "events", "kind")):
        whole = checker.check("GET", template, f"{template}?limit=1000&order=asc", expect=200)[member]
        names = sorted({row[kind] for row in whole})
        middle = whole[len(whole) // 2]["utime_us"]
        end = whole[-1]["utime_us"] + 1  # the audit of former requests is still being stored
        for order in ("asc", "desc", None):
            for kinds in ([], names[:1], names[:2], ["absent"]):
                for low, high in ((0, end), (middle, end), (0, middle)):
                    query = f"limit=1000&from_utime_us={low}&to_utime_us={high}&kind={','.join(kinds)}" + (f"&order={order}" if order else "")
                    ids = [row["id"] for row in checker.check("GET", template, f"{template}?{query}", expect=200)[member]]
                    wanted = [row["id"] for row in whole if low <= row["utime_us"] < high and (not kinds or row[kind] in kinds)]
                    if (order or ("desc" if member == "entries" else "asc")) == "desc":
                        wanted.reverse()
                    found += len(ids)
                    if ids != wanted:
                        checker.fault(f"{template}?{query}: {ids}, not {wanted}")
        for query, field in (("order=up", "order"), ("from_utime_us=2&to_utime_us=1", "from_utime_us"), ("to=tomorrow", "to")):
            problem = checker.check("GET", template, f"{template}?{query}", expect=422) or {}
            if problem.get("field") != field:
                checker.fault(f"{template}?{query}: {problem}")
    if found < 50:
        checker.fault(f"only {found} entries of logs were compared")


def hold_metric_names(checker, source, metrics):
    """The dashboard and the alert rules use only metrics of the daemon."""
    present = set(re.findall(r"^# TYPE (\w+) ", metrics, re.M))
    # Metrics that only exist in a cluster.
    present |= set(re.findall(r'"(joulecast_cluster_\w+)"', (source / "server/daemon_metrics.cc").read_text()))
    for file in ("deploy/grafana-dashboard.json", "deploy/prometheus-rules.yml"):
        used = set(re.findall(r"\b(?:joulecast|process)_\w+", (source / file).read_text()))
        if not used or not used <= present:
            checker.fault(f"{file} uses unknown metrics: {sorted(used - present)}")


def hold_mission_lists(checker):
    """Order, filters, groups and CSV of missions, also in an empty store."""
    for query in ("sort=ratio&order=asc", "sort=wh_per_km", "robot_id=a,b&name_contains=x&ratio_min=0.5&ratio_max=2"):
        checker.check("GET", "/v1/missions", f"/v1/missions?{query}", expect=200)
    for query in ("sort=taste", "order=up", "ratio_min=2&ratio_max=1", "robot_id=,"):
        checker.check("GET", "/v1/missions", f"/v1/missions?{query}", expect=422)
    for group in ("robot", "day", "week", "kind", "robot,day", "robot,week"):
        checker.check("GET", "/v1/mission-totals", f"/v1/mission-totals?group_by={group}&utc_offset_min=60", expect=200)
    checker.check("GET", "/v1/mission-totals", "/v1/mission-totals?group_by=moon", expect=422)
    for query, status in (("cell_m=2&limit=3", 200), ("robot_id=check-1,absent&from=2020-01-01", 200), ("cell_m=0.01", 422),
                          ("cell_m=wide", 422), ("robot_id=,", 422), ("from=yesterday", 422), ("limit=0", 422)):
        checker.check("GET", "/v1/floor-map", f"/v1/floor-map?{query}", expect=status)
    checker.check("GET", "/v1/tariff", expect=200)
    for query, status in (("", 200), ("robot_id=absent", 200), ("limit=1", 200), ("robot_id=,", 422), ("limit=201", 422)):
        checker.check("GET", "/v1/recent-values", f"/v1/recent-values?{query}", expect=status)
    for template, query in (("/v1/missions", ""), ("/v1/mission-totals", "?group_by=robot")):
        text = checker.check("GET", template, template + query, expect=200, headers={"Accept": "text/csv"})
        if not isinstance(text, bytes) or b",battery_j," not in text.split(b"\r\n")[0]:
            checker.fault(f"{template} as CSV: {text!r}")
    checker.check("GET", "/v1/proposals", expect=200)


def hold_maps(checker, name):
    """Floor plans with their images, and the place of a robot."""
    level = "/v1/maps/{map}/levels/{level}"
    path = "/v1/maps/hall/levels/2"
    png = b"\x89PNG\r\n\x1a\n" + bytes(range(256))
    svg = b'<svg xmlns="http://www.w3.org/2000/svg"><script>alert(1)</script></svg>'

    def put(query, image, kind):
        request = urllib.request.Request(f"{checker.url}{path}?{query}", image, {"Content-Type": kind}, method="PUT")
        try:
            with urllib.request.urlopen(request, timeout=10) as reply:
                return reply.status, json.loads(reply.read())
        except urllib.error.HTTPError as error:
            return error.code, json.loads(error.read())

    checker.check("GET", level, path, expect=404)
    for query, image, kind in (("resolution_m=0.05", svg, "image/png"), ("resolution_m=0.05", png, "text/html"), ("", png, "image/png"),
                               ("resolution_m=0.05&chargers=1", png, "image/png"), ("resolution_m=0", png, "image/png")):
        status, answer = put(query, image, kind)
        if status != 422:
            checker.fault(f"a plan with {query!r} as {kind}: {status} {answer}")
    status, answer = put("resolution_m=0.05", png + bytes(4_000_000), "image/png")
    if status != 413:
        checker.fault(f"a plan of 4 MB and more: {status}")
    for image, kind in ((png, "image/png"), (svg, "image/svg+xml")):
        status, answer = put("resolution_m=0.05&origin_x_m=-3&chargers=1,2;-3.5,4", image, kind)
        if status != 200 or answer["origin_x_m"] != -3 or answer["chargers"] != [{"x_m": 1, "y_m": 2}, {"x_m": -3.5, "y_m": 4}]:
            checker.fault(f"a plan as {kind}: {status} {answer}")
        with urllib.request.urlopen(checker.url + path, timeout=10) as reply:
            policy = reply.headers["Content-Security-Policy"]
            if (reply.read(), reply.headers["Content-Type"], policy) != (image, kind, "sandbox; default-src 'none'"):
                checker.fault(f"the plan as {kind}: {reply.headers}")
    place = ("PUT", "/v1/robots/{id}/place", f"/v1/robots/{name}/place")
    checker.check(*place, {"map": "hall", "level": "2"}, expect=200)
    for body in ({"map": "no spaces"}, {"floor": "1"}):
        checker.check(*place, body, expect=422)
    maps = checker.check("GET", "/v1/maps", expect=200)
    here = [robot for robot in maps["robots"] if robot["robot_id"] == name]
    if here != [{"robot_id": name, "map": "hall", "level": "2", "reported": False}] or len(maps["levels"]) != 1:
        checker.fault(f"/v1/maps: {maps}")
    checker.check("DELETE", level, path, expect=200)
    checker.check("DELETE", level, path, expect=404)


def hold_robot_checks(checker, model):
    """A review finds what is wrong and what is suspicious, and stores nothing."""
    sound = checker.check("POST", "/v1/robot-checks", body=model, expect=200)
    wrong = checker.check("POST", "/v1/robot-checks", body={**model, "idle_power_w": -1}, expect=200)
    odd = checker.check("POST", "/v1/robot-checks", body={**model, "idle_power_w": 0}, expect=200)
    if sound["energy_wh"] != model["battery"]["nominal_voltage_v"] * model["battery"]["capacity_ah"]:
        checker.fault(f"energy of a full battery: {sound}")
    if [(f["fault"], f["field"]) for f in wrong["findings"]] != [(True, "/idle_power_w")] or wrong["energy_wh"] is not None:
        checker.fault(f"review of a wrong file: {wrong}")
    if [(f["fault"], f["field"]) for f in odd["findings"]] != [(False, "/idle_power_w")] or odd["standing_h"] is not None:
        checker.fault(f"review of a suspicious file: {odd}")


def hold_conveniences(checker, name):
    """Digits, codings, entity tags, CSV and foreign origins, as described in the reference."""
    path = f"/v1/robots/{name}"
    with urllib.request.urlopen(checker.url + path, timeout=10) as reply:
        tag = reply.headers["ETag"]
    status, _, again = ask(checker.url, "GET", path, headers={"If-None-Match": tag})
    if (status, again) != (304, b""):
        checker.fault(f"{path} with its ETag: {status} {again!r}")
    with urllib.request.urlopen(checker.url + "/openapi.json", timeout=10) as reply:
        plain = reply.read()
    with urllib.request.urlopen(urllib.request.Request(checker.url + "/openapi.json", headers={"Accept-Encoding": "gzip"}), timeout=10) as reply:
        packed = reply.read()
        if reply.headers["Content-Encoding"] != "gzip" or gzip.decompress(packed) != plain:
            checker.fault("/openapi.json is not served gzipped")
    drive = ("POST", "/v1/robots/{id}/profile", f"{path}/profile")
    body = {"path": [{"kind": "straight", "length_m": 7.3}]}
    whole = checker.check(drive[0], drive[1], drive[2] + "?digits=17", body, expect=200)
    usual = checker.check(*drive, body, expect=200)
    few = checker.check(drive[0], drive[1], drive[2] + "?digits=3", body, expect=200)
    if abs(whole["profile"]["energy_j"][-1] / whole["energy_j"] - 1) > 1e-9:
        checker.fault(f"digits=17: the column of energies ends at {whole['profile']['energy_j'][-1]}, the energy is {whole['energy_j']}")
    for answer, digits in ((usual, 10), (few, 3)):
        if answer["energy_j"] != float(f"{whole['energy_j']:.{digits}g}") and answer["energy_j"] < 10**digits:
            checker.fault(f"{digits} digits of {whole['energy_j']}: {answer['energy_j']}")
    checker.check(drive[0], drive[1], drive[2] + "?digits=1", body, expect=422)
    for template, column in (("/v1/robots", b"state_of_charge"), ("/v1/event-log", b"detail"), ("/v1/diagnoses", b"finished_utime_us"), ("/v1/proposals", b"adopted_version"),
                             ("/v1/robots/{id}/gap-history", b"ratio"), ("/v1/robots/{id}/proposals", b"kind")):
        text = checker.check("GET", template, template.replace("{id}", name), expect=200, headers={"Accept": "text/csv"})
        if not isinstance(text, bytes) or column not in text.split(b"\r\n")[0]:
            checker.fault(f"{template} as CSV: {text!r}")
    foreign = {"Origin": "https://elsewhere.example"}
    if ask(checker.url, "POST", drive[2], body, foreign)[0] != 403:
        checker.fault("a page of a foreign origin may compute profiles although http.allowed_origins is empty")


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--source", required=True, type=pathlib.Path)
    arguments.add_argument("--daemon")
    arguments.add_argument("--url")
    given = arguments.parse_args()

    for file in sorted((given.source / "schemas").glob("*.schema.json")):
        jsonschema.Draft202012Validator.check_schema(json.loads(file.read_text()))

    daemon = Daemon(given.daemon) if given.daemon else None
    url = daemon.url if daemon else given.url.rstrip("/")
    try:
        served = ask(url, "GET", "/openapi.json")[2].decode()
        checker = Checker(url, json.loads(served))
        committed = (given.source / "schemas" / "openapi.json").read_text()
        if served != committed:
            checker.fault("schemas/openapi.json differs from the served document; regenerate: joulecastd --print-openapi")
        if given.daemon:
            printed = subprocess.run([given.daemon, "--print-openapi"], capture_output=True, text=True, check=True)
            if printed.stdout != served:
                checker.fault("--print-openapi differs from the served document")
        exercise(checker, given.source)
        if daemon and daemon.stop() != 0:
            checker.fault("the daemon did not exit with 0")
        daemon = None
    finally:
        if daemon:
            daemon.process.kill()
    print(f"{len(checker.checked)} kinds of replies checked, {len(checker.faults)} faults")
    return 1 if checker.faults else 0


def exercise(checker, source):
    robot = json.loads((source / "deploy" / "robots" / "nomad.json").read_text())
    name = robot["robot_id"]
    # Every operation with paths that need no state, then the faults common to all operations.
    checker.check("PUT", "/v1/robots/{id}", f"/v1/robots/{name}", robot)
    for template, methods in checker.document["paths"].items():
        for method, operation in methods.items():
            method = method.upper()
            if operation["operationId"] in ("streamEvents",):
                continue
            robots = template.startswith("/v1/robots/{id}")
            path = template.replace("{id}", name if robots else "no-such-thing")
            if method == "GET":
                required = [p["name"] for p in operation.get("parameters", []) if p["in"] == "query" and p["required"]]
                checker.check(method, template, path, expect=404 if path != template and not robots else
                              422 if required else None)
                checker.check(method, template, path + "?no-such-key=1", expect=400)
                checker.check(method, template, path, headers={"Accept": "font/woff"}, expect=406)
            elif operation["operationId"] == "putFloorPlan":
                checker.check(method, template, path, b"{", expect=422)
            elif method in ("POST", "PUT"):
                checker.check(method, template, path, b"{", expect=400)
                checker.check(method, template, path, b'{"a": 1, "a": 2}', expect=400)
                reviewed = operation["operationId"] == "checkRobot"  # it answers what is wrong
                checker.check(method, template, path, {"no-such-field": 1}, expect=200 if reviewed else 422)
            if robots and method != "PUT":
                body = None if method == "GET" else {"path": PATH}
                checker.check(method, template, template.replace("{id}", "no-such-robot"), body, expect=404)
    checker.check("POST", "/v1/robots/{id}/profile", f"/v1/robots/{name}/profile", {"path": PATH}, expect=200)
    mission = ("POST", "/v1/robots/{id}/missions", f"/v1/robots/{name}/missions")
    checker.check(*mission, {"event": "started", "mission_id": "m-1"}, expect=202)
    checker.check(*mission, {"event": "started", "mission_id": "m-2"}, expect=409)
    checker.check(*mission, {"event": "aborted", "mission_id": "m-1", "note": "blocked"}, expect=202)
    checker.check("POST", "/v1/session", body={"token": "none is needed here"}, expect=409)
    for template, body, status, field, constraint in (
            ("/v1/robots/{id}/profile", {}, 422, "/path", "is required"),
            ("/v1/robots/{id}/profile", {"paht": PATH}, 422, "/path", "is required; unknown here: paht"),
            ("/v1/robots/{id}/profile", {"path": PATH, "spede": 1}, 422, "/spede", "is an unknown field"),
            ("/v1/robots/{id}/profile", {"path": []}, 422, "/path", "must be an array"),
            ("/v1/robots/{id}/profile", {"path": [{"kind": "polyline"}]}, 422, "/path/0/points", "is required"),
            ("/v1/robots/{id}/profile", {"path": PATH, "deadline_s": 0.01}, 422, "/deadline_s", ""),
            ("/v1/robots/{id}/profile", b'{"path": [{"kind": "straight", "length_m": 1, "length_m": 2}]}', 400,
             "/path/0/length_m", "the key is given more than once"),
            ("/v1/energy-matrix", {"robots": [name]}, 422, "/tasks", "is required"),
            ("/v1/diagnoses", {"robot_id": name}, 409, "/robot_id", "no mission that has ended")):
        problem = checker.check("POST", template, template.replace("{id}", name), body, expect=status) or {}
        if problem.get("field") != field or constraint not in problem.get("constraint", ""):
            checker.fault(f"{template} {body}: {problem.get('field')}: {problem.get('constraint')}, not {field}: {constraint}")
    hold_bounds(checker, name)
    empty = checker.check("POST", "/v1/robots/{id}/autonomy", f"/v1/robots/{name}/autonomy", {"state_of_charge": 0.5, "tasks": [{}]}, expect=422)
    if (empty or {}).get("field") != "/tasks/0/path":
        checker.fault(f"an empty task: {empty}")
    # The message for an unknown robot is the same everywhere.
    wording = "no robot is called 'no-such-robot'"
    requests = [("GET", t, t.replace("{id}", "no-such-robot"), None) for t in ("/v1/robots/{id}", "/v1/robots/{id}/state", "/v1/robots/{id}/models",
                                                                            "/v1/robots/{id}/proposals", "/v1/robots/{id}/gap-history")]
    requests += [("POST", t, t.replace("{id}", "no-such-robot"), {"path": PATH}) for t in ("/v1/robots/{id}/profile", "/v1/robots/{id}/estimate")]
    requests += [("POST", "/v1/robots/{id}/autonomy", "/v1/robots/no-such-robot/autonomy", {}), ("POST", "/v1/diagnoses", "/v1/diagnoses", {"robot_id": "no-such-robot"}),
              ("POST", "/v1/robots/{id}/models", "/v1/robots/no-such-robot/models", {"version": 1}),
              ("POST", "/v1/robots/{id}/missions", "/v1/robots/no-such-robot/missions", {"event": "started", "mission_id": "m"}),
              ("POST", "/v1/robots/{id}/acknowledge", "/v1/robots/no-such-robot/acknowledge", {"kind": "silent", "note": ""})]
    for method, template, path, body in requests:
        problem = checker.check(method, template, path, body, expect=404) or {}
        if problem.get("constraint") != wording:
            checker.fault(f"{method} {path}: {problem.get('constraint')}")
    problem = checker.check("POST", "/v1/autonomy", body={"robots": ["no-such-robot"]}, expect=200)
    if problem["robots"][0]["problem"]["message"] != wording:
        checker.fault(f"/v1/autonomy: {problem}")
    # No battery telemetry has been received.
    charge = checker.check("GET", "/v1/robots/{id}/state", f"/v1/robots/{name}/state", expect=200)["charge"]
    if charge["current_bias_a"] is not None:
        checker.fault(f"a robot without telemetry has a current sensor offset: {charge}")
    model = checker.check("GET", "/v1/robots/{id}", f"/v1/robots/{name}", expect=200)
    compact = json.dumps(model, separators=(",", ":"), ensure_ascii=False)
    served = ask(checker.url, "GET", f"/v1/robots/{name}")[2].decode()
    if served.count(" ") > compact.count(" ") or "\n" in served:
        checker.fault("a stored robot file is served with its original white space")
    metrics = ask(checker.url, "GET", "/metrics")[2].decode()
    hold_metric_names(checker, source, metrics)
    if 'joulecast_missions_ended_total{state="finished"}' not in metrics or 'state="open"' in metrics:
        checker.fault("joulecast_missions_ended_total lacks finished missions or counts open ones")
    fast = {"profile": {"time_s": [0, 1, 2], "speed_m_s": [0, 9, 0]}}  # beyond the robot's limits
    checker.check("POST", "/v1/robots/{id}/estimate", f"/v1/robots/{name}/estimate", fast, expect=200)
    ramp = {"time_s": [0, 10, 20], "speed_m_s": [0, 0.5, 0], "height_m": [0, 0.1, 0.2]}
    checker.check("POST", "/v1/robots/{id}/estimate", f"/v1/robots/{name}/estimate", {"profile": ramp}, expect=200)
    for change, field, constraint in (({"height_m": [0, 0.1]}, "/profile/height_m", "as many entries as time_s"),
                                      ({"climb_rad": [0, 0, 0]}, "/profile/climb_rad", "combined with height_m"),
                                      ({"height_m": [0, 0.1, 9]}, "/profile/height_m/2", "steeper than 45 degrees")):
        problem = checker.check("POST", "/v1/robots/{id}/estimate", f"/v1/robots/{name}/estimate", {"profile": {**ramp, **change}}, expect=422) or {}
        if problem.get("field") != field or constraint not in problem.get("constraint", ""):
            checker.fault(f"estimate {change}: {problem.get('field')}: {problem.get('constraint')}, not {field}: {constraint}")
    errand = {"task_id": "t", "payload_kg": 1, "empty": {"distances_m": [3]}, "loaded": {"distances_m": [2, 4], "turns_rad": [1.6]}}
    matrix = {"robots": [{"robot_id": name, "pose": {"x_m": 0, "y_m": 0}}],
              "tasks": [errand, {**errand, "payload_kg": 1e5}, {"task_id": "u", "pickup": {"x_m": 1, "y_m": 2}, "dropoff": {"x_m": 3, "y_m": 0}}]}
    checker.check("POST", "/v1/energy-matrix", body=matrix, expect=200)
    checker.check("POST", "/v1/energy-matrix", body={**matrix, "robots": [*matrix["robots"], "no-such-robot"]}, expect=200)
    checker.check("POST", "/v1/energy-matrix", body={**matrix, "tasks": [{"task_id": "t"}]}, expect=422)
    checker.check("POST", "/v1/energy-matrix", body={"robots": [matrix["robots"][0]] * 2001, "tasks": [errand] * 2000}, expect=413)
    hold_driving(checker, name, matrix)
    hold_pages(checker, name)
    hold_former_paths(checker, name)
    hold_logs(checker)
    hold_mission_lists(checker)
    hold_conveniences(checker, name)
    hold_maps(checker, name)
    hold_robot_checks(checker, json.loads((source / "deploy/robots/amr.json").read_text()))
    status, kind, _ = ask(checker.url, "DELETE", "/v1/robots")
    if (status, kind) != (405, "application/problem+json"):
        checker.fault(f"DELETE /v1/robots: {status} {kind}")

    page = checker.check("GET", "/v1/missions", expect=200)
    listed = next((value for value in (page or {}).values() if isinstance(value, list)), [])
    for mission in listed[:5]:
        mission_id = next((mission[key] for key in ("id", "mission_id") if key in mission), None)
        for template in checker.document["paths"]:
            if re.fullmatch(r"/v1/missions/\{id\}(/\w+)?", template):
                checker.check("GET", template, template.replace("{id}", str(mission_id)), expect=200)


if __name__ == "__main__":
    sys.exit(main())
