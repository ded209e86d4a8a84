#!/usr/bin/env bash
# Shows joulecast at work: the daemon on its embedded SQLite, four virtual robots that publish LCM telemetry, and answers for
# schedulers and operators. Both keep running.
#   deploy/demo.sh             installs the build's dependencies and builds the programs first
#   deploy/demo.sh --packages  installs ready Debian packages instead: build/packages/*.deb, build/*/packages/*.deb, or
#                              those of an apt source
#   deploy/demo.sh stop        ends the daemon and the robots
# DEMO_PORT: the HTTP port; 8080, with --packages 8090, since the packages start a service on 8080.
set -euo pipefail
cd "$(dirname "$0")/.."
home="build/demo"

. deploy/demo_programs.sh

# Sets `packages` to the newest ready packages of daemon and command line; false where there are none.
ready_packages() {
  local architecture daemons newest
  architecture="$(dpkg --print-architecture)"
  daemons="$(ls -t build/packages/joulecastd_*_"$architecture".deb build/*/packages/joulecastd_*_"$architecture".deb 2>/dev/null || true)"
  newest="${daemons%%$'\n'*}"
  packages=("./$newest" "./${newest%/*}/joulecast_${newest##*/joulecastd_}")
  [ -f "${packages[0]}" ] && [ -f "${packages[1]}" ]
}

