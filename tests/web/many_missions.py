"""Fills a history with copies of its ended missions, for all robots in it:

    python3 many_missions.py history.db 100000
"""

import sqlite3
import sys

SPACING_US = 170_000_000


def fill(path, wanted):
    store = sqlite3.connect(path)
    robots = [row[0] for row in store.execute("SELECT robot_id FROM robot WHERE active_version = 1 ORDER BY robot_id")]
    columns = [row[1] for row in store.execute("PRAGMA table_info(mission)")]
    patterns = store.execute(f"SELECT {', '.join(columns)} FROM mission WHERE state = 'finished' AND model_version = 1 "
                             "ORDER BY mission_key LIMIT 100").fetchall()
    there, key, first_us = store.execute("SELECT count(*), max(mission_key), min(start_utime_us) FROM mission").fetchone()
    place = {name: columns.index(name) for name in columns}

    def copies():
        for k in range(wanted - there):
            row = list(patterns[k % len(patterns)])
            length_us = row[place["end_utime_us"]] - row[place["start_utime_us"]]
            start_us = first_us - (1 + k) * SPACING_US
            for name, value in (("mission_key", key + 1 + k), ("robot_id", robots[k % len(robots)]),
                                ("mission_id", f"past-{k}"), ("start_utime_us", start_us),
                                ("end_utime_us", start_us + length_us), ("telemetry_samples", 0)):
                row[place[name]] = value
            yield row

    with store:
        store.executemany(f"INSERT INTO mission VALUES ({', '.join('?' * len(columns))})", copies())
    print(store.execute("SELECT count(*) FROM mission").fetchone()[0], "missions of", len(robots), "robots")


if __name__ == "__main__":
    fill(sys.argv[1], int(sys.argv[2]))
