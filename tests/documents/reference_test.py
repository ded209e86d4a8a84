"""The reference of a running daemon has every operation, setting and effect, and its links lead to places of the daemon.

reference_test.py SOURCE DAEMON CLIENT
"""
import html.parser
import json
import re
import subprocess
import sys
import unittest
import urllib.request
from pathlib import Path

source, daemon_program, client = (Path(argument).resolve() for argument in sys.argv[1:4])
sys.path.insert(0, str(source / "tests/server"))
from check_replies import Daemon


class Page(html.parser.HTMLParser):
    """The places, links and code of a page."""

    def __init__(self, text):
        super().__init__()
        self.places, self.links, self.code, self.inside = set(), set(), set(), None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.inside = tag
        self.places.add(attributes.get("id"))
        self.links.add(attributes.get("href"))

    def handle_data(self, data):
        if self.inside in ("code", "h2"):
            self.code.add(data.strip())


class Reference(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        daemon = Daemon(str(daemon_program))
        cls.addClassCleanup(daemon.stop)
        cls.url = daemon.url
        cls.page = Page(cls.read("/reference"))

    @classmethod
    def read(cls, path):
        with urllib.request.urlopen(cls.url + path, timeout=10) as reply:
            return reply.read().decode()

    def test_lists_every_operation(self):
        paths = json.loads(self.read("/openapi.json"))["paths"]
        wanted = {f"{method.upper()} {path}" for path, item in paths.items() for method in item if method in ("get", "put", "post", "delete")}
        self.assertGreater(len(wanted), 40)
        self.assertEqual(wanted - self.page.code, set())

    def test_lists_every_setting(self):
        groups = json.loads((source / "schemas/config.schema.json").read_text())["properties"]
        wanted = {f"{group}.{name}" for group, members in groups.items() for name in members.get("properties", {})}
        self.assertGreater(len(wanted), 40)
        self.assertEqual(wanted - self.page.code, set())

    def test_lists_every_effect(self):
        listing = subprocess.run([client, "effects"], check=True, capture_output=True, text=True).stdout
        wanted = set(re.findall(r"^  (\w+): ", listing, re.MULTILINE))
        self.assertGreater(len(wanted), 20)
        self.assertEqual(wanted - self.page.code, set())

    def test_links_lead_somewhere(self):
        for link in self.page.links - {None}:
            if link.startswith("#"):
                self.assertIn(link[1:], self.page.places)
            else:
                self.read("/" + link.lstrip("/"))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:])
