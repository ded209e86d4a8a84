#!/usr/bin/env python3
"""A robot that announces no missions: a scheduler begins and ends them over HTTP, at one daemon, which is killed in between, and
at any daemon of a cluster, whichever keeps the robot. Contradictions are refused; a request is answered once under its key."""
import json
import pathlib
import socket
import struct
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request

from cluster_parts import NODES, Cluster, Server
from harness import GROUP, Listener, Programs, arguments, check, free_port, need_multicast, start_postgresql, wait_until


class QuietRobot:
    """A virtual robot without mission events: what it publishes on one LCM port is repeated on another without them."""

    def __init__(self, programs, lcm_port):
        self.port, self.to = free_port(), lcm_port
        self.robot_file = programs.path("amr-robot.json")
        pathlib.Path(self.robot_file).write_text(pathlib.Path(programs.options.source, "deploy/robots/amr.json").read_text())
        self.listener = Listener(self.port)
        self.announces = False
        threading.Thread(target=self.relay, daemon=True).start()
        self.process = subprocess.Popen(
            [programs.options.client, "simulate", "--robots", "1", "--robot", self.robot_file, "--rate", "20", "--quiet", "--mission-duration",
             "3600", "--lcm-url", f"udpm://{GROUP}:{self.port}?ttl=0"])

    def relay(self):
        sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, struct.pack("b", 0))
        for _, channel, payload in self.listener.messages(3600):
            if not channel.startswith("MISSION_EVENT"):
                sender.sendto(b"LC02\0\0\0\0" + channel.encode() + b"\0" + payload, (GROUP, self.to))

    def end(self):
        self.process.kill()
        self.process.wait()


def post(daemon, event, mission_id, key=None, **members):
    """(status, answer) of a request."""
    headers = {"Content-Type": "application/json"} | ({"Idempotency-Key": key} if key else {})
    request = urllib.request.Request(daemon.url + "/v1/robots/amr/missions", headers=headers,
                                     data=json.dumps({"event": event, "mission_id": mission_id, **members}).encode())
    try:
        with urllib.request.urlopen(request, timeout=30) as reply:
            return reply.status, json.load(reply)
    except urllib.error.HTTPError as error:
        return error.code, json.load(error)


def accept(daemon, event, mission_id, **members):
    status, answer = post(daemon, event, mission_id, **members)
    check(status == 202 and answer["mission_id"] == mission_id and answer["event"] == event, f"{event} {mission_id}: {status}, {answer}")
    return answer


def refuse(daemon, event, mission_id, words, status=409, **members):
    got, answer = post(daemon, event, mission_id, **members)
    check(got == status and all(word in json.dumps(answer) for word in words), f"{event} {mission_id}: {got}, {answer}")


def missions(daemon):
    return {m["mission_id"]: m for m in daemon.missions("amr")}


def wait_for_state(daemon, mission_id, state):
    wait_until(lambda: missions(daemon).get(mission_id, {}).get("state") == state, 20, f"{mission_id} is {state}")
    return missions(daemon)[mission_id]


def is_received(daemon):
    return next((r for r in daemon.get("/v1/robots")["robots"] if r["robot_id"] == "amr"), {}).get("samples", 0) > 0


