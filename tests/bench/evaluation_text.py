"""What docs/evaluation.md says beside its figures; written by evaluate.py."""

HEAD = """# Evaluation: the paper's figures, measured again

Written by `tests/bench/evaluate.py` (release preset, `-DAPGM_BENCH=ON`); machine: AMD EPYC, 2 cores, Linux, shared with other work.
Values are floats of 4 bytes. "Values" counts what the paper counts; "allocated" every byte that is taken for it
([layouts.md](layouts.md)). Fill is the share of allocated cells that hold data. Ratios are means over time, theirs by ours.

| drive | what is real | how it is repeated |
|---|---|---|
| simulated | nothing: a town made after the paper's. How close houses stand, how many bays are taken and how far a beam without return clears **were chosen so that the map has about as many cells** as the paper's ([samples](../samples/README.md)). That its cell counts agree confirms nothing; that ratios follow from the counts does | `drive-map --stats S.csv --compare C.csv --every 5` |
| fr-clinic | scans and motion: a robot with one 180 degree laser on a campus, 4820 s. No camera. "Parking" and "road" are the paper's profiles by the clock (road from 1600 s to 3200 s) | `apgm-compare fr-clinic_robotlaser.clf.bz2 --profile P.yaml --every 60` |
| Boreas | the motion alone: 7.9 km by car. **All that the profile asks for is taken as seen**, so this is what a map costs at most. "Parking" where the car is slower than 15 km/h for 20 s | `apgm-compare POSES.txt --motion --profile P.yaml --every 10` |

The profiles are the paper's: parking {`occupancy`, 20 m, 0.1 m}; road {`occupancy`, 100 m, 0.2 m} and {`semantics`, 40 m, 0.2 m}. The fixed
layouts store 2 + 4 values a cell at all times. Sub-maps and the moving grid have the finest cells of the drive, 0.1 m. All are filled from the live
map, and those that move travel with the vehicle ([why and how](layouts.md)).
"""

FORMULA = """The paper's factors follow from its mean cells: `640k * 6 / (243k * 2)`, `640k * 6 / (345k * 2 + 88k * 4)`, `243k * 6 / (243k * 2)`,
`4 * 345k * 6 / (345k * 2 + 88k * 4)` (`memory_factor`, tested).

Where we differ, and why:

- **The road factor against sub-maps** comes out as 7.95 from the paper's own means; ">= 8.0" is that, rounded up.
- **Allocated** bytes hardly change a ratio: a patch of 16 to 128 KB outweighs its tree node. Buckets, nodes and headers are less than 1 % in every grid; an octree takes eleven times its values in nodes.
- **The gain rests on sparsity.** Where everything is seen (Boreas) a disc of 100 m at 0.2 m takes 917k cells, more than the reference has cells; in values
  the map is still below it, because it stores 2 values where the grid stores 6.
- **fr-clinic** has no camera. The fixed layouts keep their 4 values of semantics all the same. With cells of 2 values their ratios are a third of those here.
- **What a ratio does not say**: 640k cells of the non-uniform grid are coarser than the map's beyond 60 m and finer within 20 m on the road. The columns of changes and lost cells say what that costs.
"""

CHANGES = """A change of belief is |BetP before - BetP after| of a cell of the map that comes back from the layout: merged into coarser cells and split again. Lost cells lie
outside of the layout or are not stored (an octree stores no semantics); a lost obstacle had BetP(O) > 0.5 before and not after: merging keeps it, but its mass is spread over four or
more cells when they are split. All containers of sub-maps hold the same cells; their bytes differ by less than 0.1 %. The moving grid changes cells only at its border, where it holds parts of them.
Grids that move keep what the map dropped, until it leaves them: their fill counts it, changes of belief do not. GeoTIFF and NumPy lie on disk alone."""

RESAMPLING = """## The resampling figure

Merging 2 x 2 and 8 x 8 cells by the paper's operators and by Dempster's rule, on the Intel lab at 0.05 m: pictures and counts stand in [theory.md](theory.md), "Resampling"; `tests/bench/figures.sh BIN_DIR` draws
them. Of 16 637 occupied cells the merge of 8 x 8 loses none by `conditional` and 12 926 by `dempster`: as in the paper, where obstacles shrink and vanish. The paper's own picture
cannot be laid beside it: its data are not public.

## The columns of `--csv`

| column | says |
|---|---|
| `time_s`, `profile`, `x_m`, `y_m` | moment of the drive, profile that holds, place of the vehicle |
| `layout`, `values_per_cell` | `apgm` is the map itself, whose layers differ in values: empty |
| `cells`, `known_cells`, `fill` | allocated; with data; their share |
| `values_bytes`, `allocated_bytes`, `disk_bytes` | floats; all memory (of an octree `OcTree::memoryUsage`); a file with the encodings of `.apgm`, or of the format. Empty: not measured |
| `known_source_cells`, `lost_cells`, `mean_change`, `max_change`, `lost_obstacles` | cells of the map with data; changes of belief as above |
| `find_ns` to `snapshot_ns` | with `--cost` alone; 0: does not happen there. In a drive `shift_ns` is the mean of the shifts that were executed since the last row |
| `shifts` | how often a layout that moves did so since the last row |
| `note` | why figures are missing: a format that is not in the build, or that cannot hold the map |
"""
