#!/usr/bin/env bash
# Files are known by file(1) and by the shared MIME database. Exits with 77 where the programs are missing.
#   check_types.sh SHARE_DIR CORPUS_DIR
set -euo pipefail
share=$1 corpus=$2
command -v file >/dev/null || { echo "no file(1)"; exit 77; }
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT

expect() {  # WHAT GOT WANTED
  [ "$2" = "$3" ] || { echo "$1: '$2', not '$3'" >&2; exit 1; }
}

for map in "$corpus"/good/*.apgm; do
  cp "$map" "$dir/map"  # a name that tells nothing
  version=$(od -An -tu2 -j8 -N4 "$map" | awk '{print $1 "." $2}')
  case $(file -b -m "$share/apgm.magic" "$dir/map") in
    "Adaptive Patched Grid Map, version $version"*) ;;
    *) echo "$map is not known to file(1)" >&2; exit 1 ;;
  esac
  expect "$map" "$(file -b -m "$share/apgm.magic" --mime-type "$dir/map")" application/vnd.apgm
done
printf 'APGMFIXG....' >"$dir/grid"
expect grid "$(file -b -m "$share/apgm.magic" --mime-type "$dir/grid")" application/vnd.apgm.fixed-grid
printf '\x89PNG\r\n\x1a\n' >"$dir/other"
case $(file -b -m "$share/apgm.magic" "$dir/other") in *Adaptive*) exit 1 ;; esac

command -v update-mime-database >/dev/null || { echo "no update-mime-database"; exit 0; }
mkdir -p "$dir/mime/packages"
cp "$share/apgm-mime.xml" "$dir/mime/packages/apgm.xml"
PKGSYSTEM_ENABLE_FSYNC=0 update-mime-database "$dir/mime"
expect "name of a map" "$(grep -c 'application/vnd.apgm:\*.apgm' "$dir/mime/globs2")" 1
expect "alias" "$(cat "$dir/mime/aliases")" "application/x-apgm application/vnd.apgm"
grep -aq 'application/vnd.apgm\]' "$dir/mime/magic"
