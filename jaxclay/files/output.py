"""What commands print must cost nobody a result: whoever reads it may stop, or know ASCII alone."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Iterator
from typing import Any


class _Patient:
    """A stream of text that goes on, into nothing, where the pipe behind it has been closed."""

    def __init__(self, stream: Any):
        self._stream = io.StringIO() if stream is None else stream  # None where it was closed

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write, with escapes for characters that the stream does not know."""
        try:
            self._stream.write(text)
        except UnicodeEncodeError:
            encoding = self._stream.encoding
            self._stream.write(text.encode(encoding, "backslashreplace").decode(encoding))
        except BrokenPipeError:
            self._into_nothing()
        return len(text)

    def flush(self) -> None:
        """Pass on what has been written, if anybody still reads it."""
        try:
            self._stream.flush()
        except BrokenPipeError:
            self._into_nothing()

    def _into_nothing(self) -> None:
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, self._stream.fileno())
        os.close(nothing)


@contextlib.contextmanager
def patient_output() -> Iterator[None]:
    """Standard output and error that take all that is printed, read or not.

    Where they fail for another reason, such as a full disk, printing and flushing still raise.
    """
    out, err = _Patient(sys.stdout), _Patient(sys.stderr)
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):  # type: ignore[type-var]
        try:
            yield
        finally:
            for stream in (out, err):
                with contextlib.suppress(OSError):  # told already, or nobody could be told
                    stream.flush()
