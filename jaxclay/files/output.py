"""What commands print and where they write: neither may cost anybody a result.

Whoever reads what is printed may stop, close the terminal or know ASCII alone, and is never left
without a word for long; a folder that cannot be written to is found before the work.
"""

from __future__ import annotations

import contextlib
import errno
import io
import math
import os
import stat
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

SILENT = 8.0  # seconds, at most, without a word
_ROOM = 2**16  # bytes that a folder has to take beforehand


class _Patient:
    """A stream of text that goes on, into nothing, where nobody can read it any more."""

    def __init__(self, stream: Any):
        self._stream = io.StringIO() if stream is None else stream  # None where it was closed
        self.last = time.monotonic()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write, with escapes for characters that the stream does not know."""
        self.last = max(self.last, time.monotonic())
        try:
            self._stream.write(text)
        except UnicodeEncodeError:
            encoding = self._stream.encoding
            self._stream.write(text.encode(encoding, "backslashreplace").decode(encoding))
        except OSError as error:
            self._into_nothing(error)
        return len(text)

    def flush(self) -> None:
        """Pass on what has been written, if anybody still reads it."""
        try:
            self._stream.flush()
        except OSError as error:
            self._into_nothing(error)

    def _into_nothing(self, error: OSError) -> None:
        """Go on without a reader; raise what has another reason."""
        if not (isinstance(error, BrokenPipeError) or self._is_hung_up(error)):
            raise error
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, self._stream.fileno())
        os.close(nothing)

    def _is_hung_up(self, error: OSError) -> bool:
        """Whether it is a terminal that has been closed."""
        return error.errno == errno.EIO and stat.S_ISCHR(os.fstat(self._stream.fileno()).st_mode)


@contextlib.contextmanager
def patient_output() -> Iterator[None]:
    """Standard output and error that take all that is printed, read or not.

    Where they fail for another reason, such as a full disk, printing and flushing still raise.
    After some seconds without a word a line on standard error says that the work goes on.
    """
    out, err = _Patient(sys.stdout), _Patient(sys.stderr)
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):  # type: ignore[type-var]
        ended = threading.Event()
        speaker = threading.Thread(target=_speak, args=(ended, out, err), daemon=True)
        speaker.start()
        try:
            yield
        finally:
            ended.set()
            speaker.join()
            for stream in (out, err):
                with contextlib.suppress(OSError):  # told already, or nobody could be told
                    stream.flush()


def _speak(ended: threading.Event, out: _Patient, err: _Patient) -> None:
    begin = time.monotonic()
    while True:
        now = time.monotonic()
        due = max(out.last, err.last) + SILENT
        if now >= due:
            with contextlib.suppress(OSError, ValueError):  # nobody may read it any more
                err.write(f"still at work after {now - begin:.0f} s\n")
                err.flush()
            due = now + SILENT
        if ended.wait(min(due - now, SILENT)):
            return


def stay_silent() -> None:
    """Say no more that the work goes on: this process waits for others."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, _Patient):
            stream.last = math.inf


def open_streams() -> None:
    """Let what was closed of the three standard streams be the null device.

    Or the first files that are opened take their numbers, and what a library says on standard
    error lands in a file of results.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free


def check_folder(folder: Path) -> None:
    """Raise before the work if results cannot be kept in a folder, or where it is to be made.

    Raises
    ------
    OSError
        It is read-only, full, or no folder: named with the reason.
    """
    if os.path.lexists(folder) and not folder.exists():
        raise FileNotFoundError(errno.ENOENT, "a link to what is not there", str(folder))
    there = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    try:
        with tempfile.TemporaryFile(dir=there) as probe:
            probe.write(bytes(_ROOM))
    except OSError as error:
        raise OSError(error.errno, os.strerror(error.errno or 0), str(there)) from None


def check_target(path: Path) -> None:
    """Raise before the work if a file cannot be written; its folder is there.

    Raises
    ------
    OSError
        Its folder is read-only or full, or it is a device that takes nothing.
    """
    if not os.path.exists(path) or path.is_file():
        check_folder(Path(os.path.realpath(path)).parent)
    elif path.is_char_device():
        device = os.open(path, os.O_WRONLY | os.O_NOCTTY)
        try:
            os.write(device, b"")  # a device that is full says so
        except OSError as error:
            raise OSError(error.errno, os.strerror(error.errno or 0), str(path)) from None
        finally:
            os.close(device)
