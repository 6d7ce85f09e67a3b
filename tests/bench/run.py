#!/usr/bin/env python3
"""Times the main job beside OctoMap on the same maps, in one run, and writes docs/performance.md.

usage: tests/bench/run.py [--build DIR] [--work DIR] [--runs N] [-o FILE.md]

Every figure is a whole process: start to exit, files in the page cache. Compared commands run in turn (A B A B ...), the
ratio is the median of the ratios of pairs, so that a drifting machine does not matter.
"""

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time

BOX = "569950.05,5359950.05,570050.05,5360050.05"  # 100 m x 100 m across the corners of four quadrants


class Bench:
    def __init__(self, root, build, work, runs):
        self.root = root
        self.bin = os.path.join(build, "bin")
        self.work = work
        self.runs = runs

    def path(self, name):
        return os.path.join(self.work, name)

    def has(self, program):
        return os.access(os.path.join(self.bin, program), os.X_OK)

    def once(self, command):
        """Wall seconds and peak memory (MiB) of one run.

        Measured through GNU time: a child of this program would count this program's memory as its own until exec.
        """
        program = os.path.join(self.bin, command[0])
        figures = self.path("figures.txt")
        start = time.perf_counter()
        done = subprocess.run(["/usr/bin/time", "-f", "%M", "-o", figures, program, *command[1:]], cwd=self.work,
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        seconds = time.perf_counter() - start
        if done.returncode != 0:
            sys.exit(f"{' '.join(command)}: exit {done.returncode}\n{done.stderr}")
        with open(figures, encoding="utf-8") as file:
            return seconds, int(file.read()) / 1024

    def in_turn(self, *commands):
        """For each command its runs, taken in turn after one run each to warm up."""
        for command in commands:
            self.once(command)
        rounds = [[self.once(command) for command in commands] for _ in range(self.runs)]
        return list(zip(*rounds))


def median(values):
    return statistics.median(values)


def seconds(runs):
    return median([r[0] for r in runs])


def memory(runs):
    return max(r[1] for r in runs)


def ratio(a, b):
    return median([x[0] / y[0] for x, y in zip(a, b)])


def show(t):
    return f"{t * 1000:.1f} ms" if t < 0.1 else f"{t:.2f} s"


def make_maps(bench):
    for name, cells, overlap in (("a", "10e6", False), ("b", "10e6", True), ("A", "100e6", False), ("B", "100e6", True)):
        command = ["make-bench-maps", "--cells", cells, "--seed", "2" if overlap else "1", "-O", "-o", f"{name}_big.apgm" if name.isupper() else f"{name}.apgm"]
        if overlap:
            command += ["--overlap", "0.5"]
        if not name.isupper() and bench.has("octomap-merge"):
            command += ["--ot", f"{name}.ot"]
        print(" ".join(command), file=sys.stderr)
        bench.once(command)


def merge_command(a, b, out, threads=0):
    return ["apgm-merge", a, b, "-O", "-o", out, "-j", str(threads)]


def crop_command(source, out):
    return ["apgm-crop", source, "--bbox", BOX, "-O", "-o", out]


def merges(bench, lines):
    ours = merge_command("a.apgm", "b.apgm", "m.apgm")
    one = merge_command("a.apgm", "b.apgm", "m1.apgm", 1)
    lines += ["## Merge of two overlapping maps of 10 M known cells, file to file", "",
              "| | median | peak memory | beside `apgm-merge` |", "|---|---|---|---|"]
    if bench.has("octomap-merge"):
        m, m1, octo = bench.in_turn(ours, one, ["octomap-merge", "a.ot", "b.ot", "-o", "o.ot"])
    else:
        m, m1 = bench.in_turn(ours, one)
        octo = None
    lines.append(f"| `apgm-merge`, all cores | {show(seconds(m))} | {memory(m):.1f} MiB | 1 |")
    lines.append(f"| `apgm-merge -j1` | {show(seconds(m1))} | {memory(m1):.1f} MiB | {ratio(m1, m):.2f} |")
    if octo:
        lines.append(f"| OctoMap, one tree from two .ot | {show(seconds(octo))} | {memory(octo):.0f} MiB | {ratio(octo, m):.1f} |")
    else:
        lines.append("| OctoMap | not built here | | |")
    lines += ["", "OctoMap reads both trees, adds the log-odds of every leaf of the second to the first with lazy updates, one pass over",
              "the inner nodes, writes the tree: its fastest way. One layer of voxels, one value a cell; `.apgm` holds two masses a cell.", ""]


def crops(bench, lines):
    bench.once(merge_command("A_big.apgm", "B_big.apgm", "M_big.apgm"))
    small, large = bench.in_turn(crop_command("m.apgm", "c.apgm"), crop_command("M_big.apgm", "C_big.apgm"))
    lines += ["## Crop of 100 m x 100 m, whole process", "", "| out of | file | median | peak memory |", "|---|---|---|---|"]
    for name, runs, file in (("the merge above", small, "m.apgm"), ("one ten times larger", large, "M_big.apgm")):
        size = os.path.getsize(bench.path(file)) / 2**20
        lines.append(f"| {name} | {size:.0f} MiB | {show(seconds(runs))} | {memory(runs):.1f} MiB |")
    lines += ["", f"Ratio large to small, pair by pair: {ratio(large, small):.2f}.", ""]


def memories(bench, lines):
    lines += ["## Peak memory on a map ten times larger", "", "| work | 10 M cells | 100 M cells | ratio |", "|---|---|---|---|"]
    half = ["--bbox", "569950.05,0,1e6,6e6", "-O", "-o"]
    jobs = (("merge", merge_command("a.apgm", "b.apgm", "m.apgm"), merge_command("A_big.apgm", "B_big.apgm", "M_big.apgm")),
            ("merge -j1", merge_command("a.apgm", "b.apgm", "m.apgm", 1), merge_command("A_big.apgm", "B_big.apgm", "M_big.apgm", 1)),
            ("crop of half the map", ["apgm-crop", "a.apgm", *half, "h.apgm"], ["apgm-crop", "A_big.apgm", *half, "H_big.apgm"]))
    for name, small, large in jobs:
        s, l = bench.in_turn(small, large)
        a, b = median([r[1] for r in s]), median([r[1] for r in l])
        lines.append(f"| {name} | {a:.1f} MiB | {b:.1f} MiB | {b / a:.2f} |")
    lines.append("")


def kernels(bench, lines):
    """Benchmarks within one process, work and memcpy in turn; names and counters as fuse_bench.cpp gives them."""
    if not bench.has("fuse-bench"):
        return
    out = bench.path("kernels.json")
    passes = []
    for _ in range(3):
        subprocess.run([os.path.join(bench.bin, "fuse-bench"), "--benchmark_filter=FuseLoad|Resample|Dempster",
                        f"--benchmark_out={out}", "--benchmark_out_format=json"], check=True, stdout=subprocess.DEVNULL)
        with open(out, encoding="utf-8") as file:
            passes.append({b["name"].split("/iterations")[0]: b for b in json.load(file)["benchmarks"]})
    lines += ["## Fusion and resampling beside memcpy, one core", "",
              "Medians of three passes; work and peer in turn in one loop. `FuseLoad`: the paper's loads through the whole framework (maps in,",
              "fused map out) from cold caches, beside a memcpy of all input bytes: parking is two lidar grids of 246k cells, road two of",
              "344k and a camera's of 88k. `Resample`: out of cache, beside a memcpy that moves as many bytes as are read and written.",
              "`Dempster`: the two-input kernel beside one that adds.", "",
              "| benchmark | work | peer | ratio |", "|---|---|---|---|"]
    for name in passes[0]:
        runs = [p[name] for p in passes]
        peer = next(k for k in runs[0] if k.endswith("_us") and k != "work_us")
        work, other, times = (median([r[k] for r in runs]) for k in ("work_us", peer, "ratio"))
        lines.append(f"| {name.split('/manual_time')[0]} | {work / 1000:.3f} ms | {other / 1000:.3f} ms | {times:.2f} |")
    lines.append("")


def mapping(bench, lines):
    """Real recordings, where they are."""
    data = os.environ.get("APGM_REAL_DATA", os.path.join(os.path.dirname(bench.root), "shared", "data"))
    log = os.path.join(data, "scans", "fr-clinic_robotlaser.clf.bz2")
    if not os.path.exists(log):
        lines += ["## Mapping", "", "The recording fr-clinic was not there.", ""]
        return
    command = ["apgm-map", log, "--resolution", "0.1", "-q", "-O", "-o", "clinic.apgm"]
    free, bound = bench.in_turn(command, [*command, "--max-memory", "64M"])
    lines += ["## Mapping a log", "", "`fr-clinic` (Freiburg SLAM evaluation, CC BY 3.0): 6917 scans, 4820 s, to 0.1 m cells; one thread, unpacking and writing included.", "",
              "| | median | beside real time | peak memory |", "|---|---|---|---|"]
    for name, runs in (("`apgm-map`", free), ("`--max-memory 64M`", bound)):
        lines.append(f"| {name} | {show(seconds(runs))} | {4820 / seconds(runs):.0f} x | {memory(runs):.0f} MiB |")
    lines.append("")


def machine():
    model = next((l.split(":")[1].strip() for l in open("/proc/cpuinfo") if l.startswith("model name")), platform.machine())
    return f"{model}, {os.cpu_count()} cores, Linux"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    parser.add_argument("--build", default=os.path.join(root, "build", "release"))
    parser.add_argument("--work", help="directory for the maps, kept (default: a temporary one; 4 GiB)")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("-o", "--output", default=os.path.join(root, "docs", "performance.md"))
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        bench = Bench(root, args.build, os.path.abspath(args.work or temporary), args.runs)
        os.makedirs(bench.work, exist_ok=True)
        make_maps(bench)
        lines = ["# Performance", "", "Written by `tests/bench/run.py` (release preset, `-DAPGM_BENCH=ON`). Whole processes, page cache warm,",
                 f"medians of {args.runs} runs taken in turn; ratios are medians over pairs. Machine: {machine()}.",
                 "The maps are made by `make-bench-maps`: city blocks, 0.1 m cells, masses with noise in every bit.", ""]
        merges(bench, lines)
        crops(bench, lines)
        memories(bench, lines)
        kernels(bench, lines)
        mapping(bench, lines)
    with open(args.output, "w", encoding="utf-8") as out:
        out.write("\n".join(lines).rstrip() + "\n")
    print(f"wrote {args.output}", file=sys.stderr)


if __name__ == "__main__":
    main()
