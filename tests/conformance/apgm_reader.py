"""A reader of .apgm files and streams written from docs/format.md alone, to prove that the page suffices.

  apgm_reader.py FILE...     prints what a file or stream (.apgms) holds, as JSON
  apgm_reader.py --check DIR compares all files of a directory with what is expected of them

It reads everything: headers, indices, every cell of every commit; then walks the blocks from the front. Standard
library, zstandard and xxhash (Debian: python3-zstandard, python3-xxhash).
"""

import json
import os
import sys

import archive
from blocks import FOOTER, FOOTER_BLOCK_BYTES, MAP_HEADER, PREAMBLE_BYTES, Bytes
from commit import Commit, read_footer
from errors import Damaged, Refused, Unsupported
from stream import Receiver

STREAM_SUFFIX = ".apgms"


class File:
    """Reads and checks; `dump` then says what it holds."""

    def __init__(self, path):
        self.file = Bytes(path)
        self.version, self.is_archive = self.file.read_preamble()
        self.end = self.file.size
        footers = self.find_footers()
        self.commits = [Commit(self.file, offset, footer) for offset, footer in footers]
        if self.is_archive:
            archive.check_commits(self.commits)
        self.tags = archive.tags(self.commits) if self.is_archive else {}
        self.walk()
        if not self.is_archive:
            self.check_order()

    def find_footers(self):
        """Offset and footer of each, the first first."""
        if self.is_archive:
            offset, footer = archive.last_footer(self.file)
            self.end = offset + FOOTER_BLOCK_BYTES
            return archive.chain(self.file, offset, footer)
        if self.file.size < PREAMBLE_BYTES + FOOTER_BLOCK_BYTES:
            raise Damaged("the file is cut off", self.file.size)
        offset = self.file.size - FOOTER_BLOCK_BYTES
        footer = read_footer(self.file, offset)
        if footer.number != 1 or footer.previous:
            raise Damaged("a sealed file of several commits", offset)
        return [(offset, footer)]

    # From the front, as somebody does who trusts no index.

    def walk(self):
        expected = {}
        for commit in self.commits:
            expected.update(commit.blocks())
        ends = iter(self.commits)
        commit, offset = next(ends), PREAMBLE_BYTES
        while offset < self.end:
            block = self.file.block_header(offset)
            if block.commit != commit.footer.number:
                raise Damaged("a block of another commit", offset)
            known = MAP_HEADER <= block.kind <= FOOTER
            if known and expected.pop(offset, None) != block.kind:
                raise Damaged("a block that nothing names", offset)
            if not known:
                if block.flags & 1:
                    raise Unsupported(f"block of kind {block.kind}", offset)
                self.file.payload(block)
            offset += block.size
            if offset == commit.end:
                commit = next(ends, commit)
        if expected:
            raise Damaged("a block does not stand where blocks follow each other", min(expected))

    def check_order(self):
        places = [entry.offset for entry in self.commits[0].entries]
        if places != sorted(places):
            raise Damaged("layers do not stand in their order")

    def dump(self, with_commits=False):
        """`with_commits`: of an archive, what docs/conformance.md says."""
        out = {"version": self.version, "bytes": self.file.size, **self.commits[-1].dump()}
        if self.is_archive:
            out["header"]["metadata"] = archive.without_its_keys(out["header"]["metadata"])
        if with_commits:
            out["uncommitted_bytes"] = self.file.size - self.end
            out["commits"] = archive.log(self.commits, self.tags)
        return out


def dump_of(path, with_commits):
    if path.endswith(STREAM_SUFFIX):
        with open(path, "rb") as stream:
            return Receiver(stream.read()).dump()
    file = File(path)
    return file.dump(file.is_archive if with_commits is None else with_commits)


def result_of(path, with_commits=None):
    """What the corpus expects of a file: its dump, or how it is refused."""
    try:
        return dump_of(path, with_commits), ""
    except Refused as refused:
        return {"refused": refused.kind}, str(refused)


def expected_of(folder, name, table={}):
    """What a corpus says of a file: NAME.json for one that is read, a line of expected.json for one that is not."""
    listed = os.path.join(folder, "expected.json")
    if os.path.exists(listed):
        if listed not in table:
            with open(listed, encoding="utf-8") as file:
                table[listed] = json.load(file)
        return {"refused": table[listed][name]["refused"]}
    with open(os.path.join(folder, name + ".json"), encoding="utf-8") as file:
        expected = json.load(file)
    expected.pop("rule", None)
    return expected


def check(folder):
    """True if the reader finds in all files of `folder` what is expected of them."""
    files = sorted(name for name in os.listdir(folder) if name.endswith((".apgm", STREAM_SUFFIX)))
    differ = 0
    for file in files:
        name = os.path.splitext(file)[0]
        expected = expected_of(folder, name)
        found, why = result_of(os.path.join(folder, file), "commits" in expected)
        if found != expected:
            differ += 1
            print(f"{name}: found {json.dumps(found)[:400]} {why}\n  expected {json.dumps(expected)[:400]}")
        elif why:
            print(f"{name}: {why}")
    print(f"{len(files)} files, {differ} differ")
    return bool(files) and not differ


def main(arguments):
    if len(arguments) == 2 and arguments[0] == "--check":
        return 0 if check(arguments[1]) else 1
    failed = 0
    for path in arguments:
        found, why = result_of(path)
        print(json.dumps(found, indent=1, sort_keys=True, ensure_ascii=False))
        if why:
            failed = 2
            print(f"{path}: {why}", file=sys.stderr)
    return failed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
