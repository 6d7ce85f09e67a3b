"""A reader of .apgm files written from docs/format.md alone, to prove that the page suffices.

  apgm_reader.py FILE...     prints what a file holds, as JSON
  apgm_reader.py --check DIR compares all files of a directory with what is expected of them

It reads everything: header, index, every cell; then walks the blocks from the front. Standard library, zstandard
and xxhash (Debian: python3-zstandard, python3-xxhash).
"""

import hashlib
import json
import os
import struct
import sys
from collections import namedtuple

import xxhash

import cells
from errors import Damaged, Foreign, Refused, Unsupported
from flatbuffer import Table
from map_header import MapHeader

MAGIC, SYNC, END = b"\x89APGM\r\n\x1a", b"APGMBLK1", b"APGMEND1"
MAP_HEADER, LAYER, INDEX_PAGE, INDEX_ROOT, FOOTER = 1, 2, 3, 4, 5
PREAMBLE_BYTES, BLOCK_BYTES, FOOTER_BLOCK_BYTES, ENTRY_BYTES = 64, 64, 256, 64
MAX_HEADER_BYTES, MAX_LAYER_FLAT, MAX_PAGES, MAX_PAGE_ENTRIES, MAX_STEP = 16 << 20, 4096, 1 << 20, 4096, 11
LISTED_LAYERS = 100  # a dump of more layers holds a digest of their lines

Block = namedtuple("Block", "kind flags version m p key commit hash offset size")
Entry = namedtuple("Entry", "key offset content hash stamp x y size type step encoding zero")
PageRef = namedtuple("PageRef", "offset size hash first_key last_key x_min y_min x_max y_max entries reserved")
Footer = namedtuple("Footer", "header_offset header_size header_hash root_offset root_size root_hash patches "
                              "layers content_id x_min y_min x_max y_max file_size previous commits zero end")

CURVE_BITS = ((0, 1, 3, 2), (0, 3, 1, 2), (2, 1, 3, 0), (2, 3, 1, 0))
CURVE_NEXT = ((1, 0, 2, 0), (0, 3, 1, 1), (2, 2, 0, 3), (3, 1, 3, 2))


def curve_key(x, y):
    x, y, key, state = x + 2**31, y + 2**31, 0, 0
    for bit in range(31, -1, -1):
        quadrant = 2 * (x >> bit & 1) + (y >> bit & 1)
        key = key << 2 | CURVE_BITS[state][quadrant]
        state = CURVE_NEXT[state][quadrant]
    return key


def hash_of(data):
    return xxhash.xxh3_64_intdigest(data)


def padded(size):
    return (size + 7) // 8 * 8


