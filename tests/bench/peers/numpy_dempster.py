"""Dempster's rule as a user of numpy writes it: prints "NAME SECONDS...", for planes in and out of the caches."""

import sys
import time

import numpy as np


def dempster(o1, f1, o2, f2):
    u1, u2 = 1 - o1 - f1, 1 - o2 - f2
    keep = 1 - (o1 * f2 + f1 * o2)
    scale = np.divide(1, keep, out=np.zeros_like(keep), where=keep > 0)
    return (o1 * o2 + o1 * u2 + u1 * o2) * scale, (f1 * f2 + f1 * u2 + u1 * f2) * scale


def main():
    runs = int(sys.argv[1])
    random = np.random.default_rng(1)
    for name, cells in (("in_cache", 1 << 16), ("in_dram", 1 << 24)):
        free = random.random(cells, dtype=np.float32) / 2
        occupied = random.random(cells, dtype=np.float32) / 2
        seconds = []
        for _ in range(runs + 1):
            start = time.perf_counter()
            dempster(free, occupied, occupied, free)
            seconds.append(time.perf_counter() - start)
        print(name, cells, *seconds[1:])


main()
