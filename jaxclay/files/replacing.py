"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import secrets
import tempfile
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: str | os.PathLike):
    """A new file to write that takes the place of ``path`` when the block ends well.

    A link stays, and what it names is replaced; the mode of a file that was there is kept.  What
    is no regular file, such as a pipe or a device, gets the new file's bytes instead.
    """
    if is_special(path):
        with tempfile.TemporaryDirectory() as folder:
            temporary = Path(folder) / Path(path).name
            yield temporary
            with open(path, "wb") as target:
                target.write(temporary.read_bytes())
        return
    suffix, path = Path(path).suffix, Path(os.path.realpath(path))
    temporary = path.with_name(f".{path.stem}-{secrets.token_hex(4)}{suffix}")
    # Made as open() makes a file, so that it has the mode that the user's umask gives.
    os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    try:
        yield temporary
        if path.exists():
            temporary.chmod(path.stat().st_mode & 0o777)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def is_special(path: str | os.PathLike) -> bool:
    """Whether there is something that is no regular file, itself or by a link."""
    return os.path.exists(path) and not os.path.isfile(path)
