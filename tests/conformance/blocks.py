"""Preamble and blocks (docs/format.md, sections 2.1 and 2.2), and the key of section 7."""

import os
import struct
from collections import namedtuple

import xxhash

from errors import Damaged, Foreign, Unsupported

MAGIC, SYNC, END = b"\x89APGM\r\n\x1a", b"APGMBLK1", b"APGMEND1"
MAP_HEADER, LAYER, INDEX_PAGE, INDEX_ROOT, FOOTER = 1, 2, 3, 4, 5
PREAMBLE_BYTES, BLOCK_BYTES, FOOTER_BLOCK_BYTES = 64, 64, 256

Block = namedtuple("Block", "kind flags version m p key commit hash offset size")

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


class Bytes:
    """A file, and the blocks in it."""

    def __init__(self, path):
        self.stream = open(path, "rb")
        self.size = os.fstat(self.stream.fileno()).st_size

    def read(self, offset, size):
        if offset < 0 or offset + size > self.size:
            raise Damaged(f"{size} bytes lie outside the file", offset)
        self.stream.seek(offset)
        data = self.stream.read(size)
        if len(data) != size:
            raise Damaged("the file ended while it was read", offset)
        return data

    def read_preamble(self):
        """Version, and whether the file is an archive."""
        head = self.read(0, min(self.size, PREAMBLE_BYTES))
        if head[:8] != MAGIC:
            raise Foreign("not an .apgm file")
        if len(head) < PREAMBLE_BYTES:
            raise Damaged("the file is cut off", self.size)
        major, minor, incompat, compat, stored = struct.unpack("<HHI4xI32xQ", head[8:])
        if stored != hash_of(head[:56]):
            raise Damaged("hash of the preamble", 0)
        if major != 1:
            raise Unsupported(f"version {major}.{minor}", 8)
        if incompat:
            raise Unsupported(f"features {incompat:#x}", 12)
        return [major, minor], bool(compat & 1)

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
