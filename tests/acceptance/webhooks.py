#!/usr/bin/env python3
"""joulecastd sends events to webhooks: signed, in order, repeated after failures, over HTTPS, without delaying metering.

webhooks.py --daemon PROGRAM --client PROGRAM --source DIR. The receiver is that of operations.md, with simulated failures.
"""
import argparse
import hashlib
import hmac
import http.server
import json
import os
import pathlib
import ssl
import subprocess
import tempfile
import threading
import time
import urllib.request

SECRET = b"a secret of sixteen bytes or more"
ENDLESS_BYTES, BUFFERED_BYTES = 250 << 20, 16 << 20  # the second: in sockets


class Receiver:
    """Stores received events. The first `fail` attempts are answered with 503, `silent` ones not at all, `endless` ones with a body
    that continues while it is received."""

    def __init__(self, fail=0, silent=False, endless=False, tls=None):
        self.got, self.attempts, self.fail, self.silent, self.most_sent = [], 0, fail, silent, 0
        outer = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(self):
                body = self.rfile.read(int(self.headers["Content-Length"]))
                outer.attempts += 1
                if outer.silent:
                    time.sleep(30)
                    return
                stated = dict(part.split("=") for part in self.headers["Joulecast-Signature"].split(","))
                wanted = hmac.new(SECRET, stated["t"].encode() + b"." + body, hashlib.sha256).hexdigest()
                fresh = abs(time.time() - int(stated["t"])) < 300
                sound = hmac.compare_digest(wanted, stated["v1"]) and fresh
                refused = outer.fail > 0
                outer.fail -= refused
                if sound and not refused:
                    outer.got.append((self.headers["Joulecast-Event"], self.headers["Joulecast-Delivery"], json.loads(body), self.path))
                self.send_response(503 if refused else 200 if endless else 204 if sound else 401)
                if endless:
                    self.send_header("Content-Length", str(ENDLESS_BYTES))
                self.end_headers()
                try:
                    for sent in range(0, ENDLESS_BYTES if endless else 0, 1 << 16):
                        outer.most_sent = max(outer.most_sent, sent)
                        self.wfile.write(bytes(1 << 16))
                except OSError:
                    self.close_connection = True

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.server.daemon_threads = True
        if tls:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(*tls)
            self.server.socket = context.wrap_socket(self.server.socket, server_side=True)
        self.url = f"http{'s' if tls else ''}://127.0.0.1:{self.server.server_port}/hooks/T0/XXXXSECRET?token=XXXXSECRET"
        self.host = f"127.0.0.1:{self.server.server_port}"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()


def until(what, holds, seconds=30):
    end = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > end:
            raise SystemExit(f"not within {seconds} s: {what}")
        time.sleep(0.05)


def metric(url, name, receiver):
    with urllib.request.urlopen(url + "/metrics", timeout=10) as reply:
        for line in reply.read().decode().splitlines():
            if line.startswith(name + "{") and f'host="{receiver.host}"' in line:
                return float(line.rsplit(" ", 1)[1])
    raise SystemExit(f"no metric {name} of {receiver.host}")


def put(url, robot):
    request = urllib.request.Request(f"{url}/v1/robots/{robot['robot_id']}", json.dumps(robot).encode(),
                                     {"Content-Type": "application/json"}, method="PUT")
    urllib.request.urlopen(request, timeout=10).close()


def remove(url, robot_id):
    urllib.request.urlopen(urllib.request.Request(f"{url}/v1/robots/{robot_id}", method="DELETE"), timeout=10).close()


def refused(given, folder, change, *words):
    """--check-config reports the fault."""
    file = folder / "faulty.json"
    file.write_text(json.dumps({"webhooks": [{"url": "http://127.0.0.1:1/", "secret_file": "secret", **change}]}))
    done = subprocess.run([given.daemon, "--check-config", "--webhooks-file", file], capture_output=True, text=True)
    assert done.returncode == 2 and all(word in done.stderr for word in words), done
    assert "XXXXSECRET" not in done.stdout + done.stderr, done


