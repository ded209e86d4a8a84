#!/usr/bin/env bash
# Installs the packages of Debian 12 that joulecast is built with and runs on, and packages named as arguments; with --tests
# also those of the tests. Run as root or with sudo available.
set -euo pipefail
packages=(
  g++ cmake ninja-build ccache pkg-config git ca-certificates
  liblcm-dev liblcm-bin libglib2.0-dev libeigen3-dev libsundials-dev libsqlite3-dev libpq-dev
  nlohmann-json3-dev libre2-dev
  libboost-dev libceres-dev libcli11-dev libfmt-dev prometheus-cpp-dev libexpected-dev libhowardhinnant-date-dev
  libssl-dev libmosquitto-dev libsystemd-dev libzstd-dev zlib1g-dev
  iproute2 curl python3 python3-markdown
)
if [ "${1:-}" = --tests ]; then
  packages+=(
    libgtest-dev libgmock-dev libbenchmark-dev librapidcheck-dev coinor-libipopt-dev
    clang-format clang-tidy cppcheck lintian openssl postgresql strace python3-jsonschema python3-scipy chromium nginx-light caddy prometheus mosquitto mosquitto-clients
    python3-rosbag python3-sensor-msgs python3-nav-msgs python3-geometry-msgs python3-tf2-msgs
  )
  # The tests of the page and of bags run on any version of node.
  command -v node >/dev/null && command -v npm >/dev/null || packages+=(nodejs npm)
else
  packages+=("$@")
fi
missing=()
for package in "${packages[@]}"; do
  [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] && exit 0
sudo=()
[ "$(id -u)" -eq 0 ] || sudo=(sudo)
export DEBIAN_FRONTEND=noninteractive
"${sudo[@]}" apt-get update -qq
"${sudo[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}"
