#!/usr/bin/env bash
# Shows a cluster on one machine: PostgreSQL with a synchronous standby, three daemons that share a fleet of thirty virtual
# robots. Kills one daemon and then the primary, checks that no sample is lost, and leaves the rest running;
# `deploy/cluster.sh stop` ends it. CLUSTER_PORT: the first of three ports (8081).
set -euo pipefail
cd "$(dirname "$0")/.."
port="${CLUSTER_PORT:-8081}"
home="$PWD/build/cluster"
lcm="udpm://239.255.76.67:7669?ttl=0&recv_buf_size=4194304"
nodes=(one two three)
robots=30

. deploy/demo_programs.sh
stop() {
  end_programs
  sleep 2
  local databases
  databases="$(cat "$home/databases" 2>/dev/null || true)"
  case "$databases" in
    */joulecast-cluster-??????)
      for folder in "$databases"/*; do
        [ ! -e "$folder/data/postmaster.pid" ] || tests/support/postgresql.sh stop "$folder" || true
      done
      rm -rf "$databases"
      ;;
  esac
  rm -rf "$home"
}
if [ "${1:-}" = stop ]; then
  stop
  echo "stopped"
  exit 0
fi

deploy/install-dependencies.sh postgresql
mkdir -p "$home"
step "Building joulecastd and joulecast (log: $home/demo-build.log)"
build demo
stop
mkdir -p "$home"
# Open to the user that runs PostgreSQL, with a short path for its socket.
databases="$(mktemp -d "${TMPDIR:-/tmp}/joulecast-cluster-XXXXXX")"
chmod 755 "$databases"
echo "$databases" >"$home/databases"
primary="$databases/db1" standby="$databases/db2"
mkdir "$primary" "$standby"
database="postgresql://joulecast@/postgres?host=$primary,$standby&target_session_attrs=read-write"

route_multicast

sql() { psql "$database" -XqtAF ' ' -c "$1"; }
start() { # which daemon
  local k=$1
  build/demo-build/server/joulecastd --store-url "$database" --store-path "$home/${nodes[k]}.db" --lcm-url "$lcm" \
    --cluster-name demo --cluster-node "${nodes[k]}" --http-port $((port + k)) >>"$home/${nodes[k]}.log" 2>&1 &
  echo $! >"$home/${nodes[k]}.pid"
  disown
  for _ in $(seq 100); do
    kill -0 "$(cat "$home/${nodes[k]}.pid")" 2>/dev/null || { cat "$home/${nodes[k]}.log" >&2; exit 1; }
    curl -sf "http://127.0.0.1:$((port + k))/readyz" >/dev/null && return
    sleep 0.1
  done
}
who() {
  sql "SELECT coalesce(n.node, 'no daemon') || ' keeps ' || count(*) || ' robots' FROM cluster_lease LEFT JOIN cluster_node n USING (node) GROUP BY n.node ORDER BY 1" |
    sed 's/^/   /'
}
kept() { sql "SELECT count(*) FROM cluster_lease JOIN cluster_node USING (node)"; }
spread() { sql "SELECT count(DISTINCT node) FROM cluster_lease JOIN cluster_node USING (node)"; }
wait_for() { # command, value: prints how long it took
  local began=$EPOCHREALTIME
  for _ in $(seq 600); do
    [ "$($1 2>/dev/null)" = "$2" ] && break
    sleep 0.05
  done
  python3 -c "print(f'   after {$EPOCHREALTIME - $began:.1f} s')"
}

echo "== PostgreSQL with a synchronous standby"
tests/support/postgresql.sh start "$primary"
tests/support/postgresql.sh standby "$primary" "$standby"
echo "== Three daemons"
for k in 0 1 2; do start "$k"; done
echo "== Thirty robots drive"
build/demo-build/client/joulecast simulate --robots $robots --seed "$(date +%s)" --rate 20 --mission-duration 20 --lcm-url "$lcm" \
  --server "http://127.0.0.1:$port" --quiet >"$home/simulate.log" 2>&1 &
echo $! >"$home/simulate.pid"
wait_for kept $robots
wait_for spread 3
who
sleep 10

echo "== kill -9 of daemon ${nodes[1]}"
kill -9 "$(cat "$home/${nodes[1]}.pid")"
wait_for spread 2
wait_for kept $robots
who
echo "== It starts again"
start 1
wait_for spread 3
who
echo "== The primary of PostgreSQL is lost, the standby takes its place"
tests/support/postgresql.sh stop "$primary"
tests/support/postgresql.sh promote "$standby"
before=$(sql "SELECT sum(samples) FROM mission")
grown() { [ "$(sql 'SELECT sum(samples) FROM mission')" -gt "$before" ] && echo yes; }
wait_for grown yes
who
echo "== Missions end ..."
sleep 25

read -r missions samples stored missing gaps <<<"$(sql "SELECT count(*), sum(samples), sum(telemetry_samples),
  sum(coalesce((sample_faults::json->>'missing')::bigint, 0)), sum(gap_count) FROM mission WHERE state = 'finished'")"
echo "   $missions missions have ended with $samples samples: $stored are stored, $missing are missing in their numbering, $gaps gaps"
[ "$samples" = "$stored" ] && [ "$missing" = 0 ] && [ "$gaps" = 0 ] && echo "   Nothing is lost." || { echo "   Something is lost!"; exit 1; }
echo
echo "Two PostgreSQL servers were started, one runs; three daemons answer at"
for k in 0 1 2; do echo "   http://127.0.0.1:$((port + k))/   ($home/${nodes[k]}.log)"; done
echo "All of them answer for all robots; who keeps which: curl http://127.0.0.1:$port/v1/cluster"
echo "deploy/cluster.sh stop ends it."
