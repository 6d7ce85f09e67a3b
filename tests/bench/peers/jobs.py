"""Merge, crop and resample, file to file and whole process."""

from peers.data import BOX, LOCAL_BOX, WINDOW, ZSTD1, Command, overwriting
from peers.measure import median
from peers.page import pair_ratio, show_ratio, show_time, table

THREADS = ["--config", "GDAL_NUM_THREADS", "ALL_CPUS"]
CACHE = ["--config", "GDAL_CACHEMAX", "25%"]  # with the 5 % it takes by itself, merging two L packs the same blocks again and again


def merge(size, threads=0):
    return overwriting("apgm-merge", f"{size}_a.apgm", f"{size}_b.apgm", "-j", threads, out=f"{size}_merged.apgm")


def crop(size, threads=0):
    return overwriting("apgm-crop", f"{size}_a.apgm", "--bbox", BOX, "-j", threads, out=f"{size}_crop.apgm")


def resample(size, threads=0):
    return overwriting("apgm-resample", f"{size}_a.apgm", "--resolution", "0.2", "-j", threads, out=f"{size}_half.apgm")


def gdal_merge(size):
    inputs = [f"{size}_a.tif", f"{size}_b.tif"]
    warp = Command("gdalwarp", "-q", *THREADS, *CACHE, "-multi", *ZSTD1, *inputs, "warped.tif", out="warped.tif")
    script = Command("gdal_merge.py", "-q", *CACHE, "-n", "nan", "-a_nodata", "nan", *ZSTD1, "-o", "pasted.tif", *inputs, out="pasted.tif")
    return {name: command for name, command in (("gdalwarp", warp), ("gdal_merge.py", script))}


def translate(size, *args, options=ZSTD1):
    return Command("gdal_translate", "-q", *THREADS, *args, *options, f"{size}_a.tif", "t.tif", out="t.tif")


class Rows:
    """A table of one kind of work over sizes and programs."""

    def __init__(self, bench, page):
        self.bench = bench
        self.page = page
        self.rows = []

    def take(self, size, ours, peers):
        """Medians of seconds by name. A peer that fails is left out with a line."""
        taken = {"ours": self.bench.in_turn(ours)[0]}
        for name, command in peers.items():
            try:
                taken[name] = self.peer(command, warm=size != "L")
            except RuntimeError as error:
                self.page.skip(f"{name}, {size}: {str(error).splitlines()[0]}")
        for name, seconds in taken.items():
            label = f"**{ours.name}**" if name == "ours" else name
            own = median(taken["ours"]) / median(seconds)
            self.rows.append((size, label, show_time(median(seconds)), len(seconds), "" if name == "ours" else show_ratio(own)))
        return {name: median(seconds) for name, seconds in taken.items()}

    def peer(self, command, warm):
        """The slower, the fewer runs; on L without one to warm up."""
        first = self.bench.in_turn(command, runs=1, warm=warm)[0]
        more = self.bench.runs - 1
        for limit, most in ((1, 2), (10, 1), (30, 0)):
            more = min(more, most) if first[0] > limit else more
        return first if more == 0 else first + self.bench.in_turn(command, runs=more, warm=False)[0]

    def lines(self):
        return table(("map", "", "median", "runs", "ours beside it"), self.rows)


def judge(page, work, taken, name, bound):
    if name in taken:
        page.at_most(work, name, taken["ours"], taken[name], bound)
    else:
        page.unmeasured(work, name, f"<= {bound:g} x")


def merges(bench, page, curves):
    rows = Rows(bench, page)
    for size in bench.sizes:
        peers = {}
        if size != "L" and bench.has("octomap-merge"):
            peers["OctoMap"] = Command("octomap-merge", f"{size}_a.ot", f"{size}_b.ot", "-o", "o.ot", out="o.ot")
        if bench.exists(f"{size}_a.tif"):
            peers.update({name: c for name, c in gdal_merge(size).items() if bench.has(name)})
        taken = rows.take(size, merge(size), peers)
        curves["merge"][size] = taken
        if size == "S":
            continue
        if size == "M":
            judge(page, "merge of two M", taken, "OctoMap", 0.007)
        judge(page, f"merge of two {size}", taken, "gdalwarp", 0.010)
    page.section("Merge of two maps, file to file", *rows.lines(), "",
                 "Half of their width in common. `apgm-merge` fuses by Dempster's rule, OctoMap adds log-odds (lazy updates, one pass over the inner",
                 "nodes: its fastest way); gdalwarp and gdal_merge.py overwrite. All threads each of them takes; OctoMap and gdal_merge.py take one.")


def crops(bench, page, curves):
    rows = Rows(bench, page)
    for size in bench.sizes:
        peers = {}
        if bench.exists(f"{size}_a.tif"):
            peers["gdal_translate, ZSTD 1"] = translate(size, *WINDOW)
            peers["gdal_translate, not compressed"] = translate(size, *WINDOW, options=["-co", "TILED=YES"])
        if bench.exists(f"{size}_a.vdb") and bench.has("vdb-peer"):
            peers["OpenVDB"] = Command("vdb-peer", "crop", f"{size}_a.vdb", "c.vdb", "--bbox", LOCAL_BOX, out="c.vdb")
        if size != "L" and bench.has("octomap-peer"):
            peers["OctoMap"] = Command("octomap-peer", "crop", f"{size}_a.ot", "c.ot", "--bbox", LOCAL_BOX, out="c.ot")
        curves["crop"][size] = rows.take(size, crop(size), peers)
    largest = bench.sizes[-1]
    page.below(f"crop 100 m x 100 m from {largest}", curves["crop"][largest]["ours"], 0.005)
    if "L" in bench.sizes:
        small, large = bench.in_turn(crop("M"), crop("L"), runs=4 * bench.runs)
        ratio = pair_ratio(large, small)
        page.at_most("crop from L beside M", "the same from M", median(large), median(small), 1.2, goal="within 20 %", ratio=ratio)
    else:
        page.unmeasured("crop from L beside M", "the same from M", "within 20 %")
    page.section("Crop of 100 m x 100 m, whole process", *rows.lines(), "",
                 "The box cuts through patches on all sides.")


def resamples(bench, page, curves):
    rows = Rows(bench, page)
    for size in bench.sizes:
        peers = {}
        if bench.exists(f"{size}_a.tif"):
            peers["gdal_translate -r average"] = translate(size, "-r", "average", "-tr", "0.2", "0.2")
        taken = curves["resample"][size] = rows.take(size, resample(size), peers)
        if size != "S":
            judge(page, f"resample {size} by 2", taken, "gdal_translate -r average", 0.04)
    page.section("Resample by 2, file to file", *rows.lines(), "", "0.1 m to 0.2 m. Ours by the paper's conditional policy, GDAL's the mean of each band.")


def measure(bench, page, curves):
    merges(bench, page, curves)
    crops(bench, page, curves)
    resamples(bench, page, curves)
