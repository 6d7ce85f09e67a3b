"""One commit: from its footer to its cells (docs/format.md, sections 2.3 to 6). A sealed file has one."""

import hashlib
import struct
from collections import namedtuple

import xxhash

import cells
from blocks import BLOCK_BYTES, END, FOOTER, FOOTER_BLOCK_BYTES, INDEX_PAGE, INDEX_ROOT, LAYER, MAP_HEADER
from blocks import PREAMBLE_BYTES, curve_key, hash_of
from errors import Damaged, Unsupported
from flatbuffer import Table
from map_header import MapHeader

ENTRY_BYTES = 64
MAX_HEADER_BYTES, MAX_LAYER_FLAT, MAX_PAGES, MAX_PAGE_ENTRIES, MAX_STEP = 16 << 20, 4096, 1 << 20, 4096, 11
LISTED_LAYERS = 100  # a dump of more layers holds a digest of their lines

Entry = namedtuple("Entry", "key offset content hash stamp x y size type step encoding zero")
PageRef = namedtuple("PageRef", "offset size hash first_key last_key x_min y_min x_max y_max entries reserved")
Footer = namedtuple("Footer", "header_offset header_size header_hash root_offset root_size root_hash patches "
                              "layers content_id x_min y_min x_max y_max file_size previous number zero end")


def read_footer(file, offset):
    """The Footer whose block starts at `offset`, with all that 2.2 and 2.3 ask of it alone."""
    if offset < PREAMBLE_BYTES or offset % 8:
        raise Damaged("no footer can lie here", offset)
    block = file.block_header(offset)
    if block.kind != FOOTER or block.size != FOOTER_BLOCK_BYTES or block.m or block.key:
        raise Damaged("no footer", offset)
    footer = Footer._make(struct.unpack("<8Q16s4i3Q64s8s", file.payload(block)))
    if footer.end != END or any(footer.zero):
        raise Damaged("a footer without sense", offset)
    if footer.file_size != offset + FOOTER_BLOCK_BYTES:
        raise Damaged(f"the footer says {footer.file_size} bytes", offset)
    if not footer.number:
        raise Damaged("a commit without a number", offset)
    places = [(footer.header_offset, footer.header_size), (footer.root_offset, footer.root_size)]
    if footer.previous:
        places.append((footer.previous, FOOTER_BLOCK_BYTES))
    if any(at < PREAMBLE_BYTES or at % 8 or at + size > offset for at, size in places):
        raise Damaged("a footer names what does not lie before it", offset)
    return footer


def space_hashes(types):
    def text(value):
        return struct.pack("<I", len(value.encode())) + value.encode()

    def texts(values):
        return struct.pack("<I", len(values)) + b"".join(map(text, values))

    spaces = []
    for kind in types:
        space = text(kind.name) + texts(kind.hypotheses) + texts(kind.channels)
        spaces.append(hash_of(space + (struct.pack("<2q", *kind.slab) if kind.slab else b"")))
    return spaces


def content_id(header, layers):
    """`layers`: ix, iy, type, step, content hash of each, in the order of the index."""
    spaces = space_hashes(header.types)
    digest = xxhash.xxh3_128()
    for part in (b"apgm content 1", header.frame_id.encode()):
        digest.update(struct.pack("<I", len(part)) + part)
    digest.update(struct.pack("<4q", *header.frame()[:4]))
    for x, y, number, step, content in layers:
        digest.update(struct.pack("<2i3Q", x, y, spaces[number], step, content))
    return digest.digest()


def read_cells(table, body, kind, at):
    """Checks a layer down to its cells, by its FlatBuffer; its line of the dump."""
    x, y, step, encoding, content = (table.get(0, "int"), table.get(1, "int"), table.get(3, "ubyte"),
                                     table.get(4, "ubyte"), table.get(6, "ulong"))
    bound = table.get(7, "float")
    if not 0 <= bound <= 1:
        raise Damaged("an error bound that is none", at)
    planes = cells.decode(encoding, body, kind, step, at)
    cells.check(planes, kind, at)
    raw = cells.planes_bytes(planes)
    if cells.content_hash(raw, step, len(kind.channels)) != content:
        raise Damaged("the cells do not have the content hash", at)
    return {"patch": [x, y], "type": kind.name, "step": step, "encoding": cells.ENCODINGS[encoding],
            "stamp_ns": table.get(5, "long"), "error_bound": f"{cells.bits(bound):08x}",
            "content_hash": f"{content:016x}", "cells": hashlib.sha256(raw).hexdigest()}


def most_block_bytes(kind, step):
    """Most bytes of a Layer block (section 5); the bytes of its values where they are too many are refused."""
    values = 4 * len(kind.channels) * 4**step
    if values > cells.MAX_LAYER_BYTES:
        raise Damaged("a layer larger than 64 MiB")
    return values + values // 16 + (16 << 10)


