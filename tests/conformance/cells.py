"""Bodies of layers to planes of cells, and the rules for cells (docs/format.md, sections 1 and 4)."""

import itertools
import struct
from array import array

import xxhash
import zstandard

from errors import Damaged, Unsupported

QUIET_NAN = 0x7FC00000
ONE = 0x3F800000
MINUS_ZERO = 0x80000000
MAX_LAYER_BYTES = 64 << 20
ENCODINGS = ("constant", "masked32", "palette", "masked16", "masked8")
BITS_OF_BYTE = [bytes(byte >> i & 1 for i in range(8)) for byte in range(256)]


def bits(value):
    return struct.unpack("<I", struct.pack("<f", value))[0]


def value_of(word):
    return struct.unpack("<f", struct.pack("<I", word))[0]


def float32(value):
    """Nearest float32. One operation of float32 is one in double precision, rounded by this."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


MOST, LEAST = value_of(0x3F800008), value_of(0x3F7FFFEF)  # 1 + 1e-6 and 1 - 1e-6


def backgrounds(kind):
    """Bits of the value of each channel in a cell without data."""
    if not kind.hypotheses:
        return [0 if kind.policy == "sum" else QUIET_NAN] * len(kind.channels)
    return [0] * len(kind.hypotheses) + [ONE] * (len(kind.channels) - len(kind.hypotheses))


def frame_bytes(data, at):
    """Content size that the zstd frame at the start of `data` states, and its length (RFC 8878)."""
    try:
        if data[:4] != b"\x28\xb5\x2f\xfd":
            raise Damaged("not a zstd frame", at)
        descriptor = data[4]
        single = descriptor >> 5 & 1
        pos = 5 + (not single) + (0, 1, 2, 4)[descriptor & 3]
        width = (single, 2, 4, 8)[descriptor >> 6]
        if not width:
            raise Damaged("the zstd frame does not state its content size", at)
        size = int.from_bytes(data[pos:pos + width], "little") + (256 if width == 2 else 0)
        pos += width
        last = False
        while not last:
            head = data[pos] | data[pos + 1] << 8 | data[pos + 2] << 16
            last = head & 1
            pos += 3 + (1 if head >> 1 & 3 == 1 else head >> 3)
        pos += 4 * (descriptor >> 2 & 1)
    except IndexError:
        raise Damaged("the zstd frame is cut off", at) from None
    if pos > len(data):
        raise Damaged("the zstd frame is cut off", at)
    return size, pos


def unpack_frame(data, size, at):
    """Content of `data`, which must be exactly one frame of `size` bytes."""
    stated, length = frame_bytes(data, at)
    if stated != size:
        raise Damaged(f"the zstd frame states {stated} bytes, {size} follow from the fields before it", at)
    if length != len(data):
        raise Damaged("bytes follow the zstd frame", at)
    if size == 0:
        return b""
    try:
        content = zstandard.ZstdDecompressor().decompress(bytes(data), max_output_size=size)
    except zstandard.ZstdError as error:
        raise Damaged(f"zstd: {error}", at) from None
    if len(content) != size:
        raise Damaged("the zstd frame holds less than it states", at)
    return content


def join_planes(planes, count):
    """Words from byte planes, the first the least."""
    raw = bytearray(4 * count)
    for k, plane in enumerate(planes):
        raw[k::4] = plane
    return array("I", bytes(raw))


def constant(body, kind, n, at):
    if len(body) != 4 * len(kind.channels):
        raise Damaged("a constant body has another size", at)
    return [array("I", [word]) * n for word in struct.unpack(f"<{len(kind.channels)}I", body)]


def palette(body, kind, n, at):
    channels = len(kind.channels)
    if len(body) < 4:
        raise Damaged("the palette is cut off", at)
    tuples = struct.unpack_from("<I", body)[0]
    if not 1 <= tuples <= 4096:
        raise Damaged(f"a palette of {tuples} tuples", at)
    values, wide = tuples * channels, 2 if tuples > 256 else 1
    content = unpack_frame(body[4:], 4 * values + wide * n, at)
    words = join_planes([content[k * values:(k + 1) * values] for k in (3, 2, 1, 0)], values)
    numbers = content[4 * values:]
    if wide == 2:
        numbers = join_planes([numbers[n:], numbers[:n]], n)
    if max(numbers) >= tuples:
        raise Damaged("a cell names a tuple beyond the palette", at)
    return [array("I", map(words[c::channels].__getitem__, numbers)) for c in range(channels)]


def narrow(words, width):
    """Bits of float32(q) / (2^(8 width) - 1) of each q."""
    if width == 4:
        return words
    table = {q: bits(float32(q / (256**width - 1))) for q in set(words)}
    return array("I", map(table.__getitem__, words))


def masked(body, kind, n, at, width):
    channels = len(kind.channels)
    fixed = 4 * (channels + 2)
    if len(body) < fixed:
        raise Damaged("the masked body is cut off", at)
    *counts, raw_planes, packed = struct.unpack_from(f"<{channels + 2}I", body)
    if raw_planes > (2 if width == 4 else 0):
        raise Damaged(f"{raw_planes} raw byte planes", at)
    if max(counts) > n:
        raise Damaged("more values than cells", at)
    total, mask = sum(counts), (n + 7) // 8
    if len(body) != fixed + packed + raw_planes * total:
        raise Damaged("the masked body has another size", at)
    content = unpack_frame(body[fixed:fixed + packed], channels * mask + (width - raw_planes) * total, at)
    planes = [content[channels * mask + k * total:][:total] for k in range(width - raw_planes)]
    planes += [body[fixed + packed + k * total:][:total] for k in range(raw_planes)]
    words = narrow(join_planes(reversed(planes), total), width)
    result, first = [], 0
    for c, background in enumerate(backgrounds(kind)):
        known = b"".join(map(BITS_OF_BYTE.__getitem__, content[c * mask:(c + 1) * mask]))
        if known.count(1) != counts[c] or any(known[n:]):
            raise Damaged("a mask does not fit the number of values", at)
        plane = array("I", [background]) * n
        for i, word in zip(itertools.compress(range(n), known), words[first:first + counts[c]]):
            plane[i] = word
        first += counts[c]
        result.append(plane)
    return result


def decode(encoding, body, kind, step, at):
    n = 4**step
    if 4 * n * len(kind.channels) > MAX_LAYER_BYTES:
        raise Damaged("a layer larger than 64 MiB", at)
    if encoding >= len(ENCODINGS):
        raise Unsupported(f"encoding {encoding}", at)
    if encoding == 0:
        return constant(body, kind, n, at)
    if encoding == 2:
        return palette(body, kind, n, at)
    return masked(body, kind, n, at, {1: 4, 3: 2, 4: 1}[encoding])


def check_cell(words, kind, at):
    if MINUS_ZERO in words:
        raise Damaged("a value is -0", at)
    values = [value_of(word) for word in words]
    if not kind.hypotheses:
        if any(word & 0x7F800000 == 0x7F800000 and word != QUIET_NAN for word in words):
            raise Damaged("a real value is not finite", at)
        return
    if not all(0 <= value <= 1 for value in values):
        raise Damaged("a mass is outside [0, 1]", at)
    total = 0.0
    for value in values:
        total = float32(total + value)
    if total > MOST or (len(kind.channels) > len(kind.hypotheses) and total < LEAST):
        raise Damaged("masses of a cell do not add up", at)


def check(planes, kind, at):
    """The rules of section 1, once for every tuple of values that occurs."""
    tuples = set(zip(*planes))
    for words in tuples:
        check_cell(words, kind, at)
    if tuples == {tuple(backgrounds(kind))}:
        raise Damaged("a layer without data", at)


def planes_bytes(planes):
    return b"".join(plane.tobytes() for plane in planes)


def content_hash(raw, step, channels):
    return xxhash.xxh3_64_intdigest(raw, seed=step + 256 * channels)
