"""The maps of the measurements, and the same cells as each peer keeps them."""

import os
import sys

from peers.measure import Command

CELLS = {"S": "250e3", "M": "10e6", "L": "100e6"}
SIDE_M = 100
BOX = "569950.05,5359950.05,570050.05,5360050.05"  # 100 m x 100 m across the corners of four quadrants
LOCAL_BOX = "-49.95,-49.95,50.05,50.05"            # the same from the datum
WINDOW = ["-projwin", "569950.05", "5360050.05", "570050.05", "5359950.05"]
ZSTD1 = ["-co", "COMPRESS=ZSTD", "-co", "ZSTD_LEVEL=1", "-co", "TILED=YES", "-co", "INTERLEAVE=BAND"]

PYTHON = "/usr/bin/python3" if os.path.exists("/usr/bin/python3") else sys.executable  # Debian's modules are only there
CONVERT_LOSS = (0, 3)  # history has no place in a GeoTIFF


def known(size):
    return int(float(CELLS[size]))


def overwriting(name, *args, out, ok=(0,)):
    """One of our tools that writes `out`."""
    return Command(name, *args, "-O", "-o", out, out=out, ok=ok)


def make_maps(bench, page):
    """{S,M,L}_{a,b}.apgm, M_stepped.apgm, {S,M}_{a,b}.ot."""
    for size in bench.sizes:
        for name, args in (("a", ["--seed", 1]), ("b", ["--seed", 2, "--overlap", 0.5])):
            command = ["--cells", CELLS[size], *args]
            if size in ("S", "M") and bench.has("octomap-merge"):
                command += ["--ot", f"{size}_{name}.ot"]
            make(bench, overwriting("make-bench-maps", *command, out=f"{size}_{name}.apgm"))
    stepped = ["--cells", CELLS["M"], "--seed", 1, "--model", "stepped"]
    stepped += ["--ot", "M_stepped.ot"] if bench.has("octomap-merge") else []
    make(bench, overwriting("make-bench-maps", *stepped, out="M_stepped.apgm"))
    for model in ("a", "stepped"):
        make(bench, overwriting("apgm-convert", f"M_{model}.apgm", "--lossy", "u8", out=f"M_{model}_u8.apgm"))
    if not bench.has("octomap-peer"):
        page.skip("OctoMap: liboctomap-dev was not there when the benchmarks were built")


def make_geotiffs(bench, page):
    """{S,M,L}_{a,b}.tif: two float32 bands, NaN where nothing is known, tiles of 256 band by band, ZSTD 1."""
    if not bench.has("gdal_translate", "gdal-peer"):
        page.skip("GDAL: gdal-bin or libgdal-dev was not there")
        return
    names = [f"{size}_{name}" for size in bench.sizes for name in "ab"] + ["M_stepped"]
    for name in names:
        if bench.exists(f"{name}.tif"):
            continue
        make(bench, overwriting("apgm-convert", f"{name}.apgm", out="converted.tif", ok=CONVERT_LOSS))
        make(bench, Command("gdal_translate", "-q", *ZSTD1, "converted.tif", f"{name}.tif", out=f"{name}.tif"))
        os.remove(bench.path("converted.tif"))


def make_vdbs(bench, page):
    if not bench.has("vdb-peer"):
        page.skip("OpenVDB: libopenvdb-dev was not there when the benchmarks were built")
        return
    for name in ["M_a", "M_stepped"] + (["L_a"] if "L" in bench.sizes else []):
        make(bench, Command("vdb-peer", "make", f"{name}.apgm", f"{name}.vdb", out=f"{name}.vdb"))


def make(bench, command):
    """Unless it is there, of a run before with the same --work."""
    if bench.exists(command.out):
        return
    bench.say(str(command))
    bench.run(command)


def make_all(bench, page):
    make_maps(bench, page)
    make_geotiffs(bench, page)
    make_vdbs(bench, page)
    os.sync()  # or the disk is still busy with them while is measured
