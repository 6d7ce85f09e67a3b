"""What a receiver makes of a stream (docs/format.md, section 10), and what it counts (docs/conformance.md)."""

import struct
from collections import Counter, namedtuple

import cells
from blocks import BLOCK_BYTES, FOOTER, INDEX_PAGE, LAYER, MAGIC, MAP_HEADER, PREAMBLE_BYTES, SYNC, Block
from blocks import curve_key, hash_of, padded
from commit import MAX_HEADER_BYTES, MAX_LAYER_FLAT, MAX_STEP, content_id, dump_map, most_block_bytes, read_cells
from errors import Damaged, Refused, Unsupported
from flatbuffer import Table
from map_header import MapHeader

GONE, PART, END = 6, 7, 8
MAX_BLOCK_BYTES, MAX_GONE, GONE_BYTES, END_BYTES, PART_HEAD_BYTES = 72 << 20, 4096, 16, 64, 16
COUNTS = ("blocks messages layers gone damaged lost duplicate late superseded incomplete without_header unsupported "
          "skipped_bytes unusable").split()

StreamBlock = namedtuple("StreamBlock", "block context payload")


def parse_block(data):
    """The whole block that `data` is, its header's hash checked before."""
    sync, kind, flags, version, m, p, key, commit, payload_hash, context, _ = struct.unpack_from("<8sBBHI6Q", data)
    if version != 1 or flags > 1:
        raise Unsupported(f"version {version}, flags {flags:#x} of a block")
    payload = data[BLOCK_BYTES:BLOCK_BYTES + p]
    if m % 8 or m > p or hash_of(payload) != payload_hash or any(data[BLOCK_BYTES + p:]):
        raise Damaged("a block is not whole")
    block = Block(kind, flags, version, m, p, key, commit, payload_hash, 0, len(data))
    return StreamBlock(block, context, payload)


def is_header(head):
    return head[:8] == SYNC and struct.unpack_from("<Q", head, 56)[0] == hash_of(head[:56])


class Map:
    """The map that a stream makes."""

    def __init__(self):
        self.header, self.layers = None, {}  # by patch and name: number, line, content hash

    def set_header(self, header):
        if self.header and header.frame() != self.header.frame():
            self.layers = {}
        if self.header:
            old = {kind.name: kind.place(0) for kind in self.header.types}
            new = {kind.name: kind.place(0) for kind in header.types}
            self.layers = {at: kept for at, kept in self.layers.items() if new.get(at[2]) == old[at[2]]}
        self.header = header

    def number_of(self, name):
        return next(i for i, kind in enumerate(self.header.types) if kind.name == name)

    def dump(self):
        if not self.header:
            return None
        order = sorted(self.layers, key=lambda at: (curve_key(*at[:2]), self.number_of(at[2])))
        kept = [self.layers[at] for at in order]
        content = content_id(self.header, [(at[0], at[1], self.number_of(at[2]), line["step"], stored)
                                           for at, (_, line, stored) in zip(order, kept)]).hex()
        xs, ys = [at[0] for at in order], [at[1] for at in order]
        extent = (min(xs), min(ys), max(xs), max(ys)) if order else (0, 0, -1, -1)
        return dump_map(self.header, content, len({at[:2] for at in order}), extent, [line for _, line, _ in kept])


