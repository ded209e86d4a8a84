#!/usr/bin/python3
"""The HTTP reference lists the fields of every request, those of items of lists too.

    reference_test.py --source SOURCE
"""

import argparse
import json
import sys
import unittest
from pathlib import Path


class Reference(unittest.TestCase):
    def test_lists_have_described_items(self):
        text = reference.render(document)
        self.assertNotIn("array of any", text)

    def test_tasks_of_autonomy_are_described(self):
        rows = reference.fields(document, document["components"]["schemas"]["autonomy-request"])
        named = {row.split("`")[1] for row in rows}
        task = document["components"]["schemas"]["task"]["properties"]
        self.assertGreater(len(task), 5)
        for field in task:
            self.assertIn(f"tasks[].{field}", named)


if __name__ == "__main__":
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--source", type=Path, required=True)
    given, rest = arguments.parse_known_args()
    sys.path.insert(0, str(given.source / "server/reference"))
    sys.dont_write_bytecode = True
    import reference

    document = json.loads((given.source / "schemas/openapi.json").read_text())
    unittest.main(argv=[sys.argv[0], *rest])
