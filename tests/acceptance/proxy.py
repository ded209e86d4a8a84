#!/usr/bin/env python3
"""The recipes of deploy/proxy: nginx and Caddy provide TLS for a daemon, which identifies the clients behind them."""
import contextlib
import http.client
import json
import os
import pathlib
import shutil
import socket
import ssl
import subprocess
import tempfile
import time

from harness import arguments, check, free_tcp_port, skip

NAME = "joulecast.example"


class ByAddress(http.client.HTTPSConnection):
    """A connection to a local port under the service's name, from the client's own address."""

    def __init__(self, port, trust):
        super().__init__(NAME, port, timeout=20, context=trust)
        self.source_address = ("127.0.0.3", 0)

    def connect(self):
        plain = socket.create_connection(("127.0.0.1", self.port), self.timeout, self.source_address)
        self.sock = self._context.wrap_socket(plain, server_hostname=NAME)


@contextlib.contextmanager
def asked(port, trust, path, method="GET", body=None, token=None, more=None):
    headers = dict(more or {})
    if token:
        headers["Authorization"] = "Bearer " + token
    if body is not None:
        headers["Content-Type"] = "application/json"
    with contextlib.closing(ByAddress(port, trust)) as connection:
        connection.request(method, path, body, headers)
        with contextlib.closing(connection.getresponse()) as reply:
            yield reply


@contextlib.contextmanager
def running(command, port, **more):
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, **more)
    try:
        end = time.monotonic() + 20
        while True:
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
                break
            check(process.poll() is None and time.monotonic() < end, f"{command[0]} does not listen on {port}")
            time.sleep(0.1)
        yield process
    finally:
        process.terminate()
        process.communicate(timeout=20)


def nginx(source, folder, port, daemon_port):
    """The recipe with replaced ports and files, inside a minimal nginx configuration."""
    recipe = (source / "deploy/proxy/nginx.conf").read_text()
    for written, here in ((":8080", f":{daemon_port}"), ("listen 443", f"listen 127.0.0.1:{port}"),
                          ("/etc/ssl/certs/joulecast.pem", f"{folder}/tls.crt"),
                          ("/etc/ssl/private/joulecast.key", f"{folder}/tls.key")):
        check(written in recipe, f"nginx.conf has no {written}")
        recipe = recipe.replace(written, here)
    temporary = "".join(f"{what}_temp_path {folder}/{what};\n" for what in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi"))
    (folder / "nginx.conf").write_text(
        f"pid {folder}/nginx.pid;\nerror_log {folder}/nginx.log;\ndaemon off;\nevents {{}}\n"
        f"http {{\naccess_log off;\n{temporary}{recipe}\n}}\n")
    return ["nginx", "-c", folder / "nginx.conf", "-e", folder / "nginx.log"]


def caddy(source, folder, port, daemon_port):
    recipe = (source / "deploy/proxy/Caddyfile").read_text()
    for written, here in ((":8080", f":{daemon_port}"), (f"{NAME} {{", f"https://{NAME}:{port} {{\n\tbind 127.0.0.1"),
                          ("/etc/ssl/certs/joulecast.pem", f"{folder}/tls.crt"),
                          ("/etc/ssl/private/joulecast.key", f"{folder}/tls.key")):
        check(written in recipe, f"Caddyfile has no {written}")
        recipe = recipe.replace(written, here)
    (folder / "Caddyfile").write_text("{\n\tadmin off\n\tauto_https disable_redirects\n\tgrace_period 1s\n}\n" + recipe)
    return ["caddy", "run", "--config", folder / "Caddyfile", "--adapter", "caddyfile"]


def through(proxy, options, folder, port, daemon_port, token):
    trust = ssl.create_default_context(cafile=folder / "tls.crt")
    command = proxy(pathlib.Path(options.source), folder, port, daemon_port)
    with running(command, port, env={**os.environ, "HOME": str(folder)}):
        name = proxy.__name__
        with asked(port, trust, "/v1/robots") as reply:
            check(reply.status == 401, f"{name}: without a token {reply.status}")
        with asked(port, trust, "/") as reply:
            check(reply.status == 200 and b"<html" in reply.read(), f"{name}: the page {reply.status}")
            check("max-age" in (reply.getheader("Strict-Transport-Security") or ""), f"{name}: no Strict-Transport-Security")
        with asked(port, trust, "/v1/session", "POST", json.dumps({"token": token})) as reply:
            cookie = reply.getheader("Set-Cookie") or ""
            check(reply.status == 200 and "; Secure" in cookie, f"{name}: signing in {reply.status} {cookie}")
        robot = (pathlib.Path(options.source) / "deploy/robots/amr.json").read_bytes()
        forged = {"X-Forwarded-For": "198.51.100.66", "Origin": f"https://{NAME}:{port}"}
        with asked(port, trust, "/v1/robots/amr", "PUT", robot, token, forged) as reply:
            check(reply.status in (200, 201), f"{name}: PUT {reply.status} {reply.read()[:300]}")
        # A quiet fleet sends a comment every 15 s, which a buffering proxy would delay.
        with asked(port, trust, "/v1/events", token=token) as reply:
            check(reply.status == 200 and reply.readline(), f"{name}: events are held back")


def main():
    options = arguments()
    proxies = [each for each in (nginx, caddy) if shutil.which(each.__name__)]
    if not proxies or shutil.which("openssl") is None:
        skip("nginx and caddy, or openssl, are not installed")
    for proxy in proxies:
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            folder.chmod(0o755)
            subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
                            "-days", "2", "-subj", f"/CN={NAME}", "-addext", f"subjectAltName=DNS:{NAME}",
                            "-keyout", folder / "tls.key", "-out", folder / "tls.crt"], check=True, capture_output=True)
            token = subprocess.run([options.client, "token", "create", "--file", folder / "tokens.json", "--name", "t",
                                    "--role", "admin"], check=True, capture_output=True, text=True).stdout.strip()
            daemon_port = free_tcp_port()
            daemon = [options.daemon, "--http-port", str(daemon_port), "--store-path", folder / "history.db", "--lcm-url",
                      "memq://", "--auth-token-file", folder / "tokens.json", "--http-trusted-proxies", "127.0.0.1",
                      "--http-allowed-hosts", NAME]
            with running(daemon, daemon_port) as process:
                through(proxy, options, folder, free_tcp_port(), daemon_port, token)
                check(process.poll() is None, "the daemon ended")
            listed = subprocess.run([options.client, "audit", "list", "--store", folder / "history.db"], check=True,
                                    capture_output=True, text=True).stdout
            addresses = {each["address"] for each in map(json.loads, listed.splitlines()) if each["action"] == "putRobot"}
            check(addresses == {"127.0.0.3"}, f"{proxy.__name__}: the audit has {addresses}")
    print("recipes in front of a daemon:", ", ".join(proxy.__name__ for proxy in proxies))


if __name__ == "__main__":
    main()
