#!/usr/bin/env bash
# Fails when a source file is not as clang-format 14 would write it.
set -euo pipefail
cd "$(dirname "$0")/.."
git ls-files -- '*.cc' '*.h' | xargs -r -P "$(nproc)" -n 40 clang-format --dry-run --Werror
