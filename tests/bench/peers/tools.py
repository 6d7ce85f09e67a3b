"""Verify, start of info, threads, memory, and what a larger map costs."""

import shutil

from peers.data import Command, known, overwriting
from peers.jobs import crop, merge, resample
from peers.measure import median
from peers.page import pair_ratio, show_time, table


def info(size):
    return Command("apgm-info", f"{size}_a.apgm")


def verify_command(size, threads=0):
    return Command("apgm-verify", "-q", f"{size}_a.apgm", "-j", threads)


def convert(size, threads):
    return overwriting("apgm-convert", f"{size}_a.apgm", "--level", 3, "-j", threads, out="t.apgm")


def verify(bench, page, curves):
    size = bench.sizes[-1]
    taken = bench.timings(Command("io-bench", "hash", f"{size}_a.apgm", "--runs", bench.runs))
    one, all_cores = bench.in_turn(verify_command(size, 1), verify_command(size))
    mib = bench.size(f"{size}_a.apgm")
    rate = lambda seconds: f"{mib / median(seconds) / 1e9:.2f} GB/s"
    rows = [(label, show_time(median(s)), rate(s)) for label, s in (
        ("**apgm-verify -j1**, whole process", one), ("**apgm-verify**, all cores, whole process", all_cores),
        ("**verify()** of the file, one thread", taken["verify"]), ("XXH3-64, the file read in pieces of 1 MiB", taken["read_hash"]),
        ("XXH3-64, bytes in memory", taken["hash"]))]
    for against, key in (("XXH3-64, read and hashed", "read_hash"), ("XXH3-64, bytes in memory", "hash")):
        ratio = pair_ratio(taken[key], one)
        page.at_least(f"apgm-verify -j1 of {size}, speed", against, rate(one), rate(taken[key]), 0.5, ratio)
    page.section(f"Verify {size}, {mib / 2**20:.0f} MiB", *table(("", "median", ""), rows))
    for of in bench.sizes:
        curves["verify"][of] = {"ours": median(all_cores if of == size else bench.in_turn(verify_command(of))[0])}


def start(bench, page, curves):
    nothing = Command("true")
    columns = bench.in_turn(nothing, *[info(size) for size in bench.sizes], runs=4 * bench.runs)
    rows = [("an empty process (`true`)", show_time(median(columns[0])))]
    for size, seconds in zip(bench.sizes, columns[1:]):
        curves["info"][size] = {"ours": median(seconds)}
        rows.append((f"apgm-info, {size}", show_time(median(seconds))))
    page.below(f"start of apgm-info, {bench.sizes[-1]}", median(columns[-1]), 0.005)
    page.section("Start of apgm-info, whole process", *table(("", "median"), rows))


def threads(bench, page):
    rows = []
    for size in bench.sizes[1:]:
        jobs = (("merge", merge), ("resample", resample), ("convert, packed again", convert), ("verify", verify_command))
        for name, job in jobs:
            if job is convert and size == "L":
                continue  # the longest, and no other than of M
            one, two = bench.in_turn(job(size, 1), job(size, 2))
            ratio = pair_ratio(one, two)
            rows.append((f"{name}, {size}", show_time(median(one)), show_time(median(two)), f"{ratio:.2f}"))
            if name == "merge":
                page.at_least(f"merge of two {size}, 2 threads", "1 thread", show_time(median(two)), show_time(median(one)), 1.7, ratio)
    page.section("Threads", *table(("work", "-j1", "-j2", "times faster"), rows))


def memories(bench, page):
    half = lambda size: overwriting("apgm-crop", f"{size}_a.apgm", "--bbox", "569950.05,0,1e6,6e6", out="t.apgm")
    jobs = [("merge", merge), ("merge -j1", lambda s: merge(s, 1)), ("crop 100 m x 100 m", crop), ("crop of half the map", half),
            ("resample", resample), ("verify", verify_command), ("info", info)]
    rows = [[name, *[f"{bench.memory(job(size)):.1f}" for size in bench.sizes]] for name, job in jobs]
    if bench.has("octomap-merge"):
        octo = Command("octomap-merge", "M_a.ot", "M_b.ot", "-o", "o.ot", out="o.ot")
        rows.append(["OctoMap, merge", "", f"{bench.memory(octo):.0f}", *[""] * (len(bench.sizes) - 2)])
    if bench.exists("M_a.tif") and shutil.which("gdalwarp"):
        warp = Command("gdalwarp", "-q", "M_a.tif", "M_b.tif", "warped.tif", out="warped.tif")
        rows.append(["gdalwarp, merge", "", f"{bench.memory(warp):.0f}", *[""] * (len(bench.sizes) - 2)])
    page.section("Peak memory, MiB", *table(("work", *bench.sizes), rows))


def growth(bench, page, curves):
    """Cost for each cell from one size to the next: at most that of the smaller, with 10 % for noise."""
    rows = []
    for work in ("merge", "resample", "verify", "crop", "info"):
        of = [curves[work][size]["ours"] for size in bench.sizes]
        rows.append([work, *[show_time(s) for s in of], *[f"{b / a:.2f}" for a, b in zip(of, of[1:])]])
        flat = work in ("crop", "info")
        for (a, b), (small, large) in zip(zip(bench.sizes, bench.sizes[1:]), zip(of, of[1:])):
            # Of the crop the runs in turn are judged already.
            if work in ("verify", "crop") or (flat and a == "S"):
                continue
            cells = known(b) / known(a)
            if flat:
                page.at_most(f"cost of {work}, {a} -> {b}", f"that of {a}", large, small, 1.2, goal="flat (<= 1.2 x)")
            else:
                page.at_most(f"cost of {work} a cell, {a} -> {b}", f"that of {a}", large / known(b) * 1e6, small / known(a) * 1e6, 1.1,
                             show=lambda us: f"{us * 1000:.1f} ns", goal="linear (<= 1.1 x)", ratio=large / small / cells)
    steps = [f"{a} -> {b}" for a, b in zip(bench.sizes, bench.sizes[1:])]
    cells = [f"{known(b) / known(a):.0f} x the cells" for a, b in zip(bench.sizes, bench.sizes[1:])]
    page.section("What a larger map costs", *table(("work", *bench.sizes, *[f"{s} ({c})" for s, c in zip(steps, cells)]), rows), "",
                 "![Time over known cells](images/performance_sizes.svg)", "",
                 "*Time over known cells, both logarithmic; bold: ours.*")


def measure(bench, page, curves):
    verify(bench, page, curves)
    start(bench, page, curves)
    threads(bench, page)
    memories(bench, page)
    growth(bench, page, curves)
