#!/usr/bin/env python3
"""The batteries of robots on a real broker (mosquitto), with a password and TLS: messages conform to the published schema of VDA
5050; the broker may start after the daemon and disappear for a time; the broker stores how the daemon ended."""
import json
import pathlib
import re
import shutil
import socket
import subprocess

import jsonschema

from harness import Programs, arguments, check, free_tcp_port, need_multicast, skip, wait_until

HEADER = ("headerId", "timestamp", "version", "manufacturer", "serialNumber")


class Broker:
    def __init__(self, folder):
        self.folder, self.port, self.process = pathlib.Path(folder), free_tcp_port(), None
        self.folder.chmod(0o755)
        subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=localhost", "-addext",
                        "subjectAltName=DNS:localhost", "-keyout", "key.pem", "-out", "certificate.pem", "-days", "2"], cwd=folder,
                       check=True, capture_output=True)
        (self.folder / "key.pem").chmod(0o644)
        subprocess.run(["mosquitto_passwd", "-b", "-c", "passwords", "fleet", "let me in"], cwd=folder, check=True)
        (self.folder / "passwords").chmod(0o644)
        (self.folder / "mosquitto.conf").write_text(
            f"listener {self.port} localhost\ncertfile {folder}/certificate.pem\nkeyfile {folder}/key.pem\n"
            f"password_file {folder}/passwords\nallow_anonymous false\n")

    def start(self):
        self.process = subprocess.Popen(["mosquitto", "-c", self.folder / "mosquitto.conf"], stderr=subprocess.DEVNULL)

    def stop(self):
        if self.process:
            self.process.terminate()
            self.process.wait()

    def kill(self):
        """Without a disconnect message, also in TLS."""
        self.process.kill()
        self.process.wait()

    def refuses(self, times):
        """Replaces the broker by a server that accepts connections and closes them during the handshake."""
        with socket.create_server(("localhost", self.port)) as server:
            server.settimeout(30)
            for _ in range(times):
                connection, _ = server.accept()
                connection.recv(100)
                connection.close()

    def heard(self, topic, count, seconds):
        """`count` messages of a topic, each (topic, document)."""
        done = subprocess.run(["mosquitto_sub", "-h", "localhost", "-p", str(self.port), "--cafile", self.folder / "certificate.pem",
                               "-u", "fleet", "-P", "let me in", "-t", topic, "-C", str(count), "-W", str(seconds), "-v"],
                              capture_output=True, text=True)
        check(done.returncode == 0, f"{topic}: not {count} messages in {seconds} s: {done.stdout}{done.stderr}")
        return [(line.split(" ", 1)[0], json.loads(line.split(" ", 1)[1])) for line in done.stdout.splitlines()]

    def state(self):
        """The state in the retained connection message."""
        return self.heard("joulecast/+/joulecast/warehouse-1/connection", 1, 10)[0][1]["connectionState"]


def schema_of_messages(shared):
    """The schema of the header and power supply in the standard's state."""
    path = pathlib.Path(shared, "data", "vda5050", "state.schema.json")
    if not path.exists():
        return None
    state = json.loads(path.read_text())
    return {**state, "required": [*HEADER, "powerSupply"],
            "properties": {name: state["properties"][name] for name in (*HEADER, "powerSupply")}, "additionalProperties": False}


def faults_are_told(options, secret):
    here = ["--mqtt-url", "mqtt://here"]
    for settings, field in ((["--mqtt-url", "http://here"], "mqtt.url:"), ([*here, "--mqtt-interface", "a/b"], "mqtt.interface:"),
                            ([*here, "--mqtt-user", "fleet", "--mqtt-password-file", secret], "mqtt.password_file: /"),
                            ([*here, "--mqtt-password-file", secret], "mqtt.password_file: requires mqtt.user")):
        done = subprocess.run([options.daemon, "--check-config", *settings], capture_output=True, text=True)
        check(done.returncode == 2 and field in done.stderr, f"{settings}: {done.returncode}, {done.stderr}")


