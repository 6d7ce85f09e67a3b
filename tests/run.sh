#!/usr/bin/env bash
# Installs what is missing, builds with warnings as errors, and runs every test.
#   tests/run.sh [PRESET] [CTEST OPTIONS...]      PRESET: dev (default), release, asan, tsan
set -euo pipefail
cd "$(dirname "$0")/.."
preset=${1:-dev}
shift || true
.ci/install
export APGM_REAL_DATA="${APGM_REAL_DATA:-$(cd .. && pwd)/shared/data}"
cmake --preset "$preset"
cmake --build --preset "$preset" -j2
ctest --preset "$preset" "$@"
