#!/usr/bin/env bash
# A PostgreSQL server of a test's own, on a Unix socket in its folder.
#
#   postgresql.sh start FOLDER     a new one, or the one that is or was there; ready when this returns
#   postgresql.sh stop FOLDER      immediately, as after a power cut
#   postgresql.sh standby FOLDER OTHER  a synchronous standby in the folder OTHER of the server in FOLDER; both run
#   postgresql.sh promote OTHER    the standby becomes a server that takes writes
#
# Connect with postgresql://joulecast@/postgres?host=FOLDER. Ends with 77 where PostgreSQL is not installed.
set -euo pipefail
folder=$2
self=$(readlink -f "$0")
programs=$(ls -d /usr/lib/postgresql/*/bin "$(dirname "$(command -v pg_ctl || echo /)")" 2>/dev/null | sort -V | tail -1)
[ -x "$programs/initdb" ] || { echo "PostgreSQL is not installed" >&2; exit 77; }
as_user=()
# PostgreSQL refuses to be run by root.
[ "$(id -u)" -ne 0 ] || as_user=(setpriv --reuid=nobody --regid=nogroup --clear-groups env HOME="$folder")
cd /
case $1 in
start)
  if [ ! -f "$folder/data/PG_VERSION" ]; then
    mkdir -p "$folder/data"
    [ "$(id -u)" -ne 0 ] || chown -R nobody:nogroup "$folder"
    chmod 755 "$folder"
    "${as_user[@]}" "$programs/initdb" -D "$folder/data" -U joulecast -A trust --locale=C.UTF-8 --no-sync >"$folder/initdb.log"
    cat >>"$folder/data/postgresql.conf" <<SETTINGS
listen_addresses = ''
unix_socket_directories = '$folder'
fsync = off
shared_buffers = 16MB
SETTINGS
  fi
  "${as_user[@]}" "$programs/pg_ctl" -D "$folder/data" status >"$folder/status.log" && exit 0
  "${as_user[@]}" "$programs/pg_ctl" -D "$folder/data" -l "$folder/server.log" -w -t 120 start >"$folder/start.log" ||
    { cat "$folder/start.log" "$folder/server.log" >&2; exit 1; }
  ;;
standby)
  other=$3
  mkdir -p "$other"
  [ "$(id -u)" -ne 0 ] || chown nobody:nogroup "$other"
  chmod 755 "$other"
  "${as_user[@]}" pg_basebackup -h "$folder" -U joulecast -D "$other/data" -R -X stream -c fast --no-sync
  echo "unix_socket_directories = '$other'" >>"$other/data/postgresql.conf"
  "$self" start "$other"
  psql -h "$folder" -U joulecast -d postgres -Xqtc "ALTER SYSTEM SET synchronous_standby_names = '*'" \
    -c "SELECT pg_reload_conf()" >"$folder/standby.log"
  ;;
promote)
  "${as_user[@]}" "$programs/pg_ctl" -D "$folder/data" -w promote >"$folder/promote.log"
  ;;
stop)
  "${as_user[@]}" "$programs/pg_ctl" -D "$folder/data" -m immediate -w stop >"$folder/stop.log"
  ;;
esac
