"""Archives: the end, the chain of footers, what their commits share, tags (docs/format.md, section 11)."""

import re

from blocks import END, FOOTER_BLOCK_BYTES, PREAMBLE_BYTES, SYNC
from commit import lines_sha256, read_footer
from errors import Damaged, Refused

KEYS, MESSAGE, TAGS = "apgm.archive.", "apgm.archive.message", "apgm.archive.tags"
TAG = re.compile(r"([A-Za-z_][A-Za-z0-9_.+-]{0,63})=([1-9][0-9]{0,19})")
SCAN_BYTES = 1 << 16


def last_footer(file):
    """Offset and footer of the last commit, by the three rules of 11.3."""
    offset = file.size - FOOTER_BLOCK_BYTES
    if offset < PREAMBLE_BYTES:
        raise Damaged("the file is cut off", file.size)
    try:
        return offset, read_footer(file, offset)
    except Damaged:
        block = file.read(offset, FOOTER_BLOCK_BYTES)
        if sum(a == b for a, b in zip(block[:8] + block[-8:], SYNC + END)) >= 15:
            raise
    return scan_back(file)


def scan_back(file):
    end = file.size
    while end > PREAMBLE_BYTES:
        start = max(PREAMBLE_BYTES, (end - SCAN_BYTES) // 8 * 8)
        window = file.read(start, min(end + len(SYNC) - 1, file.size) - start)
        at = window.rfind(SYNC)
        while at >= 0:
            found = footer_or_none(file, start + at)
            if found:
                return found
            at = window.rfind(SYNC, 0, at + len(SYNC) - 1)
        end = start
    raise Damaged("an archive without a whole footer", file.size)


def footer_or_none(file, offset):
    try:
        return offset, read_footer(file, offset)
    except Refused:
        return None


def chain(file, offset, footer):
    footers = [(offset, footer)]
    while footer.previous:
        offset, before = footer.previous, read_footer(file, footer.previous)
        if before.number > footer.number:
            raise Damaged("a footer before has a greater number", offset)
        footer = before
        footers.append((offset, footer))
    return footers[::-1]


def check_commits(commits):
    seen = {}
    for commit in commits:
        if commit.header.frame() != commits[0].header.frame():
            raise Damaged("a commit of another frame", commit.footer.header_offset)
        for entry in commit.entries:
            kind = commit.header.types[entry.type].place(entry.type)
            if seen.setdefault(entry.offset, kind) != kind:
                raise Damaged("a layer is shared under another type", entry.offset)
    for before, after in zip(commits, commits[1:]):
        if before.footer.number == after.footer.number and before.footer[3:13] != after.footer[3:13]:
            raise Damaged("a replaced header has another index", after.footer_offset)


def last_of_each(commits):
    return list({commit.footer.number: commit for commit in commits}.values())


def tags(commits):
    """Name to number."""
    text = commits[-1].header.metadata.get(TAGS)
    if text is None:
        return {}
    found = [TAG.fullmatch(pair) for pair in text.split(" ")]
    at = commits[-1].footer.header_offset
    if not all(found):
        raise Damaged("malformed tags", at)
    names = [match[1] for match in found]
    if any(a >= b for a, b in zip(names, names[1:])):
        raise Damaged("tags do not ascend", at)
    numbers = {commit.footer.number for commit in commits}
    if not all(int(match[2]) in numbers for match in found):
        raise Damaged("a tag of no commit", at)
    return {match[1]: int(match[2]) for match in found}


def log(commits, names):
    """`commits` of a dump."""
    out, end = [], 0
    for commit in last_of_each(commits):
        footer = commit.footer
        out.append({"number": footer.number, "content_id": commit.content_id, "stamp_ns": commit.header.stamp_ns,
                    "patches": footer.patches, "layers": footer.layers, "added_bytes": commit.end - end,
                    "message": commit.header.metadata.get(MESSAGE, ""),
                    "tags": sorted(name for name, number in names.items() if number == footer.number),
                    "list_sha256": lines_sha256(commit.lines)})
        end = commit.end
    return out


def without_its_keys(metadata):
    return {key: value for key, value in metadata.items() if not key.startswith(KEYS)}
