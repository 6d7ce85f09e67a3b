#!/usr/bin/env bash
# Installs the build into an empty place, builds a program against it from outside the tree, and runs it.
# usage: run.sh BUILD_DIR SOURCE_DIR CXX_FLAGS
set -euo pipefail
build=$1 source=$2 flags=$3
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cmake --install "$build" --prefix "$work/prefix" > "$work/install.log"
cmake -S "$source/tests/install/consumer" -B "$work/build" -G Ninja -DCMAKE_PREFIX_PATH="$work/prefix" \
      -DCMAKE_CXX_FLAGS="$flags" > "$work/configure.log"
cmake --build "$work/build" > "$work/build.log"
"$work/build/consumer" "$work/a.apgm"
if [ -x "$work/prefix/bin/apgm-info" ]; then
  "$work/prefix/bin/apgm-info" "$work/a.apgm" > "$work/info.txt"
  "$work/prefix/bin/apgm" info --json "$work/a.apgm" > "$work/info.json"
fi
