#!/usr/bin/env python3
"""skipped.py accepts skipped tests for the given reasons only."""
import pathlib
import tempfile
import unittest

from skipped import faults_of

OF_CTEST = """<testsuite>
<testcase name="a" classname="a" status="run"/>
<testcase name="b" classname="b" status="notrun"><skipped message="SKIP_RETURN_CODE=77"/><system-out>skipped: no shared folder</system-out></testcase>
<testcase name="c" classname="c" status="notrun"><skipped message="SKIP_RETURN_CODE=77"/><system-out>skipped: no multicast</system-out></testcase>
<testcase name="d" classname="d" status="notrun"><skipped message="SKIP_RETURN_CODE=77"/></testcase>
</testsuite>"""

OF_GTEST = """<testsuites><testsuite name="Store">
<testcase name="Copies" status="run" result="completed" classname="Store"/>
<testcase name="Reads" status="run" result="skipped" classname="Store"><skipped message="x.cc:7&#x0A;no shared folder"><![CDATA[x.cc:7
no shared folder]]></skipped></testcase>
</testsuite></testsuites>"""


class Skipped(unittest.TestCase):
    def test_reports_unexpected_skips(self):
        with tempfile.NamedTemporaryFile(suffix=".xml") as file:
            def names(report, *reasons):
                pathlib.Path(file.name).write_text(report)
                return [fault.split()[0] for fault in faults_of(file.name, reasons)]
            self.assertEqual(names(OF_CTEST), ["b.b", "c.c", "d.d"])
            self.assertEqual(names(OF_CTEST, "no shared folder"), ["c.c", "d.d"])
            self.assertEqual(names(OF_CTEST, "no shared folder", "multicast"), ["d.d"])
            self.assertEqual(names(OF_GTEST, "multicast"), ["Store.Reads"])
            self.assertEqual(names(OF_GTEST, "no shared folder"), [])


unittest.main()
