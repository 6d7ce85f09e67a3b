#!/usr/bin/env python3
"""Runs the reliability program and puts its tables into docs/reliability.md.

    run.py PROGRAM PAGE [ARGUMENTS...]
"""
import re
import subprocess
import sys


def main(arguments):
    if len(arguments) < 2:
        print(__doc__, file=sys.stderr)
        return 2
    program, page, *rest = arguments
    done = subprocess.run([program, *(rest or ["--most", "40000"])], stdout=subprocess.PIPE, text=True)
    tables = [table.strip() for table in done.stdout.split("\n\n") if table.startswith("|")]
    if done.returncode not in (0, 1) or not tables:
        print(f"{program} failed with {done.returncode}", file=sys.stderr)
        return 2
    with open(page, encoding="utf-8") as file:
        text = file.read()
    for name, table in zip(["apgm", "foreign"], tables):
        text = re.sub(rf"(<!-- table {name} -->\n).*?(<!-- end -->)", lambda m: m[1] + table + "\n" + m[2], text,
                      flags=re.DOTALL)
    with open(page, "w", encoding="utf-8") as file:
        file.write(text)
    return done.returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
