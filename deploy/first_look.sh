#!/usr/bin/env bash
# A daemon with the history of one virtual robot, made in a minute:
#   deploy/first_look.sh PORT     starts it; its files are in ~/joulecast-first
#   deploy/first_look.sh stop     ends it
# joulecast and joulecastd must be on the PATH.
set -euo pipefail
project=$(cd "$(dirname "$0")/.." && pwd)
folder=${JOULECAST_FIRST_LOOK:-$HOME/joulecast-first}
unset JOULECAST_FIRST_LOOK # the daemon reads JOULECAST_* as settings
mkdir -p "$folder"
cd "$folder"
if [ -f pid ]; then
  kill "$(cat pid)" 2> /dev/null || true
  rm pid
fi
[ "${1:?PORT or stop}" != stop ] || exit 0
robot=$project/deploy/robots/amr.json
rm -f first.db*
# Its rolling resistance grows with the load; the robot file has no such effect.
joulecast simulate --robots 1 --robot "$robot" --seed 7 --missions 6 --mission-duration 60 --speed 0 \
  --effect load_rolling_resistance=0.02 --log amr.lcmlog --force --quiet
joulecast replay amr.lcmlog --into first.db --robot "$robot" > accounts.txt
joulecastd --store-path first.db --robots-directory "$project/deploy/robots" --lcm-url memq:// --http-port "$1" > joulecastd.log 2>&1 &
echo $! > pid
if ! curl -sf --retry 20 --retry-delay 1 --retry-all-errors "http://127.0.0.1:$1/readyz" > /dev/null; then
  cat joulecastd.log >&2
  exit 1
fi
echo "six missions of amr at http://127.0.0.1:$1"
