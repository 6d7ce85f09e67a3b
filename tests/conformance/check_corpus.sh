#!/usr/bin/env bash
# Makes the corpus again and compares it with the frozen files: same maps, same bytes.
#   check_corpus.sh MAKE_CORPUS FROZEN_DIR
set -euo pipefail
made="$(mktemp -d)"
trap 'rm -rf "$made"' EXIT
"$1" "$made"
if ! cmp -s "$made/zstd_version" "$2/zstd_version"; then
  echo "skipped: zstd $(cat "$made/zstd_version") compresses to other bytes than $(cat "$2/zstd_version")"
  exit 77
fi
diff -r --exclude=apgm.fbs "$2" "$made"
