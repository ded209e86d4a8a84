#!/usr/bin/env python3
"""Checks the examples of schemas/examples with the OpenAPI document and a daemon.

Every operation with a body has an example request, which a daemon with a history answers with 2xx; every operation
that answers with JSON has an example answer of its schema. --update writes the example answers that are missing or
differ from their schemas, with long lists shortened. Exits with 77 if python3-jsonschema is missing.
"""
import argparse
import contextlib
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

try:
    import jsonschema
except ImportError:
    print("python3-jsonschema is not installed")
    sys.exit(77)

EVENT_S = 60  # longest wait for an event
LONGEST = 3  # items of a list in an example: a pose has three numbers
# The value of {id} by the beginning of a path, and by operation; queries of other paths. "spare" is a second robot.
IDS = {"/v1/robots/": "amr", "/v1/missions/": "1", "/v1/diagnoses/": "1"}
THINGS = {"cancelDiagnosis": "2", "removeRobot": "spare", "listRecentValues": "?robot_id=amr", "mapFloor": "?cell_m=2&limit=5",
          "totalMissions": "?group_by=robot", "putFloorPlan": "?resolution_m=0.05&origin_x_m=-15&origin_y_m=-10"}
# What other operations depend on, and what removes that; between them the operations have the document's order.
FIRST = ["putRobot", "putFloorPlan", "startDiagnosis", "startDiagnosis", "cancelDiagnosis", "listAttention", "acknowledgeAttention",
         "adoptModel"]
LAST = ["removeFloorPlan", "removeRobot"]
SIGNED_IN = ["createSession", "deleteSession"]
FLOOR_PLAN = b'<svg xmlns="http://www.w3.org/2000/svg" width="600" height="400"/>'
# Answers that are not JSON or not reproducible, and the document itself.
WITHOUT_EXAMPLE = {"streamEvents", "streamDiagnosis", "getDiagnosisReport", "getMetrics", "getOpenApi", "getOperatorPage"}


@contextlib.contextmanager
def daemon(program, folder, *arguments):
    process = subprocess.Popen([program, "--http-port", "0", "--log-format", "json", "--lcm-url", "memq://",
                                "--store-path", f"{folder}/history.db", *arguments], stderr=subprocess.PIPE, text=True)
    try:
        for line in process.stderr:
            event = json.loads(line)
            if event["message"] == "ready":
                yield event["http"]
                return
        raise SystemExit("the daemon did not become ready")
    finally:
        process.terminate()
        process.wait(timeout=120)
        process.stderr.close()


def ask(url, method, path, body=None, headers=None):
    request = urllib.request.Request(url + path, method=method, headers=dict(headers or {}))
    if body is not None:
        image = isinstance(body, bytes)
        request.data = body if image else json.dumps(body).encode()
        request.add_header("Content-Type", "image/svg+xml" if image else "application/json")
    try:
        reply = urllib.request.urlopen(request, timeout=60)
    except urllib.error.HTTPError as error:
        reply = error
    with reply:
        text = reply.read()
        return reply.status, json.loads(text) if text and "json" in reply.headers.get_content_type() else text, reply.headers


def shortened(value):
    if isinstance(value, list):
        return [shortened(each) for each in value[:1 if value and isinstance(value[0], dict) else LONGEST]]
    if isinstance(value, dict):
        return {key: shortened(each) for key, each in value.items()}
    return value


class Examples:
    def __init__(self, document, folder, update):
        self.document, self.folder, self.update = document, folder, update
        self.operations = {operation["operationId"]: (method.upper(), path, operation)
                           for path, item in document["paths"].items() for method, operation in item.items()}
        self.faults, self.asked, self.requests, self.answers, self.events = [], set(), 0, 0, 0

    def fault(self, text):
        self.faults.append(text)
        print("FAULT", text)

    def differences(self, schema, value):
        whole = {"components": self.document["components"], **schema}
        return [f"{error.json_path}: {error.message[:300]}" for error in jsonschema.Draft202012Validator(whole).iter_errors(value)]

    def hold(self, what, schema, value):
        for difference in self.differences(schema, value):
            self.fault(f"{what}: {difference}")

    def ask(self, url, name, replace=None, headers=None):
        """Sends the example, or the operation without a body, and validates both examples with their schemas."""
        method, template, operation = self.operations[name]
        thing = THINGS.get(name) or next((each for begin, each in IDS.items() if template.startswith(begin)), "")
        path = template.replace("{id}", thing) if "{id}" in template else template + thing
        path = path.replace("{map}", "hall").replace("{level}", "1").replace("{version}", "1")
        body = None
        if "image/svg+xml" in operation.get("requestBody", {}).get("content", {}):
            body = FLOOR_PLAN
        elif "requestBody" in operation:
            content = operation["requestBody"]["content"]["application/json"]
            if "example" not in content:
                return self.fault(f"{name}: the document has no example of its request")
            body = {**content["example"], **(replace or {})}
            self.hold(f"{name}: request", content["schema"], content["example"])
            self.requests += name not in self.asked
        status, answer, headers = ask(url, method, path, body, headers)
        self.asked.add(name)
        if str(status) not in operation["responses"] or not 200 <= status < 300:
            return self.fault(f"{method} {path}: {status}: {answer}")
        content = operation["responses"][str(status)].get("content", {}).get("application/json")
        if content is None:
            return headers
        self.hold(f"{name}: answer", content["schema"], answer)
        example = content.get("example", {})
        differences = self.differences(content["schema"], example)
        if set(example) != set(answer):
            differences.append(f"it has {sorted(example)}, the answer {sorted(answer)}")
        self.answers += 1
        if differences and self.update:
            (self.folder / f"{name}.answer.json").write_text(json.dumps(shortened(answer), indent=2) + "\n")
            return headers
        for difference in differences:
            self.fault(f"{name}: example of its answer: {difference}")
        return headers


