"""What stands behind the goals that are missed: written after profiles and trials, not by a run."""

TEXT = """## Why goals are missed

The ratios were set from other runs, in which the peers were slower: gdalwarp took 6.3 s for what takes 2 s here, with 25 % of the memory as its
cache, all threads and ZSTD 1; OctoMap 10.5 s in place of 5.7 s. They are kept as they are. What is left between us and them, as far as
profiles and trials tell:

- **Sizes of the continuous map**: the noise of the masses, derived below under "The wall".
- **Merge, resample, write**: 33 to 49 % is zstd on planes that hardly get smaller, 12 to 41 % the kernel copying files from and into the page cache.
  Level 1 is not faster than level 3 on these planes.
- **Read**: a third zstd, a quarter the kernel; the rest is putting values into planes, and the checks. Each layer is hashed twice, as stored and as cells.
- **Crop**: 2 ms are start and end of a process. Some 20 patches at the border are decoded, cut and packed again, 40 are copied. 44 % is
  the kernel: 1430 page faults (930 on one thread, 220 of them the start), the new file, mapping libraries.
- **Two threads**: 1.6 to 1.8. Reading, writing and page faults share locks and memory, and the two cores share their caches.
- **Verify beside hashing in memory**: the bytes must come out of the page cache first. Beside reading and hashing it is as fast as that, since
  pieces are hashed where they are still in the cache.
- **Dempster at 0.25 M and 0.5 M cells**: the data come from the last-level cache faster than the rule can be computed. The loop has 38 vector
  operations for 16 cells, 18 of them in the two units that add; without its divisions, in a trial, it took 20 cycles in place of 23. An addition
  takes 15 to 19, bound by the cache. From 1 M cells on memory bounds both.
- **Merge 2x2 and split 4**: a plain store first fetches the line it overwrites, so that a merge moves 1.5 and a split 2.25 times the bytes that
  are counted. Stores past the cache reach 0.85 to 0.97 of memset, in a trial: see design/0009-speed.md for why they are left out.
"""
