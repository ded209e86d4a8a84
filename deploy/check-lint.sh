#!/usr/bin/env bash
# Static analysis, fast enough for every run: the language check, cppcheck over all C++ sources, biome and prettier over
# JavaScript's. With a build folder as argument, clang-tidy too (.clang-tidy), which takes about as long as a build.
set -euo pipefail
cd "$(dirname "$0")/.."
deploy/check_language.py
# Suppressed: false findings of cppcheck 2.10 on C++20 (a range-for over a call that moves its argument; a back_inserter,
# which growth does not invalidate; macros, concepts and requires-expressions that it cannot parse).
cppcheck --std=c++20 --language=c++ --enable=warning,portability --inline-suppr --quiet --error-exitcode=1 -j "$(nproc)" \
  --suppress=missingIncludeSystem --suppress=internalAstError --suppress=syntaxError --suppress=unknownMacro --suppress=accessMoved \
  --suppress=invalidContainer --suppress=duplicateAssignExpression --suppress=identicalConditionAfterEarlyExit \
  -I src -I . src server client tests/study
# biome and prettier in the versions of server/web/package-lock.json; npm brings them once.
lock=server/web/package-lock.json
tools=server/web/node_modules
cmp -s "$lock" "$tools/.installed.json" || {
  npm ci --prefix server/web --ignore-scripts --no-audit --no-fund --silent
  cp "$lock" "$tools/.installed.json"
}
mapfile -t scripts < <(git ls-files -- 'server/web/*.mjs' 'server/web/source/*.js' 'server/web/source/*.jsx' 'tests/web/*.mjs' \
  'deploy/import/bags/*.mjs' 'tests/import/*.mjs')
"$tools"/@biomejs/cli-linux-*/biome lint --config-path server/web/biome-lint.json --error-on-warnings "${scripts[@]}"
"$tools/.bin/prettier" --config server/web/.prettierrc.json --log-level warn --check "${scripts[@]}" 'server/web/source/**/*.css'
if grep -nE '^ *// .{108}' "${scripts[@]}"; then exit 1; fi # comments longer than prettier's lines
if [ $# -gt 0 ]; then
  git ls-files -- 'src/*.cc' 'server/*.cc' 'client/*.cc' 'tests/study/*.cc' | xargs -P "$(nproc)" -n 4 clang-tidy -p "$1" --quiet
fi