class Receiver:
    """Takes a stream apart from a pipe. Bounds of memory are not kept: it is for small streams."""

    def __init__(self, data):
        self.data, self.counts = data, Counter()
        self.map, self.ends, self.base = Map(), [], 0
        self.foreign, self.said, self.shown = False, None, None
        self.headers = {}
        self.begin()
        self.take_all()
        self.settle()

    def begin(self):
        """Numbers from 1."""
        self.numbers, self.greatest, self.newest_kind, self.header_number = set(), 0, 0, 0
        self.waiting, self.groups, self.newest = {}, {}, {}
        self.session = None

    def settle(self):
        self.counts["lost"] += self.greatest - len(self.numbers)
        self.counts["incomplete"] += len(self.groups)
        self.counts["without_header"] += len(self.waiting)

    def restart(self):
        self.settle()
        self.base += self.greatest
        self.begin()

    # Bytes to blocks.

    def take_all(self):
        at = 0
        while at < len(self.data):
            marks = [place for place in (self.data.find(SYNC, at), self.data.find(MAGIC, at)) if place >= 0]
            start = min(marks, default=len(self.data))
            self.counts["skipped_bytes"] += start - at
            used, whole = self.take_at(start) if marks else (0, True)
            self.counts["skipped_bytes"] += 0 if whole else used
            at = start + used

    def take_at(self, at):
        """Bytes to go on by, and whether they are a block or a preamble."""
        head = self.data[at:at + BLOCK_BYTES]
        if len(head) < BLOCK_BYTES:
            return len(SYNC), False
        if head[:8] == MAGIC:
            return self.take_preamble(head)
        if not is_header(head):
            return len(SYNC), False
        size = BLOCK_BYTES + padded(struct.unpack_from("<Q", head, 16)[0])
        try:
            if size > MAX_BLOCK_BYTES or at + size > len(self.data):
                raise Damaged("a block is cut off")
            block = parse_block(self.data[at:at + size])
        except Unsupported:
            self.counts["unsupported"] += 1
            return size, False
        except Damaged:
            self.counts["damaged"] += 1
            return BLOCK_BYTES, False  # others may lie within
        self.take(block)
        return size, True

    def take_preamble(self, head):
        major, incompat, stored = struct.unpack("<8xHxxI40xQ", head)
        if stored != hash_of(head[:56]):
            return len(MAGIC), False
        self.foreign = major != 1 or incompat != 1
        self.counts["unsupported"] += self.foreign
        self.restart()
        return PREAMBLE_BYTES, True

    # Blocks by their numbers.

    def take(self, block):
        if self.foreign:
            self.counts["unsupported"] += 1
            return
        session, number = block.block.commit >> 32, block.block.commit & 0xFFFFFFFF
        if not number:
            self.counts["damaged"] += 1
            return
        if self.session is not None and session < self.session:
            self.counts["late"] += 1
            return
        if self.session is not None and session > self.session:
            self.restart()
        self.session = session
        if number in self.numbers:
            self.counts["duplicate"] += 1
        elif block.block.kind == PART:
            self.checked(self.take_part, block, number)
        elif self.checked(self.take_whole, block, number):
            self.arrived(block, number)

    def arrived(self, block, number):
        self.counts["blocks"] += 1
        self.count_number(block, number)

    def count_number(self, block, number):
        self.numbers.add(number)
        if number >= self.greatest:
            self.greatest, self.newest_kind = number, block.block.kind

    def checked(self, work, *arguments):
        """True if the block keeps the rules."""
        try:
            work(*arguments)
            return True
        except Refused as refused:
            self.counts[refused.kind] += 1
            return False

    def take_part(self, block, number):
        if block.block.m or len(block.payload) <= PART_HEAD_BYTES:
            raise Damaged("a part without a piece")
        index, count, size = struct.unpack_from("<2IQ", block.payload)
        piece = block.payload[PART_HEAD_BYTES:]
        if count < 2 or index >= count or number <= index or size % 8 or size > MAX_BLOCK_BYTES:
            raise Damaged("the head of a part")
        is_last = index == count - 1
        share, odd = divmod(size - len(piece), count - 1) if is_last else (len(piece), 0)
        if odd or share <= 0 or share % 8 or len(piece) != (size - (count - 1) * share if is_last else share):
            raise Damaged("a part of another size")
        if not 0 < size - (count - 1) * share <= share:
            raise Damaged("a part of another size")
        last = number + count - 1 - index
        shape = (count, size, share, block.context, block.block.key)
        known, pieces = self.groups.setdefault(last, (shape, {}))
        if known != shape:
            raise Damaged("a part does not fit the others")
        pieces[index] = piece
        self.arrived(block, number)
        if len(pieces) == count:
            del self.groups[last]
            if not self.checked(self.take_joined, b"".join(pieces[i] for i in range(count)), block, last):
                self.numbers.discard(last)

    def take_joined(self, data, part, number):
        head = data[:BLOCK_BYTES]
        if not is_header(head) or len(data) != BLOCK_BYTES + padded(struct.unpack_from("<Q", head, 16)[0]):
            raise Damaged("parts make no block")
        block = parse_block(data)
        if block.block.kind == PART or (block.context, block.block.key) != (part.context, part.block.key) or (
                block.block.commit != self.session << 32 | number):
            raise Damaged("parts make another block")
        self.take_whole(block, number)
        self.count_number(block, number)

    # What whole blocks hold.

    def take_whole(self, block, number):
        kind = block.block.kind
        if kind in (MAP_HEADER, GONE, END) and block.block.key:
            raise Damaged("a key in a block of no patch")
        if kind == MAP_HEADER:
            self.take_header(block, number)
        elif kind in (LAYER, GONE, END):
            if block.context in self.headers:
                self.take_content(block, number)
            else:
                self.waiting[number] = block
        elif INDEX_PAGE <= kind <= FOOTER:
            raise Damaged("a block of a file in a stream")
        elif block.block.flags & 1:
            raise Unsupported(f"block of kind {kind}")
        elif block.block.key:
            raise Damaged("a key in a block of no patch")

    def take_header(self, block, number):
        if block.context != block.block.hash:
            raise Damaged("a header is not under its own hash")
        if block.block.m != block.block.p or block.block.p > MAX_HEADER_BYTES:
            raise Damaged("a header with a body")
        header = MapHeader(block.payload, 0)
        self.headers[block.context] = header
        if number > self.header_number:
            self.header_number = number
            if self.shown != block.context:
                self.map.set_header(header)
            self.shown = block.context
        self.numbers.add(number)  # an End that waited counts it
        for waited in sorted(n for n, other in self.waiting.items() if other.context == block.context):
            if not self.checked(self.take_content, self.waiting.pop(waited), waited):
                self.numbers.discard(waited)

    def take_content(self, block, number):
        header = self.headers[block.context]
        {LAYER: self.take_layer, GONE: self.take_gone, END: self.take_end}[block.block.kind](block, header, number)

    def is_newest(self, x, y, name, number):
        newest = self.newest.get((x, y, name), 0) <= number
        if newest:
            self.newest[x, y, name] = number
        self.counts["superseded"] += not newest
        return newest

    def take_layer(self, block, header, number):
        if block.block.m > MAX_LAYER_FLAT:
            raise Damaged("the FlatBuffer of a layer is larger than 4096 bytes")
        table = Table.root(block.payload[:block.block.m], 0)
        x, y, type_number, step, encoding = (table.get(0, "int"), table.get(1, "int"), table.get(2, "ushort"),
                                             table.get(3, "ubyte"), table.get(4, "ubyte"))
        if block.block.key != curve_key(x, y):
            raise Damaged("a key does not fit its patch")
        if type_number >= len(header.types) or step > MAX_STEP or not 0 <= table.get(7, "float") <= 1:
            raise Damaged("a layer without sense")
        kind = header.types[type_number]
        if block.block.size > most_block_bytes(kind, step):
            raise Damaged("a block larger than its layer allows")
        if encoding >= len(cells.ENCODINGS):
            raise Unsupported(f"encoding {encoding}")
        self.counts["layers"] += 1
        if self.is_newest(x, y, kind.name, number):
            self.keep(block, header, kind, table, number)

    def keep(self, block, header, kind, table, number):
        """A layer whose cells are not right is not usable, which costs no more than the layer."""
        types = {other.name: other.place(0) for other in self.map.header.types}
        try:
            if header.frame() != self.map.header.frame() or types.get(kind.name) != kind.place(0):
                raise Damaged("a layer of another header")
            line = read_cells(table, block.payload[block.block.m:], kind, 0)
        except Damaged:
            self.counts["unusable"] += 1
            return
        self.map.layers[*line["patch"], kind.name] = (self.base + number, line, table.get(6, "ulong"))

    def take_gone(self, block, header, number):
        if block.block.m or not block.payload or len(block.payload) % GONE_BYTES:
            raise Damaged("records of gone layers")
        records = list(struct.iter_unpack("<2iH6s", block.payload))
        places = [(curve_key(x, y), kind) for x, y, kind, _ in records]
        if len(records) > MAX_GONE or any(a >= b for a, b in zip(places, places[1:])) or any(
                kind >= len(header.types) or any(zero) for _, _, kind, zero in records):
            raise Damaged("records of gone layers")
        self.counts["gone"] += len(records)
        for x, y, kind, _ in records:
            name = header.types[kind].name
            if self.is_newest(x, y, name, number) and header.frame() == self.map.header.frame():
                self.map.layers.pop((x, y, name), None)

    def take_end(self, block, header, number):
        if block.block.m or len(block.payload) != END_BYTES:
            raise Damaged("the end of a message")
        layers, gone, first, flags, result, base = struct.unpack("<4Q16s16s", block.payload)
        if flags > 1 or first >> 32 != self.session or not 1 <= first & 0xFFFFFFFF <= number:
            raise Damaged("the end of a message")
        first &= 0xFFFFFFFF
        missing = sum(n not in self.numbers for n in range(first, number))
        self.counts["messages"] += 1
        self.ends.append({"base": id_text(base), "result": id_text(result), "whole": flags == 1, "layers": layers,
                          "gone": gone, "missing": missing})
        if not self.said or self.base + number > self.said[0]:
            self.said = self.base + number, id_text(result)
        if flags and not missing:
            first += self.base
            self.map.layers = {at: kept for at, kept in self.map.layers.items() if kept[0] >= first}

    def dump(self):
        found = self.map.dump()
        said = self.said[1] if self.said else ""
        faults = "damaged lost late incomplete without_header unsupported skipped_bytes".split()
        return {"bytes": len(self.data), "ends": self.ends, "map": found,
                "as_said": said == found["content_id"] if said else None,
                "complete": self.newest_kind == END and not any(self.counts[name] for name in faults),
                "counts": {name: self.counts[name] for name in COUNTS}}


def id_text(raw):
    return raw.hex() if any(raw) else ""
