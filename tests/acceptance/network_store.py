#!/usr/bin/env python3
"""A daemon warns at its start of an SQLite store on a network file system, and of no other."""
import json

from harness import Programs, arguments, check
from host_faults import HostFaults

KINDS = {"0x6969": "NFS", "0xFE534D42": "SMB", "0xFF534D42": "SMB", "0x01021997": "9P", "0xEF53": None, "0x01021994": None}


def main():
    options = arguments()
    for kind, name in KINDS.items():
        programs = Programs(options)
        programs.lcm_url = "memq://"
        programs.environment = HostFaults(programs.folder.name).environment | {"HOST_FAULTS_FS": kind}
        programs.start()
        check(programs.stop() == 0, "stop")
        lines = [json.loads(line) for line in open(programs.path("daemon.log")) if line.startswith("{")]
        warned = [line for line in lines if "network file system" in line["message"]]
        check([line["file_system"] for line in warned] == ([name] if name else []), f"{kind}: {lines}")
        check(all(line["level"] == "warning" and line["path"] == programs.store for line in warned), f"{warned}")


main()