def history_of(given, folder):
    """Makes a store with missions of a robot that has an unmodelled rolling resistance of the load."""
    robot = given.source / "deploy/robots/amr.json"
    for command in (["simulate", "--robots", "1", "--robot", robot, "--seed", "7", "--missions", "6", "--mission-duration", "40",
                     "--speed", "0", "--effect", "load_rolling_resistance=0.02", "--log", f"{folder}/amr.lcmlog", "--quiet"],
                    ["replay", f"{folder}/amr.lcmlog", "--into", f"{folder}/history.db", "--robot", robot]):
        subprocess.run([given.client, *command], check=True, stdout=subprocess.DEVNULL)


def hold_event(examples, url, name, thing, kind, cause=lambda: None):
    """Validates the first event of that kind with the document; `cause` is called once the stream is open."""
    _, path, operation = examples.operations[name]
    schema = operation["responses"]["200"]["content"]["text/event-stream"]["schema"]["contentSchema"]["items"]
    with urllib.request.urlopen(url + path.replace("{id}", thing), timeout=EVENT_S) as stream:
        cause()
        event = {}
        with contextlib.suppress(TimeoutError):
            for line in stream:
                key, _, value = line.decode().rstrip("\n").partition(": ")
                if key:
                    event[key] = value
                elif event.get("event") == kind:
                    break
    if event.get("event") != kind:
        return examples.fault(f"{name}: no event '{kind}'")
    examples.hold(f"{name}: event {kind}", schema, {"event": kind, "data": json.loads(event["data"])})
    examples.events += 1


def ended(url, diagnosis):
    for _ in range(6000):  # 600 s for sanitized programs
        if ask(url, "GET", f"/v1/diagnoses/{diagnosis}")[1]["state"] not in ("queued", "running"):
            return
        time.sleep(0.1)
    raise SystemExit(f"diagnosis {diagnosis} did not end")


def listed(url, robot):
    for _ in range(300):
        if any(entry["robot_id"] == robot for entry in ask(url, "GET", "/v1/attention")[1]["attention"]):
            return
        time.sleep(0.1)
    raise SystemExit(f"{robot} is not listed")


def main():
    arguments = argparse.ArgumentParser()
    for name in ("source", "daemon", "client"):
        arguments.add_argument("--" + name, required=True, type=pathlib.Path)
    arguments.add_argument("--update", action="store_true", help="write the examples of answers")
    given = arguments.parse_args()
    document = json.loads((given.source / "schemas/openapi.json").read_text())
    examples = Examples(document, given.source / "schemas/examples", given.update)
    with tempfile.TemporaryDirectory() as folder:
        history_of(given, folder)
        with daemon(given.daemon, folder) as url:
            spare = json.loads((given.source / "deploy/robots/nomad.json").read_text())
            ask(url, "PUT", "/v1/robots/spare", {**spare, "robot_id": "spare"})
            others = [name for name in examples.operations if name not in {*FIRST, *LAST, *SIGNED_IN, *WITHOUT_EXAMPLE}]
            for name in FIRST + others + LAST:
                if name == "listAttention":
                    ended(url, 1)
                    listed(url, "amr")
                examples.ask(url, name)
            hold_event(examples, url, "streamDiagnosis", "1", "ended")
            hold_event(examples, url, "streamEvents", "", "state", lambda: ask(
                url, "POST", "/v1/robots/amr/missions", {"event": "finished", "mission_id": "order-4711"}))
        made = subprocess.run([given.client, "token", "create", "--file", f"{folder}/tokens.json", "--name", "example", "--role", "plan"],
                              check=True, capture_output=True, text=True).stdout
        token = re.search(r"\S{30,}", made).group()
        with daemon(given.daemon, folder, "--auth-token-file", f"{folder}/tokens.json") as url:
            headers = {}
            for name in SIGNED_IN:
                answered = examples.ask(url, name, {"token": token} if name == "createSession" else None, headers)
                if answered and answered.get("Set-Cookie"):
                    headers = {"Cookie": answered["Set-Cookie"].split(";")[0]}
    names = {f"{name}.{kind}.json" for name in examples.operations for kind in ("request", "answer")}
    for stray in sorted({file.name for file in examples.folder.iterdir()} - names):
        examples.fault(f"{stray} belongs to no operation")
    undescribed = list(without_description(document))
    for place in undescribed:
        examples.fault(f"{place} has no description")
    print(f"{examples.requests} example requests answered, {examples.answers} example answers and "
          f"{examples.events} events checked, {len(examples.faults)} faults")
    return 1 if examples.faults else 0


def without_description(document):
    """Properties of schemas that have no description, neither their own nor through a reference."""
    def described(schema):
        while isinstance(schema, dict):
            if schema.get("description") or schema.get("title"):
                return True
            if "$ref" not in schema:
                return False
            target = document
            for part in schema["$ref"].lstrip("#/").split("/"):
                target = target[int(part)] if isinstance(target, list) else target[part]
            schema = target
        return True

    def walk(node, at):
        if isinstance(node, dict):
            properties = node.get("properties")
            if isinstance(properties, dict):
                yield from (f"{at}/properties/{name}" for name, schema in properties.items() if not described(schema))
            for key, value in node.items():
                yield from walk(value, f"{at}/{key}") if key not in ("example", "enum") else ()
        elif isinstance(node, list):
            for k, value in enumerate(node):
                yield from walk(value, f"{at}/{k}")
    yield from walk(document["components"]["schemas"], "schemas")


if __name__ == "__main__":
    sys.exit(main())