# Installs with apt, after an update of its lists where they are missing or old.
apt_install() {
  local sudo=()
  [ "$(id -u)" -eq 0 ] || sudo=(sudo)
  local command=("${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "$@")
  "${command[@]}" || { "${sudo[@]}" apt-get update -q && "${command[@]}"; }
}

install_packages() {
  local program missing=()
  for program in curl:curl python3:python3 ip:iproute2; do
    command -v "${program%:*}" >/dev/null || missing+=("${program#*:}")
  done
  if ready_packages; then
    step "Step 1 of 3: installing ${packages[*]} (log: $home/install.log)"
    [ ${#missing[@]} -eq 0 ] || run_logged "$home/install.log" apt_install "${missing[@]}"
    run_logged "$home/install.log" apt_install --reinstall "${packages[@]}"
  elif apt-cache policy joulecastd 2>/dev/null | grep -q 'Candidate: [0-9]'; then
    step "Step 1 of 3: installing joulecastd and joulecast from an apt source (log: $home/install.log)"
    run_logged "$home/install.log" apt_install joulecastd joulecast "${missing[@]}"
  else
    cat >&2 <<END
There are no ready packages: build/packages and build/*/packages have no joulecastd_*_$(dpkg --print-architecture).deb with
the joulecast package of the same version, and no apt source provides joulecastd. Build them:
  deploy/install-dependencies.sh && cmake --workflow --preset packages
or show the demo from the sources: deploy/demo.sh
END
    exit 1
  fi
}

mode="${1:-build}"
case "$mode" in
  stop)
    end_programs
    echo "stopped"
    exit 0
    ;;
  build) port="${DEMO_PORT:-8080}" steps=5 ;;
  --packages)
    port="${DEMO_PORT:-8090}" steps=3
    # A group of its own: the installed service, which listens on the usual one, does not receive the demo's robots.
    export JOULECAST_LCM_URL="udpm://239.255.76.67:7668?ttl=0"
    ;;
  *)
    echo "usage: deploy/demo.sh [--packages | stop]" >&2
    exit 2
    ;;
esac
url="http://127.0.0.1:$port"
mkdir -p "$home"

if [ "$mode" = build ]; then
  echo "Five steps: dependencies, build, start, first answers, build of joulecast-study. The build takes minutes, once."
  step "Step 1 of 5: installing the build's dependencies that are missing (log: $home/install.log)"
  run_logged "$home/install.log" deploy/install-dependencies.sh
  step "Step 2 of 5: building joulecastd and joulecast (log: $home/demo-build.log)"
  build demo
  daemon=build/demo-build/server/joulecastd
  client=build/demo-build/client/joulecast
else
  install_packages
  daemon=joulecastd
  client=joulecast
fi
step "Step $((steps == 5 ? 3 : 2)) of $steps: starting the daemon and four virtual robots"
end_programs
for _ in $(seq 50); do
  curl -s -o /dev/null "$url" || break
  sleep 0.1
done
if curl -s -o /dev/null "$url"; then
  echo "Another program answers at $url: stop it, or choose another port: DEMO_PORT=8091 deploy/demo.sh ${1:-}" >&2
  exit 1
fi
route_multicast

trap 'end_programs; exit 130' INT
# Sessions of their own: neither Ctrl-C here nor the end of the terminal ends them.
setsid "$daemon" --store-path "$home/history.db" --http-port "$port" >"$home/joulecastd.log" 2>&1 </dev/null &
echo $! >"$home/joulecastd.pid"
ready=false
for _ in $(seq 100); do
  kill -0 "$(cat "$home/joulecastd.pid")" 2>/dev/null || break
  curl -sf "$url/readyz" >/dev/null && ready=true && break
  sleep 0.1
done
$ready || { cat "$home/joulecastd.log" >&2; echo "The daemon did not become ready" >&2; end_programs; exit 1; }
setsid "$client" simulate --robots 4 --seed "$(date +%s)" --mission-duration 20 --server "$url" --quiet >"$home/simulate.log" 2>&1 </dev/null &
echo $! >"$home/simulate.pid"

# wait_for SECONDS PATH EXPRESSION: prints the value of a Python expression of the answer, as soon as it has one.
wait_for() {
  local deadline=$((SECONDS + $1))
  until curl -sf "$url$2" | python3 -c "import json, sys; a = json.load(sys.stdin); print($3)" 2>/dev/null; do
    if ((SECONDS >= deadline)); then
      echo "No answer from $url$2 within $1 s; see $home/joulecastd.log and $home/simulate.log" >&2
      return 1
    fi
    sleep 0.3
  done
}
# show LINES TITLE COMMAND...: runs a command and prints the first lines of its JSON.
show() {
  local lines=$1
  echo
  echo "== $2"
  shift 2
  echo "   $*"
  "$@" | python3 -m json.tool --indent 2 | python3 -c 'import sys; t = sys.stdin.read().splitlines(); print("\n".join(t[:'"$lines"'])); len(t) > '"$lines"' and print("  ...")'
}
post() { show "$1" "$2" curl -sf -X POST "$url$3" -H 'Content-Type: application/json' -d "$4"; }

robot="$(wait_for 20 /v1/robots 'a["robots"][0]["robot_id"]')"
step "Step $((steps == 5 ? 4 : 3)) of $steps: first answers"
post 24 "Scheduler: the least energy for $robot to drive 10 m" "/v1/robots/$robot/profile" \
  '{"path": [{"kind": "straight", "length_m": 10}], "columns": false}'
post 60 "Scheduler: range and run time of $robot" "/v1/robots/$robot/autonomy" '{}'
show 24 "Operator: state of $robot" curl -sf "$url/v1/robots/$robot/state"
echo
step "Waiting for the first mission to end (about 20 s)"
mission="$(wait_for 120 '/v1/missions?limit=1&state=finished' 'a["missions"][0]["id"]')"
show 30 "Operator: energy of mission $mission" curl -sf "$url/v1/missions/$mission"
show 30 "Operator: ledger of mission $mission" curl -sf "$url/v1/missions/$mission/ledger"
cat <<END

Page:           $url/   (API: $url/openapi.json, live fleet: $url/v1/events)
Logs:           $home/joulecastd.log, $home/simulate.log
To stop:        deploy/demo.sh stop
END

if [ "$mode" = --packages ]; then
  echo "Telemetry:      JOULECAST_LCM_URL='$JOULECAST_LCM_URL' joulecast spy"
  [ ! -d /run/systemd/system ] || echo "Service:        the package's own joulecastd runs on port 8080: systemctl status joulecastd"
  step "The daemon and the robots are running. joulecastd, joulecast and joulecast-study are on the PATH."
  exit 0
fi
later="joulecast-study is not built. The daemon and the robots are running. To build it: cmake --build --preset demo-study"
trap 'echo; echo "$later"; exit 130' INT
step "Step 5 of 5: building joulecast-study, the researchers' program (log: $home/demo-study-build.log)"
echo "       The daemon and the robots are running; Ctrl-C ends this build alone."
build demo-study || { echo "$later" >&2; exit 1; }
step "Built: build/demo-build/client/joulecast-study. The daemon and the robots are running."
