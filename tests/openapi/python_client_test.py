#!/usr/bin/env python3
"""Tests deploy/connect/joulecast_client.py with a daemon; every request and answer is validated with its schema."""
import argparse
import json
import pathlib
import sys
import tempfile

from examples_test import daemon, history_of

arguments = argparse.ArgumentParser()
for option in ("source", "daemon", "client"):
    arguments.add_argument("--" + option, required=True, type=pathlib.Path)
given = arguments.parse_args()
sys.path.insert(0, str(given.source / "deploy/connect"))
from joulecast_client import Client, Problem  # noqa: E402


def raised(kind, call):
    try:
        call()
    except kind as error:
        return error
    raise SystemExit(f"{kind.__name__} was not raised")


with tempfile.TemporaryDirectory() as folder:
    history_of(given, folder)
    with daemon(given.daemon, folder) as url:
        client = Client(url, validate=True)
        robot = json.loads((given.source / "deploy/robots/amr.json").read_text())
        # Stored values, and values sent back to the service, keep every digit for any rounding of answers.
        exact = {**robot, "idle_power_w": 22.123456789012345}
        client.putRobot(id="amr", body=exact)
        assert client.getRobot(id="amr")["model"]["idle_power_w"] == exact["idle_power_w"]
        assert client.listModels(id="amr")["models"][0]["model"]["idle_power_w"] == exact["idle_power_w"]
        rounded, whole = (client.getMission(id=1, digits=digits)["energy"]["modelled_j"] for digits in (4, 17))
        assert rounded == float(f"{whole:.4g}") != whole, (rounded, whole)
        again = Client(url).getMission(id=1, digits=17)["energy"]["modelled_j"]
        assert again == whole
        voltages = client.getMissionTelemetry(id=1, limit=500)["motor_voltage_v"][0]
        assert any(len(repr(value)) > 14 for value in voltages), "raw telemetry was rounded"
        client.putRobot(id="amr", body=robot)
        profile = client.computeProfile(id="amr", body={"path": [{"kind": "straight", "length_m": 10}]}, digits=17)
        assert profile["energy_j"] > 0
        rounded = client.computeProfile(id="amr", body={"path": [{"kind": "straight", "length_m": 10}]})
        assert abs(rounded["energy_j"] - profile["energy_j"]) < 1e-9 * profile["energy_j"] and len(str(rounded["energy_j"])) <= 11
        matrix = client.computeEnergyMatrix(body={"robots": [{"robot_id": "amr", "pose": {"x_m": 0, "y_m": 0}}],
                                                  "tasks": [{"task_id": "a", "pickup": {"x_m": 3, "y_m": 1}, "dropoff": {"x_m": 0, "y_m": 4}}]})
        assert matrix["rows"][0]["energy_j"][0] > 0
        ids = [mission["id"] for mission in client.pages("listMissions", robot_id="amr", limit=2)]
        assert len(ids) == len(set(ids)) >= 5, ids
        assert list(client.pages("listMissions", from_="2100-01-01")) == []
        ledger = client.getMissionLedger(id=ids[0])["ledger"]
        terms = ledger["terms_j"]
        total = sum(terms.values()) - 2 * terms["recovered"]
        assert abs(total - ledger["sum_j"]) < 1e-8 * abs(ledger["sum_j"]), (total, ledger)
        refused = raised(Problem, lambda: client.getMissionLedger(id=10**6))
        assert refused.status == 404 and refused.field == "id", refused
        assert "spede" in str(raised(TypeError, lambda: client.listMissions(spede=1)))
        assert "body" in str(raised(TypeError, lambda: client.computeProfile(id="amr")))
        raised(Exception, lambda: client.computeProfile(id="amr", body={"paht": []}))
        assert "computeProfile" in dir(client) and "energy" in client.computeProfile.__doc__
print(f"{len(client.operations)} operations as methods, {len(ids)} missions in pages")
