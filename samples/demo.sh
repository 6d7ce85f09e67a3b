#!/usr/bin/env bash
# The main job: two recorded maps become one fused map, a crop of it and a picture.
#   samples/demo.sh                 with the maps of two simulated vehicles
#   samples/demo.sh A B             with two maps of yours: .apgm, OctoMap .bt/.ot, map_server .yaml
# Writes to samples/out. Options of the merge can follow, e.g. --regrid.
set -euo pipefail
cd "$(dirname "$0")/.."
caller=$OLDPWD
.ci/install
cmake --preset release -DAPGM_TESTS=OFF -DAPGM_BENCH=OFF > /dev/null
cmake --build --preset release -j2
export PATH="$PWD/build/release/bin:$PATH"
out=samples/out
mkdir -p "$out"

show() {
  echo "$ $*"
  "$@"
}

if [ $# -ge 2 ]; then
  a=$(cd "$caller" && realpath "$1")
  b=$(cd "$caller" && realpath "$2")
  shift 2
else
  show make-scene -O -o "$out/scene"
  a=$out/scene/vehicle_a.apgm
  b=$out/scene/vehicle_b.apgm
fi
show apgm convert "$a" -O -o "$out/a.apgm"
show apgm convert "$b" -O -o "$out/b.apgm"
show apgm merge "$out/a.apgm" "$out/b.apgm" -O -o "$out/fused.apgm" --conflict-map "$out/conflict.png" "$@"
show apgm info "$out/fused.apgm"

# The middle third of the map on each axis.
box=$(apgm info --json "$out/fused.apgm" | python3 -c '
import json, sys
x0, y0, x1, y1 = json.load(sys.stdin)["map"]["bbox_m"]
print(*(round(v, 3) for v in (x0 + (x1 - x0) / 3, y0 + (y1 - y0) / 3, x1 - (x1 - x0) / 3, y1 - (y1 - y0) / 3)), sep=",")')
show apgm crop "$out/fused.apgm" --bbox="$box" -O -o "$out/crop.apgm"
for map in a b fused crop; do
  show apgm render "$out/$map.apgm" -O -o "$out/$map.png"
done
show apgm convert "$out/crop.apgm" -O -o "$out/crop.yaml" || [ $? -eq 3 ] # 3: written, with loss that is listed
echo "look at $out/fused.png, $out/crop.png and $out/conflict.png"
