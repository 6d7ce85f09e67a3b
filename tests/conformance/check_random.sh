#!/usr/bin/env bash
# Random maps, archives and broken streams through the library's readers and the one in Python: same dumps.
#   check_random.sh MAKE_CORPUS PYTHON READER
set -euo pipefail
made="$(mktemp -d)"
trap 'rm -rf "$made"' EXIT
"$1" --random 50 "$made"
"$2" "$3" --check "$made"