class File:
    """Reads and checks; `dump` then says what it holds."""

    def __init__(self, path):
        self.stream = open(path, "rb")
        self.size = os.fstat(self.stream.fileno()).st_size
        self.version = self.read_preamble()
        self.footer = self.read_footer()
        self.header = self.read_header()
        self.pages, self.totals = self.read_root()
        self.entries = self.read_pages()
        self.check_totals()
        self.content_id = self.check_content_id()
        self.lines = [self.read_layer(entry) for entry in self.entries]
        self.walk()

    # Bytes and blocks.

    def read(self, offset, size):
        if offset < 0 or offset + size > self.size:
            raise Damaged(f"{size} bytes lie outside the file", offset)
        self.stream.seek(offset)
        data = self.stream.read(size)
        if len(data) != size:
            raise Damaged("the file ended while it was read", offset)
        return data

    def read_preamble(self):
        head = self.read(0, min(self.size, PREAMBLE_BYTES))
        if head[:8] != MAGIC:
            raise Foreign("not an .apgm file")
        if len(head) < PREAMBLE_BYTES:
            raise Damaged("the file is cut off", self.size)
        major, minor, incompat, stored = struct.unpack("<HHI40xQ", head[8:])
        if stored != hash_of(head[:56]):
            raise Damaged("hash of the preamble", 0)
        if major != 1:
            raise Unsupported(f"version {major}.{minor}", 8)
        if incompat:
            raise Unsupported(f"features {incompat:#x}", 12)
        return [major, minor]

    def block_header(self, offset):
        if offset % 8:
            raise Damaged("a block is not aligned", offset)
        head = self.read(offset, BLOCK_BYTES)
        sync, kind, flags, version, m, p, key, commit, payload_hash, zero, stored = struct.unpack(
            "<8sBBHIQQQQ8sQ", head)
        if sync != SYNC:
            raise Damaged("no block", offset)
        if stored != hash_of(head[:56]):
            raise Damaged("hash of a block header", offset)
        if version != 1 or flags > 1:
            raise Unsupported(f"version {version}, flags {flags:#x} of a block", offset)
        if m % 8 or m > p or any(zero):
            raise Damaged("a block header without sense", offset)
        return Block(kind, flags, version, m, p, key, commit, payload_hash, offset, BLOCK_BYTES + padded(p))

    def block(self, offset, size, kind, expected_hash, key=0):
        """Header and payload of a block that something else names."""
        block = self.block_header(offset)
        if block.kind != kind or block.size != size or block.hash != expected_hash or block.key != key:
            raise Damaged("a block is not the one that is named", offset)
        return block, self.payload(block)

    def payload(self, block):
        data = self.read(block.offset + BLOCK_BYTES, block.size - BLOCK_BYTES)
        if hash_of(data[:block.p]) != block.hash:
            raise Damaged("hash of a payload", block.offset)
        if any(data[block.p:]):
            raise Damaged("padding that is not zero", block.offset + BLOCK_BYTES + block.p)
        return data[:block.p]

    # From the end to the index.

    def read_footer(self):
        offset = self.size - FOOTER_BLOCK_BYTES
        if offset < PREAMBLE_BYTES or offset % 8:
            raise Damaged("the file is cut off", self.size)
        block = self.block_header(offset)
        if block.kind != FOOTER or block.size != FOOTER_BLOCK_BYTES or block.m or block.key:
            raise Damaged("no footer at the end", offset)
        footer = Footer._make(struct.unpack("<8Q16s4i3Q64s8s", self.payload(block)))
        if footer.end != END or any(footer.zero):
            raise Damaged("a footer without sense", offset)
        if footer.file_size != self.size:
            raise Damaged(f"the footer says {footer.file_size} bytes, the file has {self.size}", offset)
        if not footer.commits:
            raise Damaged("a file without a commit", offset)
        if footer.commits != 1 or footer.previous:
            raise Unsupported("an archive of several commits", offset)
        return footer

    def read_header(self):
        footer = self.footer
        if footer.header_size > BLOCK_BYTES + MAX_HEADER_BYTES:
            raise Damaged("a header larger than 16 MiB", footer.header_offset)
        block, payload = self.block(footer.header_offset, footer.header_size, MAP_HEADER, footer.header_hash)
        if block.m != block.p:
            raise Damaged("a header with a body", block.offset)
        return MapHeader(payload, block.offset + BLOCK_BYTES)

    def read_root(self):
        footer = self.footer
        block, payload = self.block(footer.root_offset, footer.root_size, INDEX_ROOT, footer.root_hash)
        if block.m != block.p:
            raise Damaged("an index root with a body", block.offset)
        table = Table.root(payload, block.offset + BLOCK_BYTES)
        pages = [PageRef._make(p) for p in table.structs(0, "<5Q4i2I", MAX_PAGES)]
        totals = table.structs(1, "<15Q", 4096)
        if len(totals) != len(self.header.types):
            raise Damaged("totals do not fit the types", block.offset)
        return pages, totals

    def read_pages(self):
        entries = []
        for page in self.pages:
            found = self.read_page(page)
            keys = [(entry.key, entry.type) for entry in entries[-1:] + found]
            if any(a >= b for a, b in zip(keys, keys[1:])):
                raise Damaged("entries do not ascend", page.offset)
            xs, ys = [entry.x for entry in found], [entry.y for entry in found]
            if (page.first_key, page.last_key, page.x_min, page.y_min, page.x_max, page.y_max, page.reserved) != (
                    found[0].key, found[-1].key, min(xs), min(ys), max(xs), max(ys), 0):
                raise Damaged("a page does not hold what the root says", page.offset)
            entries += found
        return entries

    def read_page(self, page):
        if not 1 <= page.entries <= MAX_PAGE_ENTRIES:
            raise Damaged(f"a page of {page.entries} entries", page.offset)
        block, payload = self.block(page.offset, page.size, INDEX_PAGE, page.hash, page.first_key)
        at = block.offset + BLOCK_BYTES
        if Table.root(payload[:block.m], at).get(0, "uint") != page.entries:
            raise Damaged("number of entries of a page", at)
        n = page.entries
        columns = cells.unpack_frame(payload[block.m:], n * ENTRY_BYTES, at + block.m)
        rows = bytearray(n * ENTRY_BYTES)
        for k in range(ENTRY_BYTES):
            rows[k::ENTRY_BYTES] = columns[k * n:(k + 1) * n]
        entries = [Entry._make(e) for e in struct.iter_unpack("<4Qq2iIHBB8s", rows)]
        for entry in entries:
            self.check_entry(entry, page.offset)
        return entries

    def check_entry(self, entry, at):
        if entry.key != curve_key(entry.x, entry.y):
            raise Damaged("a key does not fit its patch", at)
        if entry.type >= len(self.header.types):
            raise Damaged("a layer of an unknown type", at)
        if entry.step > MAX_STEP:
            raise Damaged(f"step {entry.step}", at)
        if any(entry.zero):
            raise Damaged("reserved bytes of an entry are not zero", at)
        values = self.value_bytes(entry)
        if values > cells.MAX_LAYER_BYTES:
            raise Damaged("a layer larger than 64 MiB", at)
        if entry.size > values + values // 16 + (16 << 10):
            raise Damaged("a block larger than its layer allows", at)
        if entry.encoding >= len(cells.ENCODINGS):
            raise Unsupported(f"encoding {entry.encoding}", at)

    def value_bytes(self, entry):
        return 4 * len(self.header.types[entry.type].channels) * 4**entry.step

    def check_totals(self):
        footer, at = self.footer, self.footer.root_offset
        counted = [[0] * 15 for _ in self.header.types]
        for entry in self.entries:
            total = counted[entry.type]
            for place, amount in ((0, 1), (1, entry.size), (2, self.value_bytes(entry)), (3 + entry.step, 1)):
                total[place] += amount
        if counted != [list(t) for t in self.totals]:
            raise Damaged("totals of the index root", at)
        xs = [page.x_min for page in self.pages] + [page.x_max for page in self.pages]
        ys = [page.y_min for page in self.pages] + [page.y_max for page in self.pages]
        extent = (min(xs), min(ys), max(xs), max(ys)) if xs else (0, 0, -1, -1)
        if extent != (footer.x_min, footer.y_min, footer.x_max, footer.y_max):
            raise Damaged("extent in the footer", self.size - FOOTER_BLOCK_BYTES)
        if (footer.layers, footer.patches) != (len(self.entries), len({e.key for e in self.entries})):
            raise Damaged("counts in the footer", self.size - FOOTER_BLOCK_BYTES)

    def check_content_id(self):
        header = self.header

        def text(value):
            return struct.pack("<I", len(value.encode())) + value.encode()

        def texts(values):
            return struct.pack("<I", len(values)) + b"".join(map(text, values))

        spaces = []
        for kind in header.types:
            space = text(kind.name) + texts(kind.hypotheses) + texts(kind.channels)
            spaces.append(hash_of(space + (struct.pack("<2q", *kind.slab) if kind.slab else b"")))
        digest = xxhash.xxh3_128(text("apgm content 1") + text(header.frame_id))
        digest.update(struct.pack("<4q", header.edge, *header.datum, header.epsg))
        for entry in self.entries:
            digest.update(struct.pack("<2i3Q", entry.x, entry.y, spaces[entry.type], entry.step, entry.content))
        if digest.digest() != self.footer.content_id:
            raise Damaged("content id", self.size - FOOTER_BLOCK_BYTES)
        return digest.hexdigest()

    # Layers.

    def read_layer(self, entry):
        """Checks a layer down to its cells; its line of the dump."""
        block, payload = self.block(entry.offset, entry.size, LAYER, entry.hash, entry.key)
        at = block.offset + BLOCK_BYTES
        if block.m > MAX_LAYER_FLAT:
            raise Damaged("the FlatBuffer of a layer is larger than 4096 bytes", at)
        table = Table.root(payload[:block.m], at)
        stated = (table.get(0, "int"), table.get(1, "int"), table.get(2, "ushort"), table.get(3, "ubyte"),
                  table.get(4, "ubyte"), table.get(5, "long"), table.get(6, "ulong"))
        if stated != (entry.x, entry.y, entry.type, entry.step, entry.encoding, entry.stamp, entry.content):
            raise Damaged("a layer is not what the index says", at)
        bound = table.get(7, "float")
        if not 0 <= bound <= 1:
            raise Damaged("an error bound that is none", at)
        kind = self.header.types[entry.type]
        body_at = at + block.m
        planes = cells.decode(entry.encoding, payload[block.m:], kind, entry.step, body_at)
        cells.check(planes, kind, body_at)
        raw = cells.planes_bytes(planes)
        if cells.content_hash(raw, entry.step, len(kind.channels)) != entry.content:
            raise Damaged("the cells do not have the content hash", body_at)
        return {"patch": [entry.x, entry.y], "type": kind.name, "step": entry.step,
                "encoding": cells.ENCODINGS[entry.encoding], "stamp_ns": entry.stamp,
                "error_bound": f"{cells.bits(bound):08x}", "content_hash": f"{entry.content:016x}",
                "cells": hashlib.sha256(raw).hexdigest()}

    # From the front, as somebody does who trusts no index.

    def walk(self):
        expected = {PREAMBLE_BYTES: MAP_HEADER, self.footer.root_offset: INDEX_ROOT,
                    self.size - FOOTER_BLOCK_BYTES: FOOTER}
        expected.update((entry.offset, LAYER) for entry in self.entries)
        expected.update((page.offset, INDEX_PAGE) for page in self.pages)
        offset = PREAMBLE_BYTES
        while offset < self.size:
            block = self.block_header(offset)
            if block.commit != 1:
                raise Damaged("a block of another commit", offset)
            known = MAP_HEADER <= block.kind <= FOOTER
            if known and expected.pop(offset, None) != block.kind:
                raise Damaged("a block that nothing names", offset)
            if not known:
                if block.flags & 1:
                    raise Unsupported(f"block of kind {block.kind}", offset)
                self.payload(block)
            offset += block.size
        if expected:
            raise Damaged("a block does not stand where blocks follow each other", min(expected))
        places = [entry.offset for entry in self.entries]
        if places != sorted(places):
            raise Damaged("layers do not stand in their order")

    def dump(self):
        footer = self.footer
        out = {"version": self.version, "bytes": self.size, "content_id": self.content_id,
               "header": self.header.dump(), "patches": footer.patches,
               "range": [footer.x_min, footer.y_min, footer.x_max, footer.y_max], "layers": len(self.lines)}
        if len(self.lines) <= LISTED_LAYERS:
            out["list"] = self.lines
        else:
            lines = "".join(line_text(line) for line in self.lines)
            out["list_sha256"] = hashlib.sha256(lines.encode()).hexdigest()
        return out


def line_text(line):
    x, y = line["patch"]
    rest = [line[k] for k in ("type", "step", "encoding", "stamp_ns", "error_bound", "content_hash", "cells")]
    return " ".join(map(str, [x, y, *rest])) + "\n"


def result_of(path):
    """What the corpus expects of a file: its dump, or how it is refused."""
    try:
        return File(path).dump(), ""
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
        return json.load(file)


def check(folder):
    """True if the reader finds in all files of `folder` what is expected of them."""
    names = sorted(name[:-5] for name in os.listdir(folder) if name.endswith(".apgm"))
    differ = 0
    for name in names:
        expected = expected_of(folder, name)
        found, why = result_of(os.path.join(folder, name + ".apgm"))
        if found != expected:
            differ += 1
            print(f"{name}: found {json.dumps(found)[:400]} {why}\n  expected {json.dumps(expected)[:400]}")
        elif why:
            print(f"{name}: {why}")
    print(f"{len(names)} files, {differ} differ")
    return bool(names) and not differ


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
