#!/usr/bin/env python3
"""Tests deploy/check_language.py.

language_test.py CHECKER
"""
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

CHECKER = sys.argv.pop(1)
FILLER = "// The pump moves water into the tank.\n" * 100  # 700 words
HIT = "// The log zorgs it.\n"


class Language(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name)
        subprocess.run(["git", "init", "-q", self.root], check=True)
        self.write("deploy/language/words.txt", "zorgs?|zorged -> reports\nquux\\s(?:a|the) -> a noun\n")
        self.write("deploy/language/exceptions.txt", "*/generated.h\n*.md: as the manual zorgs\n")
        self.write("deploy/language/limits.txt", "# Limits.\n")

    def write(self, path, text):
        (self.root / path).parent.mkdir(parents=True, exist_ok=True)
        (self.root / path).write_text(text)

    def check(self, *arguments):
        """(exit code, everything printed)"""
        done = subprocess.run([sys.executable, "-B", CHECKER, "--root", self.root, *arguments], capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr

    def limit(self, folder):
        rows = (line.split() for line in (self.root / "deploy/language/limits.txt").read_text().splitlines())
        return next((row[1:] for row in rows if row[0] == folder), None)

    def test_accepts_three_hits_without_limit(self):
        self.write("src/pump/pump.h", HIT * 3)
        self.assertEqual(self.check(), (0, ""))

    def test_rejects_folder_above_aim(self):
        self.write("src/pump/pump.h", FILLER + HIT * 4)
        code, output = self.check()
        self.assertEqual(code, 1)
        self.assertIn("src/pump: 4 hits", output)

    def test_rejects_folder_above_limit(self):
        self.write("src/pump/pump.h", FILLER + HIT * 9)
        self.assertEqual(self.check("--update")[0], 0)
        self.assertEqual(self.check(), (0, ""))
        self.write("src/pump/pump.h", FILLER + HIT * 10)
        self.assertEqual(self.check()[0], 1)

    def test_update_lowers_limits(self):
        self.write("src/pump/pump.h", FILLER + HIT * 9)
        self.check("--update")
        before = float(self.limit("src/pump")[0])
        self.write("src/pump/pump.h", FILLER + HIT * 5)
        code, output = self.check()
        self.assertEqual(code, 1)
        self.assertIn("out of date", output)
        self.assertEqual(self.check("--update"), (0, ""))
        self.assertLess(float(self.limit("src/pump")[0]), before)

    def test_update_never_raises_limits(self):
        self.write("src/pump/pump.h", FILLER + HIT * 5)
        self.check("--update")
        before = self.limit("src/pump")
        self.write("src/pump/pump.h", FILLER + HIT * 9)
        self.write("src/tank/tank.h", FILLER + HIT * 9)
        self.assertEqual(self.check("--update")[0], 1)
        self.assertEqual(self.limit("src/pump"), before)
        self.assertEqual(self.limit("src/tank")[0], "3.0")

    def test_update_removes_lost_folders(self):
        self.write("src/pump/pump.h", HIT)
        self.check("--update")
        (self.root / "src/pump/pump.h").unlink()
        self.assertIn("no text", self.check()[1])
        self.assertEqual(self.check("--update"), (0, ""))
        self.assertIsNone(self.limit("src/pump"))

    def test_limits_test_name_length(self):
        self.write("tests/pump/pump_test.cc", "TEST(Pump, MovesTheWaterIntoTheTank) {}\n")
        self.check("--update")
        self.assertEqual(self.limit("tests/pump")[1], "6.0")
        self.write("tests/pump/pump_test.cc", "TEST(Pump, MovesTheColdWaterIntoTheTank) {}\n")
        code, output = self.check()
        self.assertEqual(code, 1)
        self.assertIn("test names have 7.00 words", output)

    def test_lists_hits_with_replacement(self):
        self.write("src/pump/pump.cc", '// The pump.\nconst char* text = "quux the pump zorged";\nint zorgs = 1;\n')
        self.write("src/pump/pump.py", 'zorgs = 1\n"""The pump.\n\nIt zorgs it."""\n')
        self.assertEqual(self.check("--list", "src/pump")[1].splitlines(), [
            'src/pump/pump.cc:2: quux the -> a noun | "quux the pump zorged"',
            'src/pump/pump.cc:2: zorged -> reports | "quux the pump zorged"',
            'src/pump/pump.py:4: zorgs -> reports | It zorgs it."""'])

    def test_honours_exceptions(self):
        self.write("src/pump/generated.h", HIT * 9)
        self.write("src/pump/pump.md", "It runs as the manual zorgs. The manual zorgs it.\n")
        self.assertEqual(self.check("--list", "src")[1].count("\n"), 1)


unittest.main()
