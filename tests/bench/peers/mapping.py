"""A recorded drive through apgm-map, where the recording is there."""

import os

from peers.data import overwriting
from peers.measure import median
from peers.page import show_time, table

RECORDED_S = 4820


def measure(bench, page):
    data = os.environ.get("APGM_REAL_DATA", os.path.join(os.path.dirname(bench.root), "shared", "data"))
    log = os.path.join(data, "scans", "fr-clinic_robotlaser.clf.bz2")
    if not os.path.exists(log):
        page.skip("mapping: the recording fr-clinic was not in APGM_REAL_DATA")
        return
    link = bench.path("fr-clinic_robotlaser.clf.bz2")
    if not os.path.exists(link):
        os.symlink(log, link)
    command = [os.path.basename(link), "--resolution", "0.1", "-q"]
    free = overwriting("apgm-map", *command, out="clinic.apgm")
    bound = overwriting("apgm-map", *command, "--max-memory", "64M", out="clinic.apgm")
    rows = [(name, show_time(median(s)), f"{RECORDED_S / median(s):.0f} x", f"{bench.memory(job):.0f} MiB")
            for (name, job), s in zip((("`apgm-map`", free), ("`--max-memory 64M`", bound)), bench.in_turn(free, bound))]
    page.section("Mapping a log", "`fr-clinic` (Freiburg SLAM evaluation, CC BY 3.0): 6917 scans, 4820 s, to 0.1 m cells; one thread, unpacking and",
                 "writing included.", "", *table(("", "median", "beside real time", "peak memory"), rows))
