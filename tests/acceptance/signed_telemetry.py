#!/usr/bin/env python3
"""Robots with signed telemetry: messages of the publisher in Python and of virtual robots are accepted; messages that are
unsigned, signed with another key, replayed, or moved to another channel are rejected, counted by reason and not stored."""
import json
import os
import re
import socket
import struct
import subprocess
import sys
import threading
import time
import urllib.request

from harness import GROUP, Listener, Programs, arguments, check, need_multicast, skip


def sent_again(programs, messages):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        for k, (channel, payload) in enumerate(messages):
            sender.sendto(b"LC02" + struct.pack(">I", k) + channel.encode() + b"\0" + payload, (GROUP, programs.lcm_port))
            time.sleep(0.001)


class Counts:
    def __init__(self, programs):
        with urllib.request.urlopen(programs.url + "/metrics", timeout=30) as reply:
            text = reply.read().decode()
        self.samples = int(float(re.search(r"^joulecast_ingest_samples_total (\S+)", text, re.M)[1]))
        self.faults = {m[1]: int(float(m[2])) for m in
                       re.finditer(r'^joulecast_ingest_faults_total\{reason="(\w+)"\} (\S+)', text, re.M)}


def main():
    options = arguments()
    need_multicast()
    programs = Programs(options)
    generated = programs.path("generated")
    types = [os.path.join(options.source, "lcmtypes", name) for name in os.listdir(os.path.join(options.source, "lcmtypes"))
             if name.endswith(".lcm")]
    if subprocess.run(["lcm-gen", "-p", "--ppath", generated, *types], capture_output=True).returncode != 0:
        skip("lcm-gen does not run")
    keys = programs.path("keys.json")
    key = programs.run("key", "create", "--file", keys, "--robot-id", "amr-07").strip()
    other = programs.run("key", "create", "--file", keys, "--robot-id", "amr-01").strip()
    check(key != other and len(key) == 64, "distinct keys of 32 bytes")
    programs.settings = ["--ingest-key-file", keys, "--ingest-require-signed", "true"]
    programs.start()
    with open(os.path.join(options.source, "deploy", "robots", "amr.json")) as file:
        robot = json.load(file)
    programs.put("/v1/robots/amr-07", {**robot, "robot_id": "amr-07"})

    def publisher(signing_key):
        environment = {**os.environ, "PYTHONPATH": generated, "LCM_DEFAULT_URL": programs.lcm_url, "ROBOT_KEY": signing_key}
        script = os.path.join(options.source, "deploy", "connect", "publisher.py")
        subprocess.run([sys.executable, "-B", script, "amr-07", "3"], env=environment, check=True, capture_output=True)

    listener = Listener(programs.lcm_port)
    heard = []
    hearing = threading.Thread(target=lambda: heard.extend((channel, payload) for _, channel, payload in listener.messages(6)))
    hearing.start()
    publisher(key)
    mission = programs.wait_for("amr-07", 1)[0]
    hearing.join()
    recorded = [message for message in heard if message[0].endswith(".amr-07") and not message[0].startswith("ENERGY")]
    check(mission["state"] == "finished" and mission["energy"]["battery_j"] > 10, f"{mission}")
    before = Counts(programs)
    check(before.samples >= 140 and len(recorded) >= 150, f"{before.samples} samples of {len(recorded)} messages")
    check(all(before.faults[name] == 0 for name in ("unsigned", "bad_signature", "replayed")), f"{before.faults}")

    sent_again(programs, recorded)
    moved = [(channel.replace("amr-07", "amr-01"), payload) for channel, payload in recorded]
    sent_again(programs, moved)
    publisher("")
    publisher(other)
    time.sleep(2)
    after = Counts(programs)
    check(after.samples == before.samples, f"{after.samples - before.samples} unsigned samples are stored")
    check(len(programs.missions("amr-07")) == 1 and not programs.missions("amr-01"), "a forged mission is stored")
    check(after.faults["replayed"] == len(recorded), f"{after.faults} of {len(recorded)} sent again")
    check(after.faults["unsigned"] >= 150, f"{after.faults}")
    check(after.faults["bad_signature"] >= len(moved) + 150, f"{after.faults}")

    programs.run("simulate", "--robots", "1", "--duration", "4", "--server", programs.url, "--lcm-url", programs.lcm_url,
                 "--key-file", keys, "--quiet")
    time.sleep(1)
    check(Counts(programs).samples >= after.samples + 180, "signed telemetry of a virtual robot is rejected")
    programs.run("key", "revoke", "--file", keys, "--robot-id", "amr-07")
    time.sleep(1.5)
    publisher(key)
    check(len(programs.missions("amr-07")) == 1, "a revoked key is accepted")
    check(programs.stop() == 0, "the daemon did not stop in order")
    print(f"{before.samples} signed samples accepted, {len(recorded)} replays and {len(moved)} moved messages rejected")


if __name__ == "__main__":
    main()
