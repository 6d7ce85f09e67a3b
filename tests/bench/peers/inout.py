"""Writing and reading M in one process and on one core, beside memcpy of the planes."""

from peers.data import Command
from peers.measure import median
from peers.page import pair_ratio, show_ratio, show_time, table

ZSTD = {"GeoTIFF ZSTD 9": 9, "GeoTIFF ZSTD 1": 1}


def write(bench, page):
    ours = bench.timings(Command("io-bench", "write", "M_a.apgm", "w.apgm", "--runs", bench.runs, out="w.apgm"))
    lossy = bench.timings(Command("io-bench", "write", "M_a.apgm", "w.apgm", "--lossy", "u8", "--runs", bench.runs, out="w.apgm"))
    took, copied = ours["write"], ours["memcpy"]
    figures = [("**.apgm**", took), ("**.apgm `--lossy u8`**", lossy["write"]), ("memcpy of the planes", copied)]
    peers = {}
    if bench.has("gdal-peer"):
        for name, level in ZSTD.items():
            options = ["--runs", min(bench.runs, 3), "--co", "COMPRESS=ZSTD", "--co", f"ZSTD_LEVEL={level}"]
            peers[name] = bench.timings(Command("gdal-peer", "write", "M_a.tif", "w.tif", *options, out="w.tif"))["write"]
    if bench.has("octomap-peer"):
        peers[".ot"] = bench.timings(Command("octomap-peer", "write", "M_a.ot", "w.ot", "--runs", min(bench.runs, 3), out="w.ot"))["write"]
    if bench.has("vdb-peer"):
        peers["OpenVDB"] = bench.timings(Command("vdb-peer", "write", "M_a.vdb", "w.vdb", "--runs", min(bench.runs, 3), out="w.vdb"))["write"]
    if "GeoTIFF ZSTD 9" in peers:
        page.at_most("write M, one core", "GeoTIFF ZSTD 9", median(took), median(peers["GeoTIFF ZSTD 9"]), 0.05)
    else:
        page.unmeasured("write M, one core", "GeoTIFF ZSTD 9", "<= 0.05 x")
    page.at_most("write M, one core", "memcpy of the planes", median(took), median(copied), 8, ratio=pair_ratio(took, copied))
    return figures + list(peers.items()), took, copied


def read(bench, page):
    ours = bench.timings(Command("io-bench", "read", "M_a.apgm", "--runs", bench.runs))
    took, copied = ours["read"], ours["memcpy"]
    figures = [("**.apgm**, into planes that were there", took), ("**.apgm**, one layer at a time", ours["stream"]),
               ("**.apgm**, into a new `Map`", ours["map"]), ("memcpy of the planes", copied)]
    peers = {}
    if bench.has("gdal-peer"):
        peers["GeoTIFF ZSTD 1, into planes that were there"] = bench.timings(Command("gdal-peer", "read", "M_a.tif", "--runs", bench.runs))["read"]
    if bench.has("octomap-peer"):
        peers[".ot"] = bench.timings(Command("octomap-peer", "read", "M_a.ot", "--runs", min(bench.runs, 3)))["read"]
    if bench.has("vdb-peer"):
        peers["OpenVDB"] = bench.timings(Command("vdb-peer", "read", "M_a.vdb", "--runs", min(bench.runs, 3)))["read"]
    page.at_most("read M, one core", "memcpy of the planes", median(took), median(copied), 3, ratio=pair_ratio(took, copied))
    if ".ot" in peers:
        page.at_most("read M, one core", ".ot", median(took), median(peers[".ot"]), 0.03)
    else:
        page.unmeasured("read M, one core", ".ot", "<= 0.03 x")
    return figures + list(peers.items()), took, copied


def measure(bench, page):
    for title, (figures, took, copied), note in (
            ("Writing M, one core", write(bench, page), "From memory to a file in the page cache: layers, blocks of a raster, a tree, two grids."),
            ("Reading M, one core", read(bench, page), "From the page cache to memory, every checksum of `.apgm` checked. The others have none.")):
        rows = [(name, show_time(median(s)), show_ratio(median(s) / median(copied)), show_ratio(median(took) / median(s)))
                for name, s in figures]
        page.section(title, *table(("", "median", "beside memcpy", "ours beside it"), rows), "",
                     f"{note} Times are of the work within a process, after one run to warm up.")
