#!/usr/bin/env python3
"""A daemon starts with many robots of a kind in its store: /readyz is 503 until the missions of all are read. Answers before that
contain siblings_pending, answers after it every sibling."""
import json
import random
import sqlite3
import time

from harness import Programs, arguments, ask, check

ROBOTS = [f"amr-{k}" for k in range(24)]
SECONDS = 120  # until ready, on a machine shared with other tests


def missions_of(seed):
    """Forty missions as they are stored: [start, [[motion, duration, way, speed, curvature, payload, energy], ...]]."""
    draw = random.Random(seed)
    legs = lambda: [[motion, seconds, way, speed, 0, 0, joules * draw.uniform(0.9, 1.1)] for _ in range(15)
                    for motion, seconds, way, speed, joules in
                    ((1, 11.0, 8.0, 0.8, 900.0), (2, 4.0, 1.6, 0.5, 150.0), (0, 3.0, 0.0, 0.0, 75.0))]
    return [[1_750_000_000_000_000 + 600_000_000 * k, legs()] for k in range(40)]


def consumption(programs):
    status, answer = ask(programs.url, "POST", f"/v1/robots/{ROBOTS[0]}/autonomy", {"state_of_charge": 0.9})
    check(status == 200, f"autonomy: {status} {answer}")
    return answer["consumption"]


def main():
    options = arguments()
    programs = Programs(options)
    programs.lcm_url = "memq://"
    programs.start()
    robot = json.load(open(f"{options.source}/deploy/robots/amr.json"))
    for name in ROBOTS:
        programs.put(f"/v1/robots/{name}", robot | {"robot_id": name})
    check(programs.stop() == 0, "stop")
    with sqlite3.connect(programs.store) as store:
        store.executemany("INSERT INTO learned VALUES (?, 'legs', 1, ?)",
                          [(name, json.dumps(missions_of(name))) for name in ROBOTS])
    store.close()

    programs.start()
    began, refused = time.monotonic(), 0
    while True:
        pending = consumption(programs)["siblings_pending"]
        status, answer = ask(programs.url, "GET", "/readyz")
        if status == 200:
            break
        check(status == 503 and "missions of robots are still being read" in json.dumps(answer), f"readyz: {status} {answer}")
        check(pending, "an answer before the missions are read does not contain it")
        check(time.monotonic() - began < SECONDS, f"not ready within {SECONDS} s")
        refused += 1
    check(refused > 0, "readyz was never 503")
    after = consumption(programs)
    check(not after["siblings_pending"] and after["siblings"] == 20, f"when ready: {after}")  # most_lenders
    print(f"ready after {time.monotonic() - began:.1f} s, refused {refused} times")
    check(programs.stop() == 0, "stop")


if __name__ == "__main__":
    main()
