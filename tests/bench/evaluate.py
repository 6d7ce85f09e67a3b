#!/usr/bin/env python3
"""Measures the paper's evaluation again and writes docs/evaluation.md and its pictures.

    tests/bench/evaluate.py BIN_DIR

BIN_DIR holds drive-map, apgm-compare and fuse-bench (release preset, -DAPGM_BENCH=ON; without fuse-bench its section says
so). Real recordings come from APGM_REAL_DATA (default ../shared/data); what is missing is left out, with a line.
Takes some ten minutes.
"""

import csv
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile

from evaluation_text import CHANGES, FORMULA, HEAD, RESAMPLING

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
DATA = os.environ.get("APGM_REAL_DATA", os.path.join(ROOT, "..", "shared", "data"))
IMAGES = os.path.join(ROOT, "docs", "images")
REFERENCE_CELLS = 640_000  # of the non-uniform grid, in the setting the paper compares with
PAPER = {"parking": (243_000, 0), "road": (345_000, 88_000)}  # mean cells: occupancy, semantics
PAPER_FACTORS = {
    ("buerkle-A", "parking"): "7.9",
    ("buerkle-A", "road"): "3.7",
    ("submaps-sorted_vector", "parking"): ">= 3.0",
    ("submaps-sorted_vector", "road"): ">= 8.0",
}
SHOWN = ["apgm", "buerkle-A", "buerkle-B", "buerkle-C", "moving", "submaps-sorted_vector", "octomap-ot", "octomap-bt", "geotiff",
         "numpy"]
TRAVELLING = ["buerkle-A", "buerkle-B", "buerkle-C", "moving"]
PROFILES = {
    "parking": ["{layer: occupancy, horizon_m: 20, cell_m: 0.1}"],
    "road": ["{layer: occupancy, horizon_m: 100, cell_m: 0.2}", "{layer: semantics, horizon_m: 40, cell_m: 0.2}"],
}


def run(*command):
    print("+", " ".join(command), flush=True)
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def write_schedule(path, entries):
    with open(path, "w") as file:
        file.write("profiles:\n")
        for name, from_s in entries:
            file.write(f"  - name: {name}\n    from_s: {from_s}\n    requirements:\n")
            file.writelines(f"      - {r}\n" for r in PROFILES[name])


class Comparison:
    """The rows of apgm-compare, means by profile and layout over the moments that have a figure."""

    KEYS = ("cells", "known_cells", "values_bytes", "allocated_bytes", "disk_bytes", "known_source_cells", "lost_cells",
            "lost_obstacles")

    def __init__(self, path):
        self.sums = {}
        with open(path, newline="") as file:
            for row in csv.DictReader(file):
                sums = self.sums.setdefault((row["layout"], row["profile"]), dict.fromkeys(self.KEYS, 0.0)
                                            | {"max_change": 0.0, "change": 0.0, "shifts": 0, "shift_ns": 0.0, "counts": {}})
                for key in self.KEYS:
                    if row[key]:
                        sums[key] += float(row[key])
                        sums["counts"][key] = sums["counts"].get(key, 0) + 1
                kept = float(row["known_source_cells"] or 0) - float(row["lost_cells"] or 0)
                sums["change"] += kept * float(row["mean_change"] or 0)
                sums["max_change"] = max(sums["max_change"], float(row["max_change"] or 0))
                if row["shift_ns"] and int(row["shifts"]) > 0:
                    sums["shifts"] += int(row["shifts"])
                    sums["shift_ns"] += int(row["shifts"]) * float(row["shift_ns"])

    def profiles(self):
        return [p for p in PROFILES if ("apgm", p) in self.sums]

    def has(self, layout, profile, key):
        return (layout, profile) in self.sums and key in self.sums[layout, profile]["counts"]

    def mean(self, layout, profile, key):
        sums = self.sums[layout, profile]
        return sums[key] / sums["counts"][key]

    def fill(self, layout, profile):
        return self.mean(layout, profile, "known_cells") / self.mean(layout, profile, "cells")

    def ratio(self, layout, profile, key):
        return self.mean(layout, profile, key) / self.mean("apgm", profile, key)

    def layers(self, profile):
        """Cells of occupancy (2 values) and semantics (4 values)."""
        cells, values = self.mean("apgm", profile, "cells"), self.mean("apgm", profile, "values_bytes") / 4
        semantics = (values - 2 * cells) / 2
        return cells - semantics, semantics

    def change(self, layout, profile):
        sums = self.sums[layout, profile]
        return sums["change"] / max(1.0, sums["known_source_cells"] - sums["lost_cells"])


