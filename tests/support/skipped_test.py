#!/usr/bin/env python3
"""skipped.py lets a skipped test pass for the reasons given to it, and for no other."""
import pathlib
import tempfile
import unittest

from skipped import faults_of

REPORT = """<testsuite>
<testcase name="a" status="run"/>
<testcase name="b" status="notrun"><skipped message="SKIP_RETURN_CODE=77"/><system-out>skipped: no shared folder</system-out></testcase>
<testcase name="c" status="notrun"><skipped message="SKIP_RETURN_CODE=77"/><system-out>skipped: no multicast</system-out></testcase>
<testcase name="d" status="notrun"><skipped message="SKIP_RETURN_CODE=77"/></testcase>
</testsuite>"""


class Skipped(unittest.TestCase):
    def test_names_those_without_a_reason(self):
        with tempfile.NamedTemporaryFile(suffix=".xml") as file:
            pathlib.Path(file.name).write_text(REPORT)
            names = lambda *reasons: [fault.split()[0] for fault in faults_of(file.name, reasons)]
            self.assertEqual(names(), ["b", "c", "d"])
            self.assertEqual(names("no shared folder"), ["c", "d"])
            self.assertEqual(names("no shared folder", "multicast"), ["d"])


unittest.main()
