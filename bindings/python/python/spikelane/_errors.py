"""Exceptions of the package; each class also derives from the matching built-in exception."""

from __future__ import annotations

import errno as _errno
import warnings
from pathlib import Path


class SpikelaneError(ValueError):
    """The error of a failed simulation, read or write; the message names the cause and the remedy.

    All fields are str. ``kind`` is "usage", "config", "input", "type", "io", "space", "exists", "tool", "corrupt",
    "busy", "requeue" or "interrupted". ``subject`` is the file or argument. ``subject``, ``found``, ``expected`` and
    ``remedy`` can be empty.
    """

    kind: str = ""
    subject: str = ""
    found: str = ""
    expected: str = ""
    remedy: str = ""

    def __reduce__(self) -> tuple[object, ...]:
        return (type(self), self.args, dict(self.__dict__))


class SpikelaneTypeError(SpikelaneError, TypeError):
    """An argument has the wrong type or dtype; also a TypeError."""


class SpikelaneOSError(SpikelaneError, OSError):
    """The operating system rejected an operation; also an OSError with errno."""


class SpikelaneFileNotFoundError(SpikelaneOSError, FileNotFoundError):
    """A file does not exist; also a FileNotFoundError."""


class SpikelaneFileExistsError(SpikelaneOSError, FileExistsError):
    """A file exists and the call does not allow overwriting; also a FileExistsError."""


class SpikelaneWarning(UserWarning):
    """Light that is simulated, but probably not as the caller means it."""


def make_error(
    message: str, fields: tuple[str, str, str, str, str], number: int | None, missing: bool
) -> BaseException:
    """Returns an exception of the matching class with its fields set."""
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
        if fields[4] == "check the path":
            start = f"; relative paths start at {Path.cwd()}"
            fields, message = (*fields[:4], fields[4] + start), message + start
    elif kind in ("io", "space"):
        chosen = SpikelaneOSError
    error = chosen(message)
    error.kind, error.subject, error.found, error.expected, error.remedy = fields
    if isinstance(error, OSError):
        error.errno = number
    return error


def usage_error(subject: str, found: object, expected: str, remedy: str) -> BaseException:
    """The exception for a wrong value of the argument ``subject``."""
    return _error("usage", subject, found, expected, remedy)


def type_error(subject: str, found: object, expected: str, remedy: str) -> BaseException:
    """The exception for an argument of a wrong type."""
    return _error("type", subject, found, expected, remedy)


def _error(kind: str, subject: str, found: object, expected: str, remedy: str) -> BaseException:
    text = f"{subject}: found {found}, expected {expected}; {remedy}"
    return make_error(text, (kind, subject, str(found), expected, remedy), None, False)


def warn(text: str) -> None:
    """Warns at the line of the caller of this package."""
    warnings.warn(text, SpikelaneWarning, stacklevel=2)
