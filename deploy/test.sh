#!/usr/bin/env bash
# Installs, checks formatting and lint, builds everything without a warning, benchmarks too, and passes the tests. With
# --sanitize the tests also run under the address and undefined-behaviour sanitizers, in a build of their own; with
# --sanitize thread only the tests of what threads share run, under the thread sanitizer.
set -euo pipefail
cd "$(dirname "$0")/.."
sanitize=false
[ "${1:-}" = --sanitize ] && sanitize=true
threads=false
[ "${1:-} ${2:-}" = "--sanitize thread" ] && threads=true

deploy/install-dependencies.sh --tests
deploy/check-format.sh
deploy/check-lint.sh

# Tests that speak UDP multicast get a network namespace of their own.
namespaces=false
if [ "$(id -u)" -eq 0 ] && unshare --net true 2>/dev/null; then namespaces=true; fi
isolated() {
  if $namespaces; then
    unshare --net bash -c 'ip link set lo up && ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo && exec "$@"' -- "$@"
  else
    "$@"
  fi
}

# Under the thread sanitizer: what sessions and the writer share always; on request also accounting and a daemon that
# robots and clients load.
cmake --preset sanitize-thread
cmake --build --preset sanitize-thread --target http_server_test history_test
isolated build/sanitize-thread/tests/server/http_server_test
build/sanitize-thread/tests/history/history_test --gtest_filter='Writer*'
if $threads; then
  cmake --build --preset sanitize-thread --target ingest_test diagnosis_service_test joulecastd joulecast
  isolated build/sanitize-thread/tests/ingest/ingest_test --gtest_filter='*Pipeline*:*Takeover*:*FleetView*:*Hostile*:*Signature*:*Recent*'
  build/sanitize-thread/tests/diagnosis/diagnosis_service_test
  isolated ctest --preset sanitize-thread -R '^acceptance_(killed_daemon|signed_telemetry|stalled_store|webhooks)$'
  exit
fi
if $sanitize; then
  cmake --preset sanitize
  cmake --build --preset sanitize
  isolated ctest --preset sanitize -j 2 -LE web
fi
cmake --preset release -DJOULECAST_WERROR=ON -DJOULECAST_BENCHMARKS=ON
cmake --build --preset release
cmake --build --preset release --target web_test_packages
isolated ctest --preset release -j 2 --output-junit "$PWD/build/release/tests.xml"
# All that tests need is installed: none may be skipped, but those of recordings that are not beside the project, and
# those of name spaces where this user may make none.
$namespaces && unprivileged="" || unprivileged="name ?spaces|multicast"
tests/support/skipped.py build/release/tests.xml "no shared folder beside the project" ${unprivileged:+"$unprivileged"}
