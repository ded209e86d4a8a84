#!/usr/bin/env bash
# Installs, builds and shows joulecast at work: the daemon on its embedded SQLite, a fleet of virtual robots that publish
# LCM telemetry, and the answers that a scheduler and an operator ask for. Leaves both running; `deploy/demo.sh stop` ends
# them.
set -euo pipefail
cd "$(dirname "$0")/.."
port="${DEMO_PORT:-8080}"
url="http://127.0.0.1:$port"
home="build/demo"

. deploy/demo_programs.sh
if [ "${1:-}" = stop ]; then
  end_programs
  echo "stopped"
  exit 0
fi

deploy/install-dependencies.sh
build_programs
mkdir -p "$home"
end_programs

for _ in $(seq 50); do
  curl -s -o /dev/null "$url" || break
  sleep 0.1
done
if curl -s -o /dev/null "$url"; then
  echo "Something else answers at $url: stop it, or say DEMO_PORT=8090 deploy/demo.sh" >&2
  exit 1
fi

route_multicast

build/demo-build/server/joulecastd --store-path "$home/history.db" --http-port "$port" >"$home/joulecastd.log" 2>&1 &
echo $! >"$home/joulecastd.pid"
for _ in $(seq 50); do
  kill -0 "$(cat "$home/joulecastd.pid")" 2>/dev/null || { cat "$home/joulecastd.log" >&2; exit 1; }
  curl -sf "$url/readyz" >/dev/null && break
  sleep 0.1
done
build/demo-build/client/joulecast simulate --robots 4 --seed "$(date +%s)" --mission-duration 40 --server "$url" --quiet >"$home/simulate.log" 2>&1 &
echo $! >"$home/simulate.pid"

echo
echo "A daemon and four robots are running. Waiting 50 s for the first missions to end ..."
sleep 50

ask() {
  echo
  echo "== $1"
  shift
  echo "   $*"
  "$@" | python3 -m json.tool --indent 2 | python3 -c 'import sys; t = sys.stdin.read().splitlines(); print("\n".join(t[:'"${lines:-30}"'])); len(t) > '"${lines:-30}"' and print("  ...")'
}
robot="$(curl -sf "$url/v1/missions?limit=1" | python3 -c 'import json, sys; print(json.load(sys.stdin)["missions"][0]["robot_id"])')"
mission="$(curl -sf "$url/v1/missions?limit=1&state=finished" | python3 -c 'import json, sys; print(json.load(sys.stdin)["missions"][0]["id"])')"
lines=40 ask "Operator: what is $robot doing?" curl -sf "$url/v1/robots/$robot/state"
lines=40 ask "Operator: what did the last finished mission spend?" curl -sf "$url/v1/missions/$mission"
lines=30 ask "Operator: where did that energy go?" curl -sf "$url/v1/missions/$mission/ledger"
lines=40 ask "Scheduler: the cheapest way for $robot to drive 10 m?" curl -sf -X POST "$url/v1/robots/$robot/profile" \
  -H 'Content-Type: application/json' -d '{"path": [{"kind": "straight", "length_m": 10}], "columns": false}'
lines=45 ask "Scheduler: how far can $robot still go?" curl -sf -X POST "$url/v1/robots/$robot/autonomy" -H 'Content-Type: application/json' -d '{}'
echo
echo "Running on:     $url/   (API: $url/openapi.json, live fleet: $url/v1/events)"
echo "Logs:           $home/joulecastd.log, $home/simulate.log"
echo "To stop:        deploy/demo.sh stop"
