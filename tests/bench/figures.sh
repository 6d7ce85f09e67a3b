#!/usr/bin/env bash
# The pictures of docs/theory.md: a part of the Intel lab at 0.05 m, and merged 8 x 8 by two policies.
#   tests/bench/figures.sh BIN_DIR      needs scans/intel.gfs.log in APGM_REAL_DATA (default ../shared/data)
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=${1:?usage: tests/bench/figures.sh BIN_DIR}
data=${APGM_REAL_DATA:-../shared/data}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$bin/apgm-map" "$data/scans/intel.gfs.log" --resolution 0.05 -q -o "$work/native.apgm"
for policy in conditional dempster; do
  "$bin/apgm-resample" "$work/native.apgm" --policy "$policy" --step 5 -q -o "$work/$policy.apgm"
done
for map in native conditional dempster; do
  "$bin/apgm-render" "$work/$map.apgm" --bbox=-10.4,-24,5.6,-8 --scale 0.05 --no-legend --no-grid -q -O -o "docs/images/merged_$map.png"
done
