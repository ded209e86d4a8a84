#!/usr/bin/env bash
# Installs, checks formatting and lint, builds everything without a warning, benchmarks too, and passes the tests. With
# --long also the tests labelled so, which repeat a guarantee on more cases; with --sanitize the tests also run under the
# address and undefined-behaviour sanitizers, in a build of their own; with --sanitize thread only the tests of what
# threads share run, under the thread sanitizer.
set -euo pipefail
cd "$(dirname "$0")/.."
sanitize=false threads=false long=false fuzz_seconds=5
labels=(-LE long)
case "${1:-} ${2:-}" in
" ") ;;
"--long ") long=true labels=() fuzz_seconds=60 ;;
"--sanitize ") sanitize=true ;;
"--sanitize thread") threads=true ;;
*) echo "usage: deploy/test.sh [--long | --sanitize [thread]]" >&2; exit 2 ;;
esac

deploy/install-dependencies.sh --tests
deploy/check-format.sh
deploy/check-lint.sh

# Under the thread sanitizer: what sessions and the writer share always; on request also accounting and a daemon that
# robots and clients load.
cmake --preset sanitize-thread
cmake --build --preset sanitize-thread --target http_server_test writer_test
ctest --preset sanitize-thread -j 4 -R '^(http_server_test|writer_test)$'
if $threads; then
  cmake --build --preset sanitize-thread --target ingest_test diagnosis_service_test joulecastd joulecast
  tests/support/isolated.sh build/sanitize-thread/tests/ingest/ingest_test --gtest_filter='*Pipeline*:*Takeover*:*FleetView*:*Hostile*:*Signature*:*Recent*'
  build/sanitize-thread/tests/diagnosis/diagnosis_service_test
  ctest --preset sanitize-thread -R '^acceptance_(killed_daemon|signed_telemetry|stalled_store|webhooks)$'
  exit
fi
if $sanitize; then
  cmake --preset sanitize
  cmake --build --preset sanitize
  ctest --preset sanitize -j 4 -LE "web|long"
fi
if $long; then  # each source compiles alone
  cmake --preset separate
  cmake --build --preset separate
fi
cmake --preset release -DJOULECAST_WERROR=ON -DJOULECAST_BENCHMARKS=ON -DJOULECAST_FUZZ_SECONDS=$fuzz_seconds
cmake --build --preset release
cmake --build --preset release --target web_test_packages
rm -rf build/release/tests/cases
ctest --preset release -j 6 "${labels[@]}" --output-junit "$PWD/build/release/tests.xml"
# All that tests need is installed: none may be skipped, but those of recordings that are not next to the project, and
# those of name spaces and of traced programs where this user may make none.
allowed=(--allow "no shared folder next to the project")
tests/support/isolated.sh || allowed+=(--allow "name ?spaces|multicast")
strace -o /dev/null true || allowed+=(--allow "strace cannot trace here")
tests/support/skipped.py "${allowed[@]}" build/release/tests.xml build/release/tests/cases/*.xml
