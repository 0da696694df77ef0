"""Ctrl-C while the command ``jaxclay`` is imported, which takes a second or more.

To be imported before all else.  In processes of other programs nothing is changed.
"""

from __future__ import annotations

import os
import signal
import sys

INTERRUPTED = 130  # exit status after Ctrl-C, as shells have it


def _is_command(names: list[str], words: list[str]) -> bool:
    """Whether Python was started by the script ``jaxclay`` or by ``-m jaxclay``."""
    if names == ["-m"]:  # as it is while the module's package is imported
        return words[words.index("-m") + 1].partition(".")[0] == "jaxclay"
    return bool(names) and os.path.basename(names[0]) in ("jaxclay", "jaxclay.exe")


def _end(number, frame) -> None:
    os.write(2, b"jaxclay: interrupted before anything had begun\n")
    os._exit(INTERRUPTED)


if _is_command(sys.argv[:1], sys.orig_argv):
    signal.signal(signal.SIGINT, _end)  # until the command takes over
