#!/usr/bin/env python3
"""Holds the OpenAPI document and the schemas against what the daemon really serves and answers.

  check_replies.py --source DIR --daemon PROGRAM   starts a daemon of its own
  check_replies.py --source DIR --url URL          asks a running one, whose missions are then checked too

Ends with 77 where python3-jsonschema is missing.
"""
import argparse
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
        """Asks and holds the reply against the operation's response of that status; returns the JSON of it."""
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
            checker.fault("schemas/openapi.json is not what is served; regenerate: joulecastd --print-openapi")
        if given.daemon:
            printed = subprocess.run([given.daemon, "--print-openapi"], capture_output=True, text=True, check=True)
            if printed.stdout != served:
                checker.fault("--print-openapi differs from what is served")
        exercise(checker, given.source)
        if daemon and daemon.stop() != 0:
            checker.fault("the daemon did not stop in order")
        daemon = None
    finally:
        if daemon:
            daemon.process.kill()
    print(f"{len(checker.checked)} kinds of replies checked, {len(checker.faults)} faults")
    return 1 if checker.faults else 0


def exercise(checker, source):
    robot = json.loads((source / "deploy" / "robots" / "nomad.json").read_text())
    name = robot["robot_id"]
    # Every operation with the paths that need no state, then the faults every operation can have.
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
                checker.check(method, template, path, headers={"Accept": "image/png"}, expect=406)
            elif method in ("POST", "PUT"):
                checker.check(method, template, path, b"{", expect=400)
                checker.check(method, template, path, b'{"a": 1, "a": 2}', expect=400)
                checker.check(method, template, path, {"no-such-field": 1}, expect=422)
            if robots and method != "PUT":
                body = None if method == "GET" else {"path": PATH}
                checker.check(method, template, template.replace("{id}", "no-such-robot"), body, expect=404)
    checker.check("POST", "/v1/robots/{id}/profile", f"/v1/robots/{name}/profile", {"path": PATH}, expect=200)
    for template, body, status, field, constraint in (
            ("/v1/robots/{id}/profile", {}, 422, "/path", "is required"),
            ("/v1/robots/{id}/profile", {"paht": PATH}, 422, "/path", "is required; not known here: paht"),
            ("/v1/robots/{id}/profile", {"path": PATH, "spede": 1}, 422, "/spede", "is not a known field"),
            ("/v1/robots/{id}/profile", {"path": []}, 422, "/path", "must be an array"),
            ("/v1/robots/{id}/profile", {"path": [{"kind": "polyline"}]}, 422, "/path/0/points", "is required"),
            ("/v1/robots/{id}/profile", {"path": PATH, "deadline_s": 0.01}, 422, "/deadline_s", ""),
            ("/v1/robots/{id}/profile", b'{"path": [{"kind": "straight", "length_m": 1, "length_m": 2}]}', 400,
             "/path/0/length_m", "the key is given more than once"),
            ("/v1/energy-matrix", {"robots": [name]}, 422, "/tasks", "is required"),
            ("/v1/diagnoses", {"robot_id": name}, 409, "/robot_id", "no mission that has ended")):
        told = checker.check("POST", template, template.replace("{id}", name), body, expect=status) or {}
        if told.get("field") != field or constraint not in told.get("constraint", ""):
            checker.fault(f"{template} {body}: {told.get('field')}: {told.get('constraint')}, not {field}: {constraint}")
    model = checker.check("GET", "/v1/robots/{id}", f"/v1/robots/{name}", expect=200)
    compact = json.dumps(model, separators=(",", ":"), ensure_ascii=False)
    served = ask(checker.url, "GET", f"/v1/robots/{name}")[2].decode()
    if served.count(" ") > compact.count(" ") or "\n" in served:
        checker.fault("a stored robot file is served with the space it was written with")
    metrics = ask(checker.url, "GET", "/metrics")[2].decode()
    if 'joulecast_missions_ended_total{state="finished"}' not in metrics or 'state="open"' in metrics:
        checker.fault("joulecast_missions_ended_total counts missions that are open, or none")
    fast = {"profile": {"time_s": [0, 1, 2], "speed_m_s": [0, 9, 0]}}  # beyond the robot's limits
    checker.check("POST", "/v1/robots/{id}/estimate", f"/v1/robots/{name}/estimate", fast, expect=200)
    errand = {"task_id": "t", "payload_kg": 1, "empty": {"distance_m": 3}, "loaded": {"distances_m": [2, 4], "turns_rad": [1.6]}}
    matrix = {"robots": [{"robot_id": name, "pose": {"x_m": 0, "y_m": 0}}],
              "tasks": [errand, {**errand, "payload_kg": 1e5}, {"task_id": "u", "pickup": {"x_m": 1, "y_m": 2}, "dropoff": {"x_m": 3, "y_m": 0}}]}
    checker.check("POST", "/v1/energy-matrix", body=matrix, expect=200)
    checker.check("POST", "/v1/energy-matrix", body={**matrix, "robots": [*matrix["robots"], "no-such-robot"]}, expect=200)
    checker.check("POST", "/v1/energy-matrix", body={**matrix, "tasks": [{"task_id": "t"}]}, expect=422)
    checker.check("POST", "/v1/energy-matrix", body={"robots": [matrix["robots"][0]] * 2001, "tasks": [errand] * 2000}, expect=413)
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
