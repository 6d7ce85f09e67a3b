"""Where the time goes: functions by share of the samples."""

import collections
import re
import shutil

from peers.data import Command
from peers.jobs import crop, merge, resample
from peers.page import table

MOST = 8
LEAST = 0.01  # share


def works(bench):
    """Long enough for samples: L where it is measured; the crop, which is short, again and again."""
    size = bench.sizes[-1]
    yield f"merge of two {size}, -j1", merge(size, 1), 1
    yield f"crop from {size}, 40 times", crop(size, 1), 40
    yield f"resample {size}, -j1", resample(size, 1), 1
    yield "write M, 20 times", Command("io-bench", "write", "M_a.apgm", "w.apgm", "--runs", 20, out="w.apgm"), 1
    yield "read M, 20 times", Command("io-bench", "read", "M_a.apgm", "--runs", 20), 1


NOISE = re.compile(r"\[clone [^\]]*\]|\(anonymous namespace\)::|apgm::(format::|detail::)?|"
                   r"\.(arch|avx|default|part|cold|isra|constprop|resolver)[\w.]*")


def short(symbol):
    """A name without namespaces, parameters and what the compiler adds for each instruction set."""
    symbol = re.sub(r"\(.*\)( const)?$", "", NOISE.sub("", symbol))
    symbol = re.sub(r"<.*>", "<>", symbol).strip()
    return symbol if "operator" in symbol else symbol.split(" ")[-1]


def with_perf(bench, command, times):
    """Shares by (object, function); functions of objects without symbols as one."""
    perf, data = shutil.which("perf"), bench.path("perf.data")
    shares = collections.Counter()
    program = " ".join([bench.program(command.name), *command.args])
    script = f"for i in $(seq {times}); do {program} > /dev/null || exit 1; done"
    bench.remove(command)
    bench.run(Command(perf, "record", "-q", "-F", 1999, "-o", data, "--", "sh", "-c", script))
    report = bench.run(Command(perf, "report", "-i", data, "--stdio", "-q", "--no-children", "-s", "comm,dso,sym", "-t", "\t", "-g", "none"))
    for line in report.splitlines():
        parts = [p.strip() for p in line.split("\t")]
        if len(parts) != 4 or not parts[0].endswith("%") or parts[1] == "sh":
            continue
        share, _, dso, symbol = parts
        dso = dso.strip("[]").split("/")[-1]
        symbol = symbol[4:] if symbol.startswith("[") else symbol
        if dso.startswith("kernel") or dso.startswith("guest"):
            shares["kernel", ""] += float(share[:-1]) / 100
        elif re.match(r"0x|[0-9a-f]{8,}", symbol.strip()):
            shares[dso, "(no symbols)"] += float(share[:-1]) / 100
        else:
            shares[dso, short(symbol)] += float(share[:-1]) / 100
    total = sum(shares.values())
    return {key: share / total for key, share in shares.items()}


def with_callgrind(bench, command):
    """Shares of instructions by (object, function)."""
    out = bench.path("callgrind.out")
    bench.run(Command("valgrind", "-q", "--tool=callgrind", f"--callgrind-out-file={out}", bench.program(command.name), *command.args))
    shares = collections.Counter()
    for line in bench.run(Command("callgrind_annotate", out)).splitlines():
        found = re.match(r"\s*[\d,]+ \(\s*([\d.]+)%\)\s+(\S+?):(.*?)(?: \[(.*)\])?$", line)
        if found and "PROGRAM TOTALS" not in line:
            shares[(found[4] or "?").split("/")[-1], short(found[3])] += float(found[1]) / 100
    return dict(shares)


def perf_works(bench):
    if not shutil.which("perf"):
        return False
    try:
        bench.run(Command(shutil.which("perf"), "record", "-q", "-o", bench.path("perf.data"), "--", "true"))
    except RuntimeError:
        return False
    return True


def measure(bench, page):
    perf = perf_works(bench)
    if not perf and not bench.has("valgrind", "callgrind_annotate"):
        page.skip("profile: neither perf nor valgrind was there")
        return
    lines = ["Samples of perf, 1999 a second." if perf else "Instructions, counted by callgrind.",
             f"Functions with at least {LEAST:.0%}, at most {MOST} of each work. `kernel`: page faults, reading and writing files.", ""]
    for title, command, times in works(bench):
        bench.say(f"profile: {title}")
        shares = with_perf(bench, command, times) if perf else with_callgrind(bench, command)
        largest = sorted(((s, k) for k, s in shares.items() if s >= LEAST), reverse=True)[:MOST]
        rows = [(f"{share:.0%}", f"`{symbol}`" if symbol else "", dso) for share, (dso, symbol) in largest]
        rest = 1 - sum(share for share, _ in largest)
        lines += [f"### {title}", "", *table(("share", "function", "in"), [*rows, (f"{rest:.0%}", "all others", "")]), ""]
    page.section("Where the time goes", *lines)
