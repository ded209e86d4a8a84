#!/usr/bin/env python3
"""HTTPS with a self-signed certificate: accepted and rejected protocols, a new certificate at SIGHUP, a secure cookie."""
import json
import os
import pathlib
import shutil
import signal
import socket
import ssl
import subprocess
import tempfile
import time
import urllib.error
import urllib.request

from harness import arguments, check, skip


def certificate(folder, name):
    """A self-signed certificate for 127.0.0.1, in tls.crt and tls.key."""
    subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
                    "-days", "2", "-subj", f"/CN={name}", "-addext", "subjectAltName=IP:127.0.0.1",
                    "-keyout", folder / "tls.key", "-out", folder / "tls.crt"], check=True, capture_output=True)


def client_certificate(folder):
    """An authority in ca.crt, and a client's certificate signed by it in client.crt and client.key."""
    def openssl(*words):
        subprocess.run(["openssl", *words], check=True, capture_output=True, cwd=folder)
    kind = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    openssl("req", "-x509", *kind, "-days", "2", "-subj", "/CN=site", "-keyout", "ca.key", "-out", "ca.crt")
    openssl("req", *kind, "-subj", "/CN=dispatcher", "-keyout", "client.key", "-out", "client.csr")
    openssl("x509", "-req", "-in", "client.csr", "-CA", "ca.crt", "-CAkey", "ca.key", "-CAcreateserial", "-days", "2",
            "-out", "client.crt")


def ask_only_certified(options, folder, token):
    """With http.tls_client_authorities only clients with one of their certificates are answered."""
    client_certificate(folder)
    service = Service(options, folder, "--http-tls-client-authorities", folder / "ca.crt")
    other = folder / "other"
    other.mkdir()
    certificate(other, "stranger")

    def status(certified_by=None):
        trust = service.trust()
        if certified_by:
            trust.load_cert_chain(*certified_by)
        try:
            with urllib.request.urlopen(service.url + "/healthz", timeout=20, context=trust) as reply:
                return reply.status
        except (urllib.error.URLError, ssl.SSLError, ConnectionError):
            return None
    mine = (folder / "client.crt", folder / "client.key")
    check(status(mine) == 200, "a certified client is rejected")
    check(status() is None, "a client without a certificate is answered")
    check(status((other / "tls.crt", other / "tls.key")) is None, "a certificate of no authority is accepted")
    command = [options.client, "missions", "--server", service.url]
    env = {**os.environ, "SSL_CERT_FILE": folder / "tls.crt", "JOULECAST_TOKEN": token}
    certified = subprocess.run(command, env={**env, "JOULECAST_CLIENT_CERTIFICATE": mine[0], "JOULECAST_CLIENT_KEY": mine[1]},
                           capture_output=True, text=True, timeout=30)
    check(certified.returncode == 0, f"the command line with a certificate: {certified.stderr}")
    unknown = subprocess.run(command, env=env, capture_output=True, text=True, timeout=30)
    check(unknown.returncode != 0, "the command line without a certificate is answered")
    service.process.terminate()
    check(service.process.wait(timeout=20) == 0, "the daemon did not stop in order")


def until(what, ask, seconds=30):
    end = time.monotonic() + seconds
    while not (found := ask()):
        check(time.monotonic() < end, f"waited {seconds} s for {what}")
        time.sleep(0.05)
    return found


class Service:
    def __init__(self, options, folder, *more):
        self.folder = folder
        self.log = open(folder / "log.txt", "w+")
        self.process = subprocess.Popen(
            [options.daemon, "--http-port", "0", "--store-path", folder / "history.db", "--lcm-url", "memq://", "--log-format",
             "json", "--http-tls-certificate", folder / "tls.crt", "--http-tls-key", folder / "tls.key", "--auth-token-file",
             folder / "tokens.json", *more], stderr=self.log)
        ready = until("the daemon", lambda: next((e for e in self.events() if e["message"] == "ready"), None))
        self.url = ready["http"]
        self.port = int(self.url.rsplit(":", 1)[1])

    def events(self):
        check(self.process.poll() is None, "the daemon ended:\n" + (self.folder / "log.txt").read_text())
        return [json.loads(line) for line in (self.folder / "log.txt").read_text().splitlines() if line.endswith("}")]

    def trust(self):
        return ssl.create_default_context(cafile=self.folder / "tls.crt")

    def ask(self, path, token=None, method="GET", body=None, origin=None):
        request = urllib.request.Request(self.url + path, method=method, data=body)
        if origin:
            request.add_header("Origin", origin)
        if body is not None:
            request.add_header("Content-Type", "application/json")
        if token:
            request.add_header("Authorization", "Bearer " + token)
        try:
            reply = urllib.request.urlopen(request, timeout=20, context=self.trust())
        except urllib.error.HTTPError as error:
            reply = error
        with reply:
            return reply.status, reply.read(), reply.headers

    def subject(self):
        with socket.create_connection(("127.0.0.1", self.port), timeout=20) as plain:
            unchecked = ssl._create_unverified_context()
            with unchecked.wrap_socket(plain) as secure:
                return secure.getpeercert(binary_form=True), secure.version()