def at_one_daemon(options):
    programs = Programs(options)
    programs.start()
    programs.put("/v1/robots/amr", json.loads(pathlib.Path(options.source, "deploy/robots/amr.json").read_text()))
    robot = QuietRobot(programs, programs.lcm_port)
    try:
        wait_until(lambda: is_received(programs), 30, "telemetry")
        refuse(programs, "finished", "order-1", ["no mission of the robot is open"])
        refuse(programs, "started", "order 1", ["mission_id"], 422)
        refuse(programs, "finished", "order-1", ["payload_kg"], 422, payload_kg=3)
        refuse(programs, "begun", "order-1", ["started"], 422)
        begun = accept(programs, "started", "order-1", payload_kg=40, note="dock 3", key="one")
        status, again = post(programs, "started", "order-1", payload_kg=40, note="dock 3", key="one")
        check((status, again) == (202, begun), f"repeated: {status}, {again}")
        refuse(programs, "started", "order-2", ["mission order-1 is open"])
        refuse(programs, "aborted", "order-2", ["mission order-1 is open"])
        check(wait_for_state(programs, "order-1", "open")["payload_kg"] == 40, "the payload")
        time.sleep(2)
        ended = accept(programs, "finished", "order-1")
        mission = wait_for_state(programs, "order-1", "finished")
        check(mission["start_utime_us"] == begun["utime_us"] and not mission["implicit"], f"{mission}")
        check(0 <= mission["end_utime_us"] - ended["utime_us"] < 500_000, f"{mission} ended at {ended}")
        check(mission["samples"] >= 30 and mission["energy"]["measured_j"] > 0, f"{mission}")
        # Killed at the moment of the answer.
        accept(programs, "started", "order-2")
        programs.kill()
        programs.start()
        wait_until(lambda: missions(programs).get("order-2", {}).get("samples", 0) > 0, 20, "order-2 is accounted for")
        accept(programs, "aborted", "order-2")
        programs.kill()
        programs.start()
        wait_for_state(programs, "order-2", "aborted")
        # Both requests before anything of the mission is stored.
        accept(programs, "started", "order-3")
        accept(programs, "finished", "order-3")
        programs.kill()
        programs.start()
        accept(programs, "started", "order-4")
        wait_until(lambda: missions(programs).get("order-4", {}).get("samples", 0) > 0, 20, "order-4 is accounted for")
        check(missions(programs).get("order-3", {"state": "finished"})["state"] == "finished", f"{missions(programs)}")
        accept(programs, "finished", "order-4")
        wait_for_state(programs, "order-4", "finished")
        check(programs.get("/v1/robots/amr/state")["faults"].get("bad_event", 0) == 0, "bad events")
        check(programs.stop() == 0, "stop")
    finally:
        robot.end()


def in_a_cluster(options):
    server = Server(options.source)
    start_postgresql(server)
    server.standby = None  # none is made
    cluster, robot = Cluster(options, server), None
    try:
        for node in cluster.nodes.values():
            node.start()
        alpha = cluster.nodes["alpha"]
        alpha.put("/v1/robots/amr", json.loads(pathlib.Path(options.source, "deploy/robots/amr.json").read_text()))
        robot = QuietRobot(alpha, int(cluster.lcm_url.split(":")[2].split("?")[0]))
        wait_until(lambda: "amr" in cluster.keepers() and all(is_received(node) for node in cluster.nodes.values()), 40, "a keeper")
        for k, name in enumerate(NODES):
            node, other = cluster.nodes[name], cluster.nodes[NODES[k - 1]]
            begun = accept(node, "started", f"at-{name}", payload_kg=k)
            refuse(other, "started", "another", [f"mission at-{name} is open"])
            wait_for_state(node, f"at-{name}", "open")
            accept(other, "finished", f"at-{name}")
            mission = wait_for_state(node, f"at-{name}", "finished")
            check(mission["start_utime_us"] == begun["utime_us"] and mission["payload_kg"] == k, f"{mission} begun by {begun}")
        # The keeper is killed at the moment of the answer.
        keeper = cluster.keepers()["amr"]
        left = [node for node in cluster.nodes.values() if node.name != keeper]
        accept(left[0], "started", "survives")
        cluster.nodes[keeper].kill()
        wait_until(lambda: cluster.keepers().get("amr", keeper) != keeper, 20, "another keeper")
        wait_for_state(left[0], "survives", "open")
        accept(left[1], "finished", "survives")
        mission = wait_for_state(left[0], "survives", "finished")
        check(mission["samples"] > 0 and mission["gap_count"] == 0, f"{mission}")
        states = [node.get("/v1/robots/amr/state") for node in left]
        check(all(state["faults"].get("bad_event", 0) == 0 for state in states), f"{states}")
        for node in left:
            check(node.stop() == 0, f"{node.name} did not stop in order")
    finally:
        if robot:
            robot.end()
        for node in cluster.nodes.values():
            node.end()
        server.end()


def main():
    options = arguments()
    need_multicast()
    at_one_daemon(options)
    in_a_cluster(options)


sys.exit(main())