def thousands(n):
    return f"{n:,.0f}".replace(",", " ")


def simulated_drive(bin_dir, work):
    stats, table = os.path.join(work, "stats.csv"), os.path.join(work, "drive.csv")
    run(os.path.join(bin_dir, "drive-map"), "--stats", stats, "--compare", table, "--every", "5", "--cost", "-O", "--plot",
        os.path.join(IMAGES, "compare_drive.svg"))
    with open(stats, newline="") as file:
        return list(csv.DictReader(file)), Comparison(table)


def clinic(bin_dir, work):
    log = os.path.join(DATA, "scans", "fr-clinic_robotlaser.clf.bz2")
    if not os.path.exists(log):
        return None
    profile, table = os.path.join(work, "clinic.yaml"), os.path.join(work, "clinic.csv")
    write_schedule(profile, [("parking", 0), ("road", 1600), ("parking", 3200)])
    run(os.path.join(bin_dir, "apgm-compare"), log, "--profile", profile, "--every", "60", "--cost", "--csv", table, "-O",
        "--plot",
        os.path.join(IMAGES, "compare_clinic.svg"))
    return Comparison(table)


def speed_schedule(times, speeds):
    """Parking where the car is slower than 15 km/h for 20 s or longer, as the paper's is; else road."""
    entries, since = [("road", 0.0)], None
    for time, speed in zip(times + [times[-1]], speeds + [99.0]):
        if speed <= 15 / 3.6:
            since = time if since is None else since
            continue
        if since is not None and time - since >= 20:
            if entries[-1][1] == since:
                entries.pop()
            entries += [("parking", since), ("road", time)]
        since = None
    return [e for e in entries if e[1] < times[-1]]


def motion(bin_dir, work):
    source = os.path.join(DATA, "poses", "boreas-2021-08-05-13-34.lidar_poses.csv")
    if not os.path.exists(source):
        return None
    with open(source, newline="") as file:
        rows = list(csv.DictReader(file))
    first = int(rows[0]["GPSTime"])
    times = [(int(r["GPSTime"]) - first) / 1e6 for r in rows]
    speeds = [math.hypot(float(r["vel_east"]), float(r["vel_north"])) for r in rows]
    poses, profile, table = (os.path.join(work, n) for n in ("boreas.txt", "boreas.yaml", "boreas.csv"))
    with open(poses, "w") as file:
        for time, r in zip(times, rows):
            file.write(f"{time:.6f} {r['easting']} {r['northing']} {r['altitude']} 0 0 0 1\n")
    write_schedule(profile, speed_schedule(times, speeds))
    run(os.path.join(bin_dir, "apgm-compare"), poses, "--motion", "--profile", profile, "--every", "10", "--csv", table, "-O",
        "--plot", os.path.join(IMAGES, "compare_boreas.svg"))
    return Comparison(table)


def one_map(bin_dir, work):
    path = os.path.join(work, "road.apgm")
    run(os.path.join(bin_dir, "drive-map"), "--from", "215", "--seconds", "35", "-o", path)
    runs = [json.loads(run(os.path.join(bin_dir, "apgm-compare"), path, "--cost", "--json", "-O", "--plot",
                           os.path.join(IMAGES, "compare_map.svg")))["layouts"] for _ in range(9)]
    for i, layout in enumerate(runs[0]):
        for key in layout.get("cost", {}):
            layout["cost"][key] = statistics.median(r[i]["cost"][key] for r in runs)
    return runs[0]


def fusion(bin_dir):
    bench = os.path.join(bin_dir, "fuse-bench")
    if not os.path.exists(bench):
        return None
    out = json.loads(run(bench, "--benchmark_filter=FuseLoad", "--benchmark_format=json"))
    return {b["name"].split("/")[1]: b["work_us"] / 1e3 for b in out["benchmarks"]}


