#!/usr/bin/env python3
"""Makes small maps with the tools and compares bytes and content ids with frozen ones: a faster way must write the same.

usage: tests/bench/check_bytes.py BIN_DIR [--write]

Every output is made with one thread and with two. With another zstd than the frozen one only content ids are compared:
they do not depend on compression. --write freezes what is made now.
"""

import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile

FROZEN = os.path.join(os.path.dirname(os.path.abspath(__file__)), "bytes.json")
CELLS = "100e3"
# Cuts through patches on all four sides; the town's middle.
BOX = "569990.05,5359985.25,570011.35,5360013.15"


def commands(model):
    """Output and the command that makes it from those before."""
    a, b = f"{model}_a.apgm", f"{model}_b.apgm"
    make = ["make-bench-maps", "--cells", CELLS, "--model", model]
    yield a, [*make, "--seed", "1"]
    yield b, [*make, "--seed", "2", "--overlap", "0.5"]
    for rule in ("dempster", "yager", "mean", "max"):
        yield f"{model}_{rule}.apgm", ["apgm-merge", a, b, "--rule", rule]
    yield f"{model}_trust.apgm", ["apgm-merge", a, b, "--discount", f"{b}=0.8"]
    yield f"{model}_coarse.apgm", ["apgm-merge", a, b, "--resolution", "0.2"]
    yield f"{model}_crop.apgm", ["apgm-crop", a, "--bbox", BOX]
    for step, policy in (("6", "conditional"), ("6", "exclusive"), ("6", "min"), ("6", "product"), ("4", "conditional"), ("8", "conditional")):
        yield f"{model}_{policy}{step}.apgm", ["apgm-resample", a, "--step", step, "--policy", policy]
    for lossy in ("u16", "u8"):
        yield f"{model}_{lossy}.apgm", ["apgm-convert", a, "--lossy", lossy]
    for level in ("1", "12"):
        yield f"{model}_level{level}.apgm", ["apgm-convert", a, "--level", level]
    yield f"{model}_stream.apgms", ["apgm-convert", a, "--stream"]


def run(bin_dir, work, command):
    done = subprocess.run([os.path.join(bin_dir, command[0]), *command[1:]], cwd=work, capture_output=True, text=True)
    # 3: written, with a loss that is told.
    if done.returncode not in (0, 3):
        sys.exit(f"{' '.join(command)}: exit {done.returncode}\n{done.stderr}")
    return done.stdout


def make(bin_dir, work, threads):
    """By output its sha256 and content id."""
    made = {}
    for model in ("continuous", "stepped"):
        for output, command in commands(model):
            run(bin_dir, work, [*command, "-j", str(threads), "-O", "-o", output])
            with open(os.path.join(work, output), "rb") as file:
                made[output] = {"sha256": hashlib.sha256(file.read()).hexdigest()}
            if output.endswith(".apgm"):
                info = json.loads(run(bin_dir, work, ["apgm-info", "--json", output]))
                made[output]["content_id"] = info["map"]["content_id"]
    return made


def zstd_version(bin_dir):
    return re.search(r"zstd ([0-9.]+)", run(bin_dir, ".", ["apgm-info", "--version"])).group(1)


def differences(made, frozen, keys):
    for output in sorted(made.keys() | frozen.keys()):
        a, b = made.get(output, {}), frozen.get(output, {})
        for key in keys:
            if a.get(key) != b.get(key):
                yield f"{output}: {key} is {a.get(key)}, not {b.get(key)}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("bin_dir")
    parser.add_argument("--write", action="store_true")
    args = parser.parse_args()
    bin_dir = os.path.abspath(args.bin_dir)
    with tempfile.TemporaryDirectory() as work:
        one, two = (make(bin_dir, work, threads) for threads in (1, 2))
    zstd = zstd_version(bin_dir)
    wrong = [f"with two threads: {line}" for line in differences(two, one, ("sha256", "content_id"))]
    if args.write and not wrong:
        with open(FROZEN, "w", encoding="utf-8") as file:
            json.dump({"zstd": zstd, "outputs": one}, file, indent=1, sort_keys=True)
            file.write("\n")
        return
    with open(FROZEN, encoding="utf-8") as file:
        frozen = json.load(file)
    keys = ("sha256", "content_id") if zstd == frozen["zstd"] else ("content_id",)
    if len(keys) == 1:
        print(f"zstd {zstd} compresses to other bytes than {frozen['zstd']}: only content ids are compared")
    wrong += differences(one, frozen["outputs"], keys)
    if wrong:
        sys.exit("\n".join(wrong))
    print(f"{len(one)} outputs as frozen")


if __name__ == "__main__":
    main()