def main():
    arguments = argparse.ArgumentParser()
    for name in ("daemon", "client", "source", "shared"):
        arguments.add_argument("--" + name, type=pathlib.Path, required=name != "shared")
    given = arguments.parse_args()
    robot = json.loads((given.source / "deploy/robots/amr.json").read_text())
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", folder / "key.pem", "-out", folder / "cert.pem",
                        "-days", "2", "-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1"], check=True, capture_output=True)
        good, failing, silent, endless = Receiver(), Receiver(fail=2), Receiver(silent=True), Receiver(endless=True)
        secure = Receiver(tls=(folder / "cert.pem", folder / "key.pem"))
        (folder / "secret").write_bytes(SECRET + b"\n")
        (folder / "secret").chmod(0o640)
        (folder / "short").write_bytes(b"short")
        (folder / "short").chmod(0o640)
        everything = ["robot_removed", "model_activated"]
        (folder / "webhooks.json").write_text(json.dumps({"webhooks": [
            {"url": good.url, "secret_file": "secret"},
            {"url": failing.url, "secret_file": "secret", "events": everything},
            {"url": silent.url, "secret_file": str(folder / "secret")},
            {"url": secure.url, "secret_file": "secret", "events": ["robot_removed"]},
            {"url": endless.url, "secret_file": "secret", "events": ["robot_removed"]}]}))
        refused(given, folder, {"events": ["robot_remove"]}, "/webhooks/0/events", "robot_removed")
        for wrong in ("ftp://x/XXXXSECRET", "http://user:XXXXSECRET@x/", "http://x:XXXXSECRET/", "http://x?XXXXSECRET"):
            refused(given, folder, {"url": wrong}, "/webhooks/0/url")
        refused(given, folder, {"secret_file": "short"}, "/webhooks/0/secret_file", "16 bytes")
        refused(given, folder, {"secret_file": "none"}, "/webhooks/0/secret_file")
        (folder / "short").chmod(0o644)
        refused(given, folder, {"secret_file": "short"}, "chmod o-r")
        process = subprocess.Popen(
            [given.daemon, "--http-port", "0", "--store-path", folder / "history.db", "--log-format", "json", "--lcm-url", "memq://",
             "--webhooks-file", folder / "webhooks.json", "--webhooks-queue", "5"],
            stderr=subprocess.PIPE, text=True, env={**os.environ, "SSL_CERT_FILE": str(folder / "cert.pem")})
        url = next(event["http"] for event in map(json.loads, process.stderr) if event["message"] == "ready")
        names = [f"amr-{k}" for k in range(12)]
        began = time.monotonic()
        for robot_id in names:
            put(url, {**robot, "robot_id": robot_id})
            remove(url, robot_id)
        assert time.monotonic() - began < 10, "a receiver that does not answer delays the service"
        for receiver in (good, failing):
            until(f"{receiver.host} receives events of all robots", lambda receiver=receiver: len(receiver.got) >= len(names) - 6 and receiver.got[-1][2]["robot_id"] == names[-1])
        until("HTTPS", lambda: secure.got and secure.got[-1][2]["robot_id"] == names[-1])
        until("all events are delivered whose answers are endless", lambda: endless.got and endless.got[-1][2]["robot_id"] == names[-1]
              and metric(url, "joulecast_webhook_delivered_total", endless) == len(endless.got))
        assert endless.most_sent < BUFFERED_BYTES, f"{endless.most_sent} bytes of an answer were received"
        heard = [body["robot_id"] for event, _, body, _ in good.got if event == "robot_removed"]
        assert heard == sorted(heard, key=names.index) and good.got[0][3] == "/hooks/T0/XXXXSECRET?token=XXXXSECRET", good.got
        event, delivery, body, _ = good.got[0]
        assert body["event"] == event and body["id"] == delivery and set(body) == {"id", "event", "time", "utime_us", "robot_id", "data"}, body
        assert len({delivery for _, delivery, _, _ in good.got}) == len(good.got)
        assert failing.attempts == len(failing.got) + 2 and metric(url, "joulecast_webhook_failed_total", failing) == 2
        # Five wait and one is in progress; the others were dropped and counted.
        assert metric(url, "joulecast_webhook_dropped_total", silent) == len(names) - 6, metric(url, "joulecast_webhook_dropped_total", silent)
        assert metric(url, "joulecast_webhook_waiting", silent) == 6
        assert metric(url, "joulecast_webhook_delivered_total", good) == len(good.got)
        with urllib.request.urlopen(url + "/metrics", timeout=10) as reply:
            assert b"XXXXSECRET" not in reply.read()
        process.terminate()
        log = process.stderr.read()
        assert process.wait(timeout=15) == 0
        assert failing.host in log and "XXXXSECRET" not in log, log
    print(f"{len(good.got)} events sent, {failing.attempts - len(failing.got)} attempts repeated, {len(names) - 6} dropped for a silent receiver")


main()