# The page.


def cells_section(stats, sources):
    lines = ["## Cells over time", "", "![Cells of the live map over time](images/drive_cells.svg)", "",
             "| mean cells | the paper | " + " | ".join(name for name, _ in sources) + " |",
             "|---|---|" + "---|" * len(sources)]
    for profile, layer, index in (("parking", "occupancy", 0), ("road", "occupancy", 0), ("road", "semantics", 1)):
        cells = [c.layers(profile)[index] if profile in c.profiles() else 0 for _, c in sources]
        lines.append(f"| {profile}, `{layer}` | {thousands(PAPER[profile][index])} | "
                     + " | ".join(thousands(n) if n > 0 else "-" for n in cells) + " |")
    for profile in PROFILES:
        fills = [f"{100 * c.fill('apgm', profile):.0f} %" if profile in c.profiles() else "-" for _, c in sources]
        lines.append(f"| {profile}, share with data | not told | " + " | ".join(fills) + " |")
    values = [2 * int(r["occupancy_cells"]) + 4 * int(r["semantics_cells"]) for r in stats]
    most, at = max(values), stats[values.index(max(values))]["time_s"]
    reference = 6 * REFERENCE_CELLS
    below = sum(v < reference for v in values)
    cells = max(max(int(r["occupancy_cells"]), int(r["semantics_cells"])) for r in stats)
    lines += ["", f"Simulated drive, all {len(stats)} steps: the map stays below the reference ({thousands(reference)} values) at "
              f"{below} of them. Its most are {thousands(most)} values ({100 * most / reference:.0f} %), at {at} s, and "
              f"{thousands(cells)} cells in one layer.", ""]
    return lines


def factors_section(sources):
    occ = {p: PAPER[p][0] for p in PAPER}
    own = {p: 2 * PAPER[p][0] + 4 * PAPER[p][1] for p in PAPER}
    formula = {("buerkle-A", p): 6 * REFERENCE_CELLS / own[p] for p in PAPER}
    formula["submaps-sorted_vector", "parking"] = 6 * occ["parking"] / own["parking"]
    formula["submaps-sorted_vector", "road"] = 4 * 6 * occ["road"] / own["road"]
    heads = [f"{name}: {kind}" for name, _ in sources for kind in ("values", "allocated", "fill, ours / theirs")]
    lines = ["## Memory factors", "", "| | the paper | formula on its cells | " + " | ".join(heads) + " |",
             "|---|---|---|" + "---|" * len(heads)]
    names = {"buerkle-A": "non-uniform grid (Buerkle)", "submaps-sorted_vector": "sub-maps (Wellhausen)"}
    for layout, profile in PAPER_FACTORS:
        row = [f"{names[layout]}, {profile}", PAPER_FACTORS[layout, profile], f"{formula[layout, profile]:.2f}"]
        for _, c in sources:
            if profile not in c.profiles():
                row += ["-"] * 3
                continue
            row += [f"{c.ratio(layout, profile, 'values_bytes'):.2f}", f"{c.ratio(layout, profile, 'allocated_bytes'):.2f}",
                    f"{100 * c.fill('apgm', profile):.0f} / {100 * c.fill(layout, profile):.0f} %"]
        lines.append("| " + " | ".join(row) + " |")
    return lines + [""]


