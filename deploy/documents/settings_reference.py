"""Writes the table of settings (settings.md) from schemas/config.schema.json:

    python3 deploy/documents/settings_reference.py > deploy/documents/settings.md
"""

import json
import sys
from pathlib import Path

from http_reference import ROOT, bounds, cell


def render(schema):
    lines = ["# Settings of joulecastd", "", "Generated from `schemas/config.schema.json` by `settings_reference.py`; a test "
             "checks it. A setting `http.port` is the flag `--http-port`, the environment variable `JOULECAST_HTTP_PORT`, and "
             "in a settings file the member `port` of `http`.", "", "| setting | type | meaning |", "|---|---|---|"]
    for group, members in schema["properties"].items():
        for name, setting in members.get("properties", {}).items():
            kind = " \\| ".join(f"`{v}`" for v in setting["enum"]) if "enum" in setting else setting["type"]
            lines.append(f"| `{group}.{name}` | {kind} | {cell(setting['description'])}; {bounds(setting)} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(render(json.loads((ROOT / "schemas/config.schema.json").read_text())))
