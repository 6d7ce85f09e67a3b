#!/usr/bin/env python3
"""Measures the tools beside what a user would pick instead, on the same maps and in one run, and writes docs/performance.md.

usage: tests/bench/run.py [--build DIR] [--work DIR] [--runs N] [--quick] [--only NAME]... [-o FILE.md]

Compared commands run in turn (A B A B ...). Peers that are missing are left out with a line. Takes half an hour and 8 GiB of disk;
--quick leaves out the largest map and runs everything once. Raw figures are kept in figures.json in --work.
"""

import argparse
import collections
import os
import platform
import re
import sys
import tempfile

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from peers import data, inout, jobs, kernels, limits, mapping, plot, profile, sizes, tools  # noqa: E402
from peers.data import Command  # noqa: E402
from peers.measure import Bench  # noqa: E402
from peers.page import Page  # noqa: E402

TOOLS = {"merge": "apgm-merge", "crop": "apgm-crop", "resample": "apgm-resample", "verify": "apgm-verify", "info": "apgm-info"}


def machine():
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        model = next((line.split(":")[1].strip() for line in file if line.startswith("model name")), platform.machine())
    pages, page_bytes = os.sysconf("SC_PHYS_PAGES"), os.sysconf("SC_PAGE_SIZE")
    return f"{model}, {os.cpu_count()} cores, {pages * page_bytes / 2**30:.0f} GiB, Linux"


def versions(bench):
    """What is compared, each with its version as far as it tells."""
    found = [bench.run(Command("apgm-info", "--version")).strip().replace("apgm-info", "libapgm")]
    if bench.has("gdalinfo"):
        found.append(re.split("[,]", bench.run(Command("gdalinfo", "--version")))[0])
    packages = {"OctoMap": ("liboctomap-dev", "octomap-peer"), "OpenVDB": ("libopenvdb-dev", "vdb-peer"), "numpy": ("python3-numpy", "dpkg-query")}
    for name, (package, program) in packages.items():
        if not bench.has(program, "dpkg-query"):
            continue
        try:
            version = bench.run(Command("dpkg-query", "-W", "-f", "${Version}", package)).strip()
        except RuntimeError:
            continue
        found.append(f"{name} {re.split('[+-]', version.split(':')[-1])[0]}")
    return ", ".join(found)


def head(bench):
    cells = ", ".join(f"{size} {float(data.CELLS[size]) / 1e6:g} M" for size in bench.sizes)
    runs = f"medians of {bench.runs} runs" if bench.runs > 1 else "single runs"
    return ["# Performance", "",
            "Written by `tests/bench/run.py` (release preset, `-DAPGM_BENCH=ON`), everything in one run; do not edit. Page cache warm,",
            f"{runs} taken in turn after one to warm up; what takes long on L runs once or twice, without.", "",
            f"- Machine: {machine()}.", f"- Versions: {versions(bench)}.",
            f"- Maps: `make-bench-maps`, a town in 0.1 m cells: {cells} known cells, two masses each (free, occupied). *continuous*: noise in every",
            "  bit of the mantissa; *stepped*: few distinct values, as counters leave them. Times are of the continuous one.",
            "- Whole process: from before it is started until it is gone. Outputs go to new files.", ""]


def measure(bench, page, only):
    curves = collections.defaultdict(dict)
    data.make_all(bench, page)
    sections = {"sizes": lambda: sizes.measure(bench, page), "inout": lambda: inout.measure(bench, page),
                "jobs": lambda: jobs.measure(bench, page, curves), "tools": lambda: tools.measure(bench, page, curves),
                "kernels": lambda: kernels.measure(bench, page), "profile": lambda: profile.measure(bench, page),
                "mapping": lambda: mapping.measure(bench, page)}
    for name, section in sections.items():
        if not only or name in only:
            section()
    return curves


def replace(path, text):
    """The file appears whole."""
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path + ".part", "w", encoding="utf-8") as out:
        out.write(text)
    os.replace(path + ".part", path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    parser.add_argument("--build", default=os.path.join(root, "build", "release"))
    parser.add_argument("--work", help="directory for the maps and figures.json, kept (default: a temporary one; 8 GiB)")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="without the largest map, everything once")
    parser.add_argument("--only", action="append", help="sizes, inout, jobs, tools (needs jobs), kernels, profile or mapping (repeatable)")
    parser.add_argument("-o", "--output", default=os.path.join(root, "docs", "performance.md"))
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        bench = Bench(root, os.path.abspath(args.build), os.path.abspath(args.work or temporary), 1 if args.quick else args.runs,
                      "SM" if args.quick else "SML")
        output = os.path.abspath(args.output)
        os.makedirs(bench.work, exist_ok=True)
        os.chdir(bench.work)
        page = Page()
        try:
            curves = measure(bench, page, args.only)
        finally:
            bench.save(page.figures())
        if curves:
            replace(os.path.join(os.path.dirname(output), "images", "performance_sizes.svg"), plot.sizes_svg(curves, TOOLS))
        replace(output, page.text(head(bench), limits.TEXT.splitlines()))
        bench.say(f"wrote {output}")
        os.chdir(root)  # a directory that is removed must not be the current one


if __name__ == "__main__":
    main()
