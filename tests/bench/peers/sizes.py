"""File sizes, bytes for each known cell."""

from peers.data import PYTHON, Command, known, overwriting
from peers.page import table

OT = ".ot (one value a cell)"
BT = ".bt (two bits a cell: free, occupied or unknown)"
BOUND = 1 / 255  # what --lossy u8 promises of each mass
NPZ = "import numpy as np, sys; np.savez_compressed(sys.argv[2], cells=np.load(sys.argv[1])['occupancy'])"
ERROR = "import numpy as np, sys; a, b = (np.load(f)['occupancy'] for f in sys.argv[1:]); print(float(np.nanmax(np.abs(a - b))))"


# Of the noise that city.cpp puts into the continuous map, in bits for each known cell.
WALL = [
    "**The wall.** In the continuous map the first mass of a cell is uniform over 0.19: 21.7 bits as float32, 5.6 bits in steps of 1/255. One cell in",
    "four also holds a second mass, uniform over 0.28 on average: 24.4 and 6.1 bits. Which cells do: 0.8 bits. Which cells of the streets are known: 0.1",
    "bits. In sum 21.7 + 24.4 / 4 + 0.9 = 28.7 bits or **3.6 B lossless**, and 5.6 + 6.1 / 4 + 0.9 = 8.0 bits or **1.0 B in steps of 1/255**, before anything",
    "tells free from occupied. No encoding that keeps both masses gets below it; `.ot` and `.bt`, which do not keep them, do. LERC takes steps of twice",
    "the bound, 2/255 (wall 0.85 B); `u8` takes steps of the bound, so that the masses of a cell still sum to at most 1."]


def tiff(name, *options):
    return [f"GeoTIFF {name}", [o for option in options for o in ("-co", option)]]


COMPRESSIONS = {"ZSTD 1": ("COMPRESS=ZSTD", "ZSTD_LEVEL=1"), "ZSTD 9": ("COMPRESS=ZSTD", "ZSTD_LEVEL=9"),
                "DEFLATE 6": ("COMPRESS=DEFLATE", "ZLEVEL=6")}
PREDICTORS = {"no predictor": 1, "predictor 2": 2, "predictor 3": 3}
LOSSLESS = [tiff(f"{label}, {predictor}", *compression, f"PREDICTOR={number}")
            for label, compression in COMPRESSIONS.items() for predictor, number in PREDICTORS.items()]
LERC = ("LERC", "LERC_DEFLATE", "LERC_ZSTD")


def has_lerc(bench):
    return "LERC" in bench.run(Command("gdalinfo", "--format", "GTiff"))


def geotiffs(bench, page, model, errors):
    """Sizes by name, lossless and lossy at each of `errors` (name: bound); the smallest lossless one also with 0 in place of NaN."""
    if not bench.has("gdal_translate", "gdal-peer"):
        return {}, {}
    out = "size.tif"

    def size_of(name, options, interleave="BAND"):
        bench.say(f"size of M_{model}: {name}")
        bench.run(Command("gdal_translate", "-q", "-co", "TILED=YES", "-co", f"INTERLEAVE={interleave}", *options, f"M_{model}.tif", out, out=out))
        bench.run(Command("gdal-peer", "read", out, "--runs", 1))  # what cannot be read back does not count
        return bench.size(out)

    lossless = {name: size_of(name, options) for name, options in LOSSLESS}
    best, options = min(LOSSLESS, key=lambda o: lossless[o[0]])
    lossless[f"{best}, pixel by pixel"] = size_of(best, options, "PIXEL")
    pairs = [a for o in options if o != "-co" for a in ("--co", o)]
    bench.run(Command("gdal-peer", "write", f"M_{model}.tif", out, "--runs", 1, "--unknown", 0, *pairs, out=out))
    lossless[f"{best}, unknown as 0 in place of NaN"] = bench.size(out)
    if not has_lerc(bench):
        page.skip("GeoTIFF with LERC: this GDAL has none")
        return lossless, {}
    return lossless, {(name, label): size_of(*tiff(f"{name}, {label}", f"COMPRESS={name}", f"MAX_Z_ERROR={bound!r}"))
                      for label, bound in errors.items() for name in LERC}


def to_numpy(bench, name, out):
    bench.run(overwriting("apgm-convert", f"{name}.apgm", "--set", "compression=none", out=out, ok=(0, 3)))
    return out


