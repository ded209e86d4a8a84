#!/usr/bin/env bash
# Installs, checks the formatting, builds without a warning, passes the tests; then the same tests under the address and
# undefined-behaviour sanitizers. --quick leaves the sanitizers out.
set -euo pipefail
cd "$(dirname "$0")/.."
quick=false
[ "${1:-}" = --quick ] && quick=true

deploy/install-dependencies.sh
deploy/check-format.sh
deploy/check-lint.sh

# Tests that speak UDP multicast get a network namespace of their own.
isolated() {
  if [ "$(id -u)" -eq 0 ] && unshare --net true 2>/dev/null; then
    unshare --net bash -c 'ip link set lo up && ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo && exec "$@"' -- "$@"
  else
    "$@"
  fi
}

if ! $quick; then
  cmake --preset sanitize
  cmake --build --preset sanitize
  isolated ctest --preset sanitize -j 2
fi
cmake --preset release -DJOULECAST_WERROR=ON
cmake --build --preset release
isolated ctest --preset release -j 2
