"""FlatBuffers by hand: just what the tables of schema/apgm.fbs need, every access inside the buffer."""

import struct

from errors import Damaged

MAX_TEXT_BYTES = 16 << 20
SCALARS = {"bool": "<B", "ubyte": "<B", "ushort": "<H", "int": "<i", "uint": "<I", "long": "<q", "ulong": "<Q",
           "float": "<f"}


class Table:
    """A table at `pos` of `data`; fields by their id. `at` is the file offset of data[0], for messages.

    Texts may share their place, so the size of `data` does not bound what they take: `left` does.
    """

    def __init__(self, data, pos, at, left):
        self.data, self.pos, self.at, self.left = data, pos, at, left
        if pos % 4:
            raise self.damaged("a table is not aligned")
        vtable = pos - self.scalar("<i", pos)
        if vtable < 0 or vtable % 2:
            raise self.damaged("a vtable lies outside")
        size = self.scalar("<H", vtable)
        if size < 4 or size % 2 or vtable + size > len(data):
            raise self.damaged("a vtable has no possible size")
        self.slots = struct.unpack_from(f"<{size // 2 - 2}H", data, vtable + 4)

    @classmethod
    def root(cls, data, at):
        if len(data) < 8:
            raise Damaged("the FlatBuffer is too short", at)
        return cls(data, struct.unpack_from("<I", data)[0], at, [MAX_TEXT_BYTES])

    def damaged(self, text):
        return Damaged("FlatBuffer: " + text, self.at)

    def scalar(self, code, pos):
        size = struct.calcsize(code)
        if pos < 0 or pos + size > len(self.data):
            raise self.damaged("a value lies outside")
        if pos % size:
            raise self.damaged("a value is not aligned")
        return struct.unpack_from(code, self.data, pos)[0]

    def place(self, field):
        """Position of a field, None where it is absent."""
        offset = self.slots[field] if field < len(self.slots) else 0
        return self.pos + offset if offset else None

    def get(self, field, kind):
        pos = self.place(field)
        return 0 if pos is None else self.scalar(SCALARS[kind], pos)

    def follow(self, pos):
        """Target of the offset at `pos`."""
        offset = self.scalar("<I", pos)
        if not offset:
            raise self.damaged("an offset of 0")
        return pos + offset

    def vector(self, field, item_bytes, alignment):
        """First item and number of items of a vector; (None, 0) where it is absent."""
        pos = self.place(field)
        if pos is None:
            return None, 0
        start = self.follow(pos)
        count = self.scalar("<I", start)
        if start + 4 + count * item_bytes > len(self.data):
            raise self.damaged("a vector lies outside")
        if count and (start + 4) % alignment:
            raise self.damaged("a vector is not aligned")
        return start + 4, count

    def text(self, field, required=False):
        """A string; None where it is absent."""
        start, size = self.vector(field, 1, 1)
        if start is None:
            if required:
                raise self.damaged("a required string is missing")
            return None
        if start + size >= len(self.data) or self.data[start + size] != 0:
            raise self.damaged("a string does not end with NUL")
        self.left[0] -= size
        if self.left[0] < 0:
            raise self.damaged("the texts take more than 16 MiB")
        raw = bytes(self.data[start:start + size])
        try:
            text = raw.decode("utf-8")
        except UnicodeDecodeError:
            raise self.damaged("a text is not UTF-8") from None
        if "\0" in text:
            raise self.damaged("a text holds NUL")
        return text

    def tables(self, field, limit):
        start, count = self.vector(field, 4, 4)
        if count > limit:
            raise self.damaged(f"a list has {count} items, {limit} are allowed")
        return [Table(self.data, self.follow(start + 4 * i), self.at, self.left) for i in range(count)]

    def structs(self, field, code, limit):
        """A vector of structs of 8-byte alignment."""
        size = struct.calcsize(code)
        start, count = self.vector(field, size, 8)
        if count > limit:
            raise self.damaged(f"a list has {count} items, {limit} are allowed")
        return [struct.unpack_from(code, self.data, start + size * i) for i in range(count)]
