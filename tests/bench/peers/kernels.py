"""Kernels on one core, work and peer in turn in one process: figures of fuse-bench and format-bench."""

import json
import os

from peers.data import PYTHON, Command
from peers.measure import median
from peers.page import table

PASSES = 3
NUMPY = os.path.join(os.path.dirname(os.path.abspath(__file__)), "numpy_dempster.py")
ABOUT = {
    "fuse-bench": [
        "`FuseLoad`: the paper's loads through the whole framework (maps in, fused map out) from cold caches: parking is two lidar",
        "grids of 246k cells, road two of 344k and a camera's of 88k. `Resample`: out of cache; memcpy moves as many bytes as are read",
        "and written. `Bandwidth`: the same beside reading its input, or a memset of its output. `View`: fused at one step from layers",
        "of two, beside resampling whole layers first. `Dempster`: two layers to one, beside a kernel that only adds, plane by plane or",
        "(cells) both planes at once."],
    "format-bench": ["On M, in memory: layers to stored layers, to a file, back, and all checksums."],
}


def passes_of(bench):
    return 1 if bench.runs == 1 else PASSES


def counters(bench, program):
    """By benchmark and peer the medians over passes of (work, peer, ratio) in microseconds; by benchmark million cells a second."""
    out = f"{program}.json"
    passes = []
    for i in range(passes_of(bench)):
        bench.say(f"{program}, pass {i + 1}")
        bench.run(Command(program, f"--benchmark_out={bench.path(out)}", "--benchmark_out_format=json", out=out))
        with open(bench.path(out), encoding="utf-8") as file:
            passes.append({b["name"].split("/iterations")[0].split("/manual_time")[0]: b for b in json.load(file)["benchmarks"]})
    found = {}
    for name, first in passes[0].items():
        for key in (k for k in first if k.endswith("_us") and k != "work_us"):
            peer = key[:-3]
            ratio = f"{peer}_ratio" if f"{peer}_ratio" in first else "ratio"
            found[name, peer] = tuple(median([p[name][k] for p in passes]) for k in ("work_us", key, ratio))
    bench.raw[program] = [f"{name} beside {peer}: {figures}" for (name, peer), figures in found.items()]
    rates = {name: median([p[name]["mcells_per_s"] for p in passes]) for name, first in passes[0].items() if "mcells_per_s" in first}
    return found, rates


def show(us):
    return f"{us / 1000:.3f} ms"


def section(bench, page, program, title):
    if not bench.has(program):
        page.skip(f"{title}: libbenchmark-dev was not there when the benchmarks were built")
        return {}, {}
    found, rates = counters(bench, program)
    rows = [(name, show(work), peer, show(other), f"{ratio:.2f}") for (name, peer), (work, other, ratio) in found.items()]
    page.section(title, f"Work and peer in turn in one loop, CPU time of one thread; medians, over {passes_of(bench)} passes.", *ABOUT[program], "",
                 *table(("benchmark", "work", "peer", "its time", "work / peer"), rows))
    return found, rates


def speed(page, work, against, figures, bound):
    """work >= bound x the peer's speed."""
    took, other, ratio = figures
    page.at_least(work, against, show(took), show(other), bound, 1 / ratio)


def judge_fuse(page, found):
    """Dempster's rule from the cells of S on, which no longer fit into the second cache; the own loop of the bench is none of ours."""
    for (name, peer), figures in found.items():
        if name.startswith("Dempster/library") and peer == "add":
            speed(page, f"kernel: Dempster, {layers_label(name)}, speed", "a kernel that only adds", figures, 0.95)
    for start, peer, bound, work in (("Bandwidth/merge", "read", 0.90, "merge 2x2"), ("Bandwidth/split", "memset", 0.85, "split 4")):
        of_kind = {name: figures for (name, p), figures in found.items() if name.startswith(start) and p == peer}
        for name, figures in of_kind.items():
            speed(page, f"kernel: {work}, {name.split('_')[-1]}, speed", f"{peer} of the same planes", figures, bound)
        if not of_kind:
            page.unmeasured(f"kernel: {work}, speed", peer, f">= {bound} x")


def layers_label(name):
    """Of a benchmark that walks through N layers of 128 x 128 cells."""
    return f"{int(name.split('/')[-1]) * 128**2 / 1e6:.2g} M cells"


def dempster_rates(bench, page, rates):
    rows = [(f"`{name.removeprefix('Dempster/')}`", f"{rate:.0f} M") for name, rate in rates.items()]
    try:
        lines = [line.split() for line in bench.run(Command(PYTHON, NUMPY, max(bench.runs, 3))).splitlines()]
        for name, cells, *seconds in lines:
            rows.append((f"numpy, {name.replace('_', ' ')}", f"{int(cells) / median([float(s) for s in seconds]) / 1e6:.0f} M"))
    except RuntimeError:
        page.skip("numpy's Dempster: python3-numpy is not there")
    page.section("Dempster's rule, cells a second, one core", *table(("", "cells a second"), rows), "",
                 "`library/N`: N layers of 128 x 128 cells, two to one; `scalar_loop`: the same cell by cell, as it is written first. The error",
                 "against long double is tested: at most 2e-7 at any conflict (`tests/fuse/dempster_test.cpp`).")


def measure(bench, page):
    found, rates = section(bench, page, "fuse-bench", "Fusion and resampling, one core")
    judge_fuse(page, found)
    dempster_rates(bench, page, rates)
    formats, _ = section(bench, page, "format-bench", "Encoding, decoding and verifying in memory, one core")
    verify = next((f for (name, peer), f in formats.items() if name.startswith("VerifyTown") and peer == "xxh3"), None)
    if verify:
        speed(page, "verify M in memory, speed", "XXH3-64 of the same bytes", verify, 0.5)