def main():
    options = arguments()
    if shutil.which("openssl") is None:
        skip("the command openssl is missing")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        certificate(folder, "first")
        token = subprocess.run([options.client, "token", "create", "--file", folder / "tokens.json", "--name", "t", "--role", "admin"],
                               check=True, capture_output=True, text=True).stdout.strip()
        service = Service(options, folder)
        check(service.url.startswith("https://"), service.url)
        check(service.ask("/healthz")[0] == 200, "no answer over TLS")
        check(service.ask("/v1/robots")[0] == 401, "no token is needed")
        command = [options.client, "missions", "--server", service.url]
        trusted = subprocess.run(command, env={**os.environ, "SSL_CERT_FILE": folder / "tls.crt", "JOULECAST_TOKEN": token},
                               capture_output=True, text=True, timeout=30)
        check(trusted.returncode == 0, f"the command line over TLS: {trusted.stderr}")
        unknown = subprocess.run(command, env={**os.environ, "JOULECAST_TOKEN": token}, capture_output=True, text=True, timeout=30)
        check(unknown.returncode != 0 and "TLS" in unknown.stderr, f"an unknown certificate is trusted: {unknown.stderr}")
        status, document, _ = service.ask("/openapi.json", token)
        check(status == 200 and json.loads(document)["openapi"] == "3.1.0", f"a long answer: {status}")
        status, answer, _ = service.ask("/v1/robots/amr/profile", token, "POST", b'{"path": ["' + b"x" * 1_000_000 + b'"]}')
        check(status in (404, 422), f"a long body: {status} {answer[:200]}")
        status, _, headers = service.ask("/v1/session", None, "POST", json.dumps({"token": token}).encode())
        check(status == 200 and "; Secure" in headers["Set-Cookie"], f"{status} {headers['Set-Cookie']}")

        for origin, expected in ((service.url, 204), (service.url.replace("https:", "http:"), 403), (service.url + "0", 403)):
            status = service.ask("/v1/session", token, "DELETE", origin=origin)[0]
            check(status == expected, f"a change from a page of {origin}: {status}")

        first, version = service.subject()
        check(version in ("TLSv1.2", "TLSv1.3"), version)
        old = ssl._create_unverified_context()
        old.minimum_version = ssl.TLSVersion.TLSv1
        old.maximum_version = ssl.TLSVersion.TLSv1_1
        old.set_ciphers("ALL:@SECLEVEL=0")
        try:
            with socket.create_connection(("127.0.0.1", service.port), timeout=20) as plain, old.wrap_socket(plain) as secure:
                check(False, f"{secure.version()} is accepted")
        except (ssl.SSLError, ConnectionError):
            pass
        for ciphers, offered in (("ECDHE+AESGCM", True), ("ECDHE+CHACHA20", True), ("AES128-SHA:AES256-SHA:AES128-GCM-SHA256", False),
                                 ("ECDHE-ECDSA-AES128-SHA:ECDHE-ECDSA-AES256-SHA:ECDHE-ECDSA-AES128-SHA256", False)):
            context = ssl._create_unverified_context()
            context.maximum_version = ssl.TLSVersion.TLSv1_2
            context.set_ciphers(ciphers + ":@SECLEVEL=0")
            try:
                with socket.create_connection(("127.0.0.1", service.port), timeout=20) as plain, context.wrap_socket(plain) as secure:
                    check(offered, f"{secure.cipher()} is accepted")
            except (ssl.SSLError, ConnectionError) as error:
                check(not offered, f"{ciphers}: {error}")
        with socket.create_connection(("127.0.0.1", service.port), timeout=20) as plain:
            plain.sendall(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n")
            received = b""
            try:
                while piece := plain.recv(4096):
                    received += piece
            except ConnectionError:
                pass
            check(b"HTTP/1.1" not in received, f"plain HTTP is answered: {received}")

        certificate(folder, "second")
        check(service.subject()[0] == first, "the certificate changes without SIGHUP")
        service.process.send_signal(signal.SIGHUP)
        until("the new certificate", lambda: service.subject()[0] != first)
        check(service.ask("/healthz")[0] == 200, "no answer with the new certificate")
        second, _ = service.subject()
        good = (folder / "tls.crt").read_bytes()
        (folder / "tls.crt").write_text("no certificate\n")
        service.process.send_signal(signal.SIGHUP)
        until("the rejection of a broken certificate",
              lambda: any("previous certificate stays in use" in e["message"] for e in service.events()))
        check(service.subject()[0] == second, "a broken certificate is accepted")

        # Pipes in the place of files, which block a program that opens them.
        for name in ("tls.crt", "tokens.json"):
            (folder / name).rename(folder / f"{name}.file")
            os.mkfifo(folder / name)
        service.process.send_signal(signal.SIGHUP)
        until("the rejection of a pipe", lambda: any("is a pipe" in str(event) for event in service.events()))
        (folder / "tls.crt").unlink()
        (folder / "tls.crt").write_bytes(good)  # which this client reads too
        check(service.ask("/v1/robots", token)[0] == 200, "the tokens from before are gone")
        check(service.ask("/readyz")[0] == 503, "a pipe in the place of the tokens is not reported")
        (folder / "tokens.json.file").replace(folder / "tokens.json")
        (folder / "tls.crt.file").replace(folder / "tls.crt")

        service.process.terminate()
        check(service.process.wait(timeout=20) == 0, "the daemon did not stop in order")
        broken = subprocess.run([options.daemon, "--http-port", "0", "--store-path", folder / "other.db", "--lcm-url", "memq://",
                                 "--http-tls-certificate", folder / "tls.crt", "--http-tls-key", folder / "tls.key"],
                                capture_output=True, text=True, timeout=30)
        check(broken.returncode == 1 and "http.tls_certificate" in broken.stderr, broken.stderr)
        (folder / "tls.crt").write_bytes(good)
        ask_only_certified(options, folder, token)
    print("TLS 1.2 or newer, a new certificate at SIGHUP, broken ones rejected")


if __name__ == "__main__":
    main()
