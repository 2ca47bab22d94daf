"""Exceptions: one family whose members are also what Python calls such mistakes."""

from __future__ import annotations

import errno as _errno


class SpikelaneError(ValueError):
    """Something cannot be simulated, read or written; the message says what, and what to do.

    Fields, each a str: ``kind`` ("usage", "config", "input", "type", "io", "space", "exists", "tool", "corrupt",
    "busy", "requeue", "interrupted"), ``subject`` (the file or argument), ``found``, ``expected``, ``remedy`` (each may
    be empty).
    """

    kind: str = ""
    subject: str = ""
    found: str = ""
    expected: str = ""
    remedy: str = ""

    def __reduce__(self) -> tuple[object, ...]:
        return (type(self), self.args, dict(self.__dict__))


class SpikelaneTypeError(SpikelaneError, TypeError):
    """An argument of another type or dtype; also a TypeError."""


class SpikelaneOSError(SpikelaneError, OSError):
    """What the operating system refused; also an OSError, with its errno."""


class SpikelaneFileNotFoundError(SpikelaneOSError, FileNotFoundError):
    """A file that is not there; also a FileNotFoundError."""


class SpikelaneFileExistsError(SpikelaneOSError, FileExistsError):
    """A file that is there already, and nobody allowed replacing it; also a FileExistsError."""


def make_error(
    message: str, fields: tuple[str, str, str, str, str], number: int | None, missing: bool
) -> BaseException:
    """The exception of the fitting class, with its fields."""
    kind = fields[0]
    if kind == "interrupted":
        return KeyboardInterrupt(message)
    chosen: type[SpikelaneError] = SpikelaneError
    if kind == "type":
        chosen = SpikelaneTypeError
    elif kind == "exists":
        chosen, number = SpikelaneFileExistsError, number or _errno.EEXIST
    elif missing:
        chosen = SpikelaneFileNotFoundError
    elif kind in ("io", "space"):
        chosen = SpikelaneOSError
    error = chosen(message)
    error.kind, error.subject, error.found, error.expected, error.remedy = fields
    if isinstance(error, OSError):
        error.errno = number
    return error