def layouts_section(title, image, caption, comparison, note):
    lines = [f"## {title}", "", f"![{caption}](images/{image})", "", f"*{caption}*", "", note, "",
             "| | layout | cells | fill | values [MB] | x | allocated [MB] | x | on disk [KB] | x | lost cells | mean change | "
             "greatest | lost obstacles |", "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"]
    for profile in comparison.profiles():
        for layout in SHOWN:
            has = lambda key: comparison.has(layout, profile, key)
            mean = lambda key: comparison.mean(layout, profile, key)
            ratio = lambda key: comparison.ratio(layout, profile, key)
            if not has("cells") and not has("disk_bytes"):
                continue
            row = ["-"] * 12
            if has("cells"):
                row[:6] = [thousands(mean("cells")), f"{100 * comparison.fill(layout, profile):.0f} %",
                           f"{mean('values_bytes') / 1e6:.2f}", f"{ratio('values_bytes'):.2f}",
                           f"{mean('allocated_bytes') / 1e6:.2f}", f"{ratio('allocated_bytes'):.2f}"]
            if has("disk_bytes"):
                row[6:8] = [f"{mean('disk_bytes') / 1e3:.0f}", f"{ratio('disk_bytes'):.2f}"]
            if has("lost_cells"):
                row[8:] = [f"{100 * mean('lost_cells') / max(1.0, mean('known_source_cells')):.1f} %",
                           f"{comparison.change(layout, profile):.4f}", f"{comparison.sums[layout, profile]['max_change']:.2f}",
                           f"{mean('lost_obstacles'):.0f}"]
            lines.append(f"| {profile} | {layout} | " + " | ".join(row) + " |")
    return lines + [""]


def moves_section(sources):
    lines = ["## Moves", "", "Layouts that move travel through the drive: after each scan they shift by whole cells of their coarsest size, what "
             "changes its cell size is resampled, and what enters is filled from the map. The table shows the shifts that were really "
             "executed, without that filling, and their mean time; the lower parts of the pictures above show it over time. Sub-maps and "
             "the map itself only drop what the vehicle leaves.", "",
             "| layout | " + " | ".join(f"{name}, {p}: shifts | time" for name, c in sources for p in c.profiles()) + " |",
             "|---|" + "---|---|" * sum(len(c.profiles()) for _, c in sources)]
    for layout in TRAVELLING:
        row = [layout]
        for _, c in sources:
            for p in c.profiles():
                sums = c.sums[layout, p]
                row += [thousands(sums["shifts"]), time_text(sums["shift_ns"] / sums["shifts"])] if sums["shifts"] else ["-", "-"]
        lines.append("| " + " | ".join(row) + " |")
    return lines + [""]


def disk_text(sources):
    """What is left of the ratios on disk, in the figures of this run."""
    def span(layouts, profile):
        ratios = [c.ratio(l, profile, "disk_bytes") for _, c in sources for l in layouts if c.has(l, profile, "disk_bytes")]
        return f"{min(ratios):.2f} to {max(ratios):.2f}" if ratios else "-"
    return ("- **On disk little is left of the ratios.** Cells without data compress to nothing. Times the map's bytes: sub-maps "
            f"{span(['submaps-sorted_vector'], 'parking')} (parking, cells of one size) and {span(['submaps-sorted_vector'], 'road')} (road, "
            f"cells half as wide), non-uniform grids {span(TRAVELLING[:3], 'parking')} and {span(TRAVELLING[:3], 'road')}, the moving grid "
            f"{span(['moving'], 'parking')} and {span(['moving'], 'road')}. Far cells of the non-uniform grids are coarser and hold less: see the "
            "changes of belief. On the other hand grids that move keep what the map dropped, until it leaves them.\n"
            f"- **Other formats.** GeoTIFF (ZSTD, all cells of the finest size) takes {span(['geotiff'], 'parking')} and "
            f"{span(['geotiff'], 'road')} times the map's bytes, NumPy (deflate, each layer its own size) {span(['numpy'], 'parking')} and "
            f"{span(['numpy'], 'road')}; neither changes a belief. An octree holds occupancy alone, and of it BetP: .ot "
            f"{span(['octomap-ot'], 'parking')} and {span(['octomap-ot'], 'road')} times, .bt, which keeps only free or occupied, "
            f"{span(['octomap-bt'], 'parking')} and {span(['octomap-bt'], 'road')} times. Its memory counts all nodes of a tree whose leaves "
            "are voxels of one height.\n")


def time_text(ns):
    if ns <= 0:
        return "-"
    if ns < 0.5:
        return "< 0.5 ns"
    return f"{ns:.0f} ns" if ns < 1e3 else f"{ns / 1e3:.1f} us" if ns < 1e6 else f"{ns / 1e6:.2f} ms"


