"""The three ways in which a file can be refused."""


class Refused(Exception):
    kind = ""

    def __init__(self, text, at=None):
        super().__init__(text if at is None else f"{text} (byte {at})")


class Foreign(Refused):
    """Not an .apgm file."""
    kind = "foreign"


class Damaged(Refused):
    """An .apgm file that breaks a rule of docs/format.md."""
    kind = "damaged"


class Unsupported(Refused):
    """An .apgm file that needs another reader."""
    kind = "unsupported"