def with_numpy(bench, page, model):
    """Size of the npz by name, and the largest error of --lossy u8; nothing and its bound without numpy."""
    bench.say(f"size of M_{model}: npz")
    plain, lossy = to_numpy(bench, f"M_{model}", "plain.npz"), to_numpy(bench, f"M_{model}_u8", "lossy.npz")
    try:
        bench.run(Command(PYTHON, "-c", NPZ, plain, "size.npz", out="size.npz"))
        error = float(bench.run(Command(PYTHON, "-c", ERROR, plain, lossy)))
    except RuntimeError:
        page.skip("npz: python3-numpy is not there")
        return {}, BOUND
    return {"npz (numpy.savez_compressed)": bench.size("size.npz")}, error


def others(bench, model):
    """OctoMap and OpenVDB: lossless, and the two bits of a .bt."""
    lossless, bits = {}, None
    tree = f"M_{model}.ot"
    if bench.has("octomap-peer"):
        lossless[OT] = bench.size(tree)
        bench.run(Command("octomap-peer", "write", tree, "size.bt", "--runs", 1, out="size.bt"))
        bits = bench.size("size.bt")
    if bench.has("vdb-peer"):
        lossless["OpenVDB, blosc"] = bench.size(f"M_{model}.vdb")
        bench.run(Command("vdb-peer", "write", f"M_{model}.vdb", "size.vdb", "--runs", 1, "--compress", "zip", out="size.vdb"))
        lossless["OpenVDB, zip"] = bench.size("size.vdb")
    return lossless, bits


def per_cell(size):
    return size / known("M")


def judge(page, work, ours, peers, bound, goal=None):
    """`peers`: what is held against, by name; the smallest counts."""
    if not any(peers.values()):
        page.unmeasured(work, ", ".join(peers), goal or f"<= {bound:g} x")
        return
    name = min(peers, key=peers.get)
    page.at_most(work, f"smallest: {name}" if len(peers) > 1 else name, per_cell(ours), per_cell(peers[name]), bound,
                 lambda value: f"{value:.2f} B", goal)


def of_model(bench, page, model, label):
    """Bytes by name for one sensor model, and its goals."""
    ours, ours_u8 = bench.size(f"M_{model}.apgm"), bench.size(f"M_{model}_u8.apgm")
    npz, error = with_numpy(bench, page, model)
    errors = {"error <= 1/255": BOUND, f"error <= {error:.5f}": error}
    lossless, lerc = geotiffs(bench, page, model, errors)
    other, bits = others(bench, model)
    judge(page, f"size, lossless, {label}", ours, lossless or {"GeoTIFF": 0}, 0.90)
    judge(page, f"size, lossless, {label}", ours, {OT: other.get(OT, 0)}, 0.45)
    for says, bound in zip(("as stated", "as measured"), errors):
        of_bound = {f"GeoTIFF {name}, {bound}, {says}": size for (name, b), size in lerc.items() if b == bound}
        judge(page, f"size, `--lossy u8`, {label}", ours_u8, of_bound or {f"LERC, {says}": 0}, 0.90)
    judge(page, f"size, `--lossy u8`, {label}", ours_u8, {BT: bits or 0}, 1, "< 1 x")
    sizes = {"**.apgm**": ours, **lossless, **npz, **other, "**.apgm `--lossy u8`**": ours_u8,
             **{f"GeoTIFF {name}, {bound}": size for (name, bound), size in lerc.items()}, BT: bits}
    return {name: size for name, size in sizes.items() if size}


def measure(bench, page):
    columns = [of_model(bench, page, "a", "continuous"), of_model(bench, page, "stepped", "stepped")]
    first = columns[0]
    names = list(first) + [name for name in columns[1] if name not in first]
    cell = lambda column, name: f"{per_cell(column[name]):.3f}" if name in column else ""
    rows = [(name, cell(first, name), f"{first[name] / 2**20:.1f}" if name in first else "", cell(columns[1], name)) for name in names]
    page.section("File size of M, bytes for each known cell", *table(("file", "continuous", "MiB", "stepped"), rows), "",
                 "Lossless but for the lines that say otherwise. `.apgm`, GeoTIFF, OpenVDB and npz hold both masses as float32; `.ot` one",
                 "log-odds as float32, `.bt` two bits. GeoTIFF in tiles of 256, band by band but where it is said (LERC with NaN cannot be read",
                 "back pixel by pixel), NaN where nothing is known; OpenVDB: the masses as two grids, one layer of voxels, values that are 0 not",
                 "active.", "", *WALL)