def line_text(line):
    x, y = line["patch"]
    rest = [line[k] for k in ("type", "step", "encoding", "stamp_ns", "error_bound", "content_hash", "cells")]
    return " ".join(map(str, [x, y, *rest])) + "\n"


def lines_sha256(lines):
    return hashlib.sha256("".join(map(line_text, lines)).encode()).hexdigest()


def dump_map(header, content, patches, extent, lines):
    out = {"content_id": content, "header": header.dump(), "patches": patches, "range": list(extent),
           "layers": len(lines)}
    if len(lines) <= LISTED_LAYERS:
        out["list"] = lines
    else:
        out["list_sha256"] = lines_sha256(lines)
    return out


class Commit:
    """A commit, read whole."""

    def __init__(self, file, offset, footer):
        self.file, self.footer_offset, self.footer = file, offset, footer
        self.header = self.read_header()
        self.pages, self.totals = self.read_root()
        self.entries = self.read_pages()
        self.check_totals()
        self.content_id = self.check_content_id()
        self.lines = [self.read_layer(entry) for entry in self.entries]

    @property
    def end(self):
        return self.footer_offset + FOOTER_BLOCK_BYTES

    def blocks(self):
        """Offset and kind of every block that the commit names, and of its footer."""
        yield self.footer_offset, FOOTER
        yield self.footer.header_offset, MAP_HEADER
        yield self.footer.root_offset, INDEX_ROOT
        yield from ((page.offset, INDEX_PAGE) for page in self.pages)
        yield from ((entry.offset, LAYER) for entry in self.entries)

    def dump(self):
        footer = self.footer
        extent = (footer.x_min, footer.y_min, footer.x_max, footer.y_max)
        return dump_map(self.header, self.content_id, footer.patches, extent, self.lines)

    def read_header(self):
        footer = self.footer
        if footer.header_size > BLOCK_BYTES + MAX_HEADER_BYTES:
            raise Damaged("a header larger than 16 MiB", footer.header_offset)
        block, payload = self.file.block(footer.header_offset, footer.header_size, MAP_HEADER, footer.header_hash)
        if block.m != block.p:
            raise Damaged("a header with a body", block.offset)
        return MapHeader(payload, block.offset + BLOCK_BYTES)

    def read_root(self):
        footer = self.footer
        block, payload = self.file.block(footer.root_offset, footer.root_size, INDEX_ROOT, footer.root_hash)
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
        self.check_before_root(page.offset)
        block, payload = self.file.block(page.offset, page.size, INDEX_PAGE, page.hash, page.first_key)
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

    def check_before_root(self, offset):
        if offset >= self.footer.root_offset:
            raise Damaged("something named lies behind the index root", offset)

    def check_entry(self, entry, at):
        self.check_before_root(entry.offset)
        if entry.key != curve_key(entry.x, entry.y):
            raise Damaged("a key does not fit its patch", at)
        if entry.type >= len(self.header.types):
            raise Damaged("a layer of an unknown type", at)
        if entry.step > MAX_STEP:
            raise Damaged(f"step {entry.step}", at)
        if any(entry.zero):
            raise Damaged("reserved bytes of an entry are not zero", at)
        if entry.size > most_block_bytes(self.header.types[entry.type], entry.step):
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
            raise Damaged("extent in the footer", self.footer_offset)
        if (footer.layers, footer.patches) != (len(self.entries), len({e.key for e in self.entries})):
            raise Damaged("counts in the footer", self.footer_offset)

    def check_content_id(self):
        found = content_id(self.header, [(e.x, e.y, e.type, e.step, e.content) for e in self.entries])
        if found != self.footer.content_id:
            raise Damaged("content id", self.footer_offset)
        return found.hex()

    # Layers.

    def read_layer(self, entry):
        """Checks a layer down to its cells; its line of the dump."""
        block, payload = self.file.block(entry.offset, entry.size, LAYER, entry.hash, entry.key)
        at = block.offset + BLOCK_BYTES
        if block.m > MAX_LAYER_FLAT:
            raise Damaged("the FlatBuffer of a layer is larger than 4096 bytes", at)
        table = Table.root(payload[:block.m], at)
        stated = (table.get(0, "int"), table.get(1, "int"), table.get(2, "ushort"), table.get(3, "ubyte"),
                  table.get(4, "ubyte"), table.get(5, "long"), table.get(6, "ulong"))
        if stated != (entry.x, entry.y, entry.type, entry.step, entry.encoding, entry.stamp, entry.content):
            raise Damaged("a layer is not what the index says", at)
        return read_cells(table, payload[block.m:], self.header.types[entry.type], at + block.m)