def cost_section(layouts):
    caption = "One map by layout: bytes of values, all that is allocated, and bytes on disk"
    lines = ["## Accesses", "", f"![{caption}](images/compare_map.svg)", "", f"*{caption}*", "",
             "The live map of the simulated drive after 250 s, on the road, one thread. A find in the map itself reads a value of "
             "every layer at the place; to shift it means to drop what the vehicle leaves, which is the upkeep of the next section. "
             "Medians of 9 runs.", "",
             "| layout | cells | filled | allocated [bytes] | find | insert | new sub-map | shift by 0.5 m | read a cell | snapshot |",
             "|---|---|---|---|---|---|---|---|---|---|"]
    for one in layouts:
        cost = one.get("cost")
        if cost is None:
            continue
        lines.append(f"| {one['layout']} | {thousands(one['cells'])} | {100 * one['fill']:.0f} % | {thousands(one['allocated_bytes'])} | "
                     + " | ".join(time_text(cost[k + "_ns"]) for k in ("find", "insert", "grow", "shift", "iterate", "snapshot")) + " |")
    return lines + [""]


def fusion_section(stats, bench):
    lines = ["## Fusion times", ""]
    if bench is None:
        lines += ["`fuse-bench` was not there.", ""]
    else:
        lines += ["| load | the paper, 8 threads | maps in, new map out | into recycled memory | into the first map |",
                  "|---|---|---|---|---|"]
        for load, paper in (("parking", "1.8 ms"), ("road", "2.6 ms")):
            lines.append(f"| {load} | {paper} | " + " | ".join(
                f"{bench[load + '_' + kind]:.2f} ms" for kind in ("fresh", "recycled", "in_place")) + " |")
        lines += ["", "Ours: one thread, cold caches, random masses, as many cells as the paper's means in each of two lidar maps and a "
                  "camera map. The paper does not tell what its time covers; its processor (Threadripper 3970X) is another one.", ""]
    lines += ["| live drive, mean a step | measure (sensor models) | fuse | upkeep (ageing, resampling, dropping) |", "|---|---|---|---|"]
    for profile in PROFILES:
        rows = [r for r in stats if r["profile"] == profile]
        mean = lambda kind: sum(float(r[f"{l}_{kind}_ms"]) for r in rows for l in ("occupancy", "semantics")) / len(rows)
        lines.append(f"| {profile} | {mean('observe'):.2f} ms | {mean('fuse'):.2f} ms | {mean('upkeep'):.2f} ms |")
    return lines + ["", "A step fuses two lidar scans and on the road a camera image into the map, one thread; only rows that a scan touches "
                    "are combined.", ""]


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    bin_dir = sys.argv[1]
    with tempfile.TemporaryDirectory() as work:
        stats, drive = simulated_drive(bin_dir, work)
        robot, car = clinic(bin_dir, work), motion(bin_dir, work)
        layouts, bench = one_map(bin_dir, work), fusion(bin_dir)
    sources = [("simulated", drive)] + [(n, c) for n, c in (("fr-clinic", robot), ("Boreas", car)) if c]
    page = [HEAD]
    page += [f"{name} was not there.\n" for name, c in (("fr-clinic", robot), ("Boreas", car)) if c is None]
    page += cells_section(stats, sources) + factors_section(sources) + [FORMULA + disk_text(sources)]
    over_time = "Values of each layout over time, and mean time of a shift, on {}; logarithmic"
    page += layouts_section("The simulated drive by layout", "compare_drive.svg", over_time.format("the simulated drive"), drive, CHANGES)
    if robot:
        page += layouts_section("fr-clinic by layout", "compare_clinic.svg", over_time.format("fr-clinic"), robot,
                                "Real scans; `occupancy` alone.")
    if car:
        page += layouts_section("Boreas by layout", "compare_boreas.svg", "Values of each layout over time on Boreas; logarithmic", car,
                                "Motion alone: all is seen, and free. Equal cells compress to nothing and no belief differs from its "
                                "neighbours': files and changes would say nothing and are not measured ('-').")
    page += moves_section([s for s in sources if s[1] is not car])
    page += cost_section(layouts) + fusion_section(stats, bench) + [RESAMPLING.rstrip()]
    with open(os.path.join(ROOT, "docs", "evaluation.md"), "w") as file:
        file.write("\n".join(page) + "\n")


if __name__ == "__main__":
    main()
