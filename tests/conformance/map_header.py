"""MapHeader: FlatBuffer to header, with the limits of docs/format.md, section 3."""

import re

from errors import Damaged, Unsupported
from flatbuffer import Table

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+-]{0,63}")
OCCUPANCY_POLICIES = ("exclusive", "conditional", "min", "product", "median", "dempster")
REAL_POLICIES = ("sum", "minimum", "maximum")
POLICIES = OCCUPANCY_POLICIES + ("evidence", "mean") + REAL_POLICIES
MAX_TYPES, MAX_METADATA, MAX_HISTORY, MAX_INPUTS = 4096, 1024, 1024, 65536
MAX_DATUM, MAX_SLAB = 10**15, 10**12


class LayerType:
    def __init__(self, table, check):
        self.name = table.text(0, required=True)
        self.hypotheses = split(table.text(1))
        self.channels = split(table.text(2, required=True))
        self.policy = table.text(3, required=True)
        self.slab = [table.get(5, "long"), table.get(6, "long")] if table.get(4, "bool") else None
        hypotheses, channels = len(self.hypotheses), len(self.channels)
        for name in [self.name, *self.hypotheses, *self.channels]:
            check(NAME.fullmatch(name), f"'{name}' is not a name")
        check(hypotheses == 0 or 2 <= hypotheses <= 15, "a type with 1 or more than 15 hypotheses")
        check(1 <= channels <= 16, "a type without or with more than 16 channels")
        check(not hypotheses or channels - hypotheses in (0, 1), "channels do not fit the hypotheses")
        if self.policy not in POLICIES:
            raise Unsupported(f"policy '{self.policy}'", table.at)
        if self.policy in OCCUPANCY_POLICIES:
            check(hypotheses == channels == 2, "the policy is for occupancy")
        if self.policy == "evidence":
            check(hypotheses and channels == hypotheses + 1, "the policy needs m(Omega)")
        if self.policy in REAL_POLICIES:
            check(not hypotheses, "the policy is for real channels")
        if self.slab:
            check(all(abs(z) <= MAX_SLAB for z in self.slab), "a slab beyond its limit")
            check(self.slab[0] < self.slab[1], "an empty slab")

    def place(self, number):
        """What must be the same wherever a Layer block is shared, with the type's number."""
        is_zero = bool(self.hypotheses) or self.policy == "sum"
        return number, self.name, self.hypotheses, self.channels, self.slab, is_zero

    def dump(self):
        return {"name": self.name, "hypotheses": self.hypotheses, "channels": self.channels,
                "policy": self.policy, "slab_um": self.slab}


def split(text):
    return text.split(" ") if text else []


def ascends(items):
    raw = [item.encode() for item in items]
    return all(a < b for a, b in zip(raw, raw[1:]))


def plain(text):
    return not any(c < " " or c == "\x7f" for c in text)


class MapHeader:
    def __init__(self, data, at):
        table = Table.root(data, at)

        def check(fits, text):
            if not fits:
                raise Damaged("header: " + text, at)

        self.edge = table.get(0, "long")
        self.datum = [table.get(1, "long"), table.get(2, "long")]
        self.epsg = table.get(3, "int")
        self.frame_id = table.text(4, required=True)
        self.stamp_ns = table.get(8, "long")
        check(10**3 <= self.edge <= 10**10, "edge out of range")
        check(all(abs(d) <= MAX_DATUM for d in self.datum), "datum out of range")
        check(0 <= self.epsg <= 999999, "EPSG code out of range")
        check(1 <= len(self.frame_id.encode()) <= 255 and plain(self.frame_id), "not a frame id")

        self.types = [LayerType(t, check) for t in table.tables(5, MAX_TYPES)]
        check(ascends([t.name for t in self.types]), "types do not ascend")
        pairs = [(t.text(0, required=True), t.text(1, required=True)) for t in table.tables(6, MAX_METADATA)]
        check(ascends([key for key, _ in pairs]), "metadata do not ascend")
        check(all(key and plain(key) for key, _ in pairs), "not a key")
        self.metadata = dict(pairs)
        self.history = []
        for entry in table.tables(7, MAX_HISTORY):
            operation, parameters = entry.text(0, required=True), entry.text(2) or ""
            inputs = split(entry.text(1))
            check(plain(operation), "operation of a history entry")
            check(len(inputs) <= MAX_INPUTS and all(i and plain(i) for i in inputs), "inputs of a history entry")
            self.history.append({"operation": operation, "inputs": inputs, "parameters": parameters})

    def frame(self):
        return self.edge, *self.datum, self.epsg, self.frame_id

    def dump(self):
        return {"edge_um": self.edge, "datum_um": self.datum, "epsg": self.epsg or None,
                "frame_id": self.frame_id, "stamp_ns": self.stamp_ns,
                "types": [t.dump() for t in self.types], "metadata": self.metadata, "history": self.history}