def main():
    options = arguments()
    need_multicast()
    if not (shutil.which("mosquitto") or pathlib.Path("/usr/sbin/mosquitto").exists()) or not shutil.which("mosquitto_sub"):
        skip("mosquitto is not installed")
    programs = Programs(options)
    broker = Broker(programs.folder.name)
    secret = pathlib.Path(programs.path("password"))
    secret.write_text("let me in\n")
    secret.chmod(0o644)
    faults_are_told(options, str(secret))
    secret.chmod(0o600)
    programs.settings = ["--mqtt-url", f"mqtts://localhost:{broker.port}", "--mqtt-authorities", str(broker.folder / "certificate.pem"),
                         "--mqtt-user", "fleet", "--mqtt-password-file", str(secret), "--mqtt-client-id", "warehouse-1",
                         "--mqtt-manufacturer", "acme", "--mqtt-period-s", "0.5"]
    fleet = None
    try:
        programs.start()  # before the broker
        fleet = subprocess.Popen([options.client, "simulate", "--robots", "2", "--lcm-url", programs.lcm_url, "--server", programs.url,
                                  "--duration", "300", "--quiet"])
        wait_until(lambda: len([r for r in programs.get("/v1/robots")["robots"] if r["live"]]) == 2, 20, "both robots are live")
        robots = {r["robot_id"] for r in programs.get("/v1/robots")["robots"]}
        check(programs.metric("joulecast_mqtt_connected") == 0, "connected without a broker")
        broker.refuses(2)
        broker.start()
        wait_until(lambda: programs.metric("joulecast_mqtt_connected") == 1, 20, "the broker is connected after its start")

        messages = broker.heard("joulecast/v3/acme/+/powerSupply", 8, 20)
        schema = schema_of_messages(options.shared)
        last_ids = {}
        for topic, message in messages:
            robot = topic.split("/")[3]
            check(message["serialNumber"] == robot and robot in robots and message["manufacturer"] == "acme", f"{topic}: {message}")
            check(re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z", message["timestamp"]), message["timestamp"])
            check(robot not in last_ids or message["headerId"] == last_ids[robot] + 1, f"{topic}: headerId {message['headerId']} after {last_ids.get(robot)}")
            last_ids[robot] = message["headerId"]
            if schema:
                jsonschema.validate(message, schema)
        check(set(last_ids) == robots, f"{last_ids} of {robots}")
        live = programs.get(f"/v1/robots/{robot}/state")
        supply = message["powerSupply"]
        check(abs(supply["stateOfCharge"] - 100 * live["state_of_charge"]) < 1, f"{supply}, {live['state_of_charge']}")
        check(broker.state() == "ONLINE", "the daemon is there")

        for end in (broker.stop, broker.kill):
            end()
            wait_until(lambda: programs.metric("joulecast_mqtt_connected") == 0, 30, f"the loss of the broker is detected after its {end.__name__}")
            broker.start()
            wait_until(lambda: programs.metric("joulecast_mqtt_connected") == 1, 70, f"the broker is connected again after its {end.__name__}")
        broker.heard("joulecast/v3/acme/+/powerSupply", 4, 20)
        for turn in range(6):  # the disconnect races with its acknowledgement
            check(programs.stop() == 0, "the daemon did not stop in order")
            check(broker.state() == "OFFLINE", f"turn {turn}: the daemon disconnected properly")
            programs.start()
            wait_until(lambda: programs.metric("joulecast_mqtt_connected") == 1, 20, "the broker is connected")
        programs.stop()

        programs.settings += ["--mqtt-dialect", "vda5050-2.1"]
        programs.start()
        wait_until(lambda: programs.metric("joulecast_mqtt_connected") == 1, 20, "the broker is connected")
        _, message = broker.heard("joulecast/v2/acme/+/batteryState", 1, 20)[0]
        check(message["version"] == "2.1.0" and 0 <= message["batteryState"]["batteryCharge"] <= 100, message)
        programs.kill()
        wait_until(lambda: broker.heard("joulecast/v2/joulecast/warehouse-1/connection", 1, 10)[0][1]["connectionState"] == "CONNECTIONBROKEN",
                   60, "the broker reports the lost daemon")

        programs.settings = ["--mqtt-url", f"mqtts://localhost:{broker.port}"]  # with the authorities of the system
        programs.start()
        log = pathlib.Path(programs.path("daemon.log"))
        wait_until(lambda: re.search('"warning".*certificate verify failed', log.read_text()), 10, "the log has the cause of a TLS error")
        programs.stop()

        programs.settings = ["--mqtt-url", f"mqtt://localhost:{free_tcp_port()}"]
        programs.start()
        check(programs.stop() == 0, "without a broker the daemon did not stop in order")
    finally:
        if fleet:
            fleet.kill()
            fleet.wait()
        broker.stop()
    print(f"{len(messages)} messages of {len(last_ids)} robots")


main()
