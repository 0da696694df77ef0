"""Results on disk: a folder of parquet files that no kill, full disk or second run can spoil.

Each file holds what one batch of tasks came to.  It is written under a hidden name, checked onto
the disk and renamed, so that a file under its own name is whole.  Rows are found by their task's
key: the same task done twice, by two runs at once, counts once.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shlex
import time
import warnings
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from jaxclay.experiments.columns import SCHEMA
from jaxclay.experiments.solving.solve import Row
from jaxclay.files.replacing import replacing

_FOLDER, _EXPERIMENTS = "results", "experiments"
_PATTERN = "part-*.parquet"
_ABANDONED = 3600.0  # seconds after which a hidden file has lost its writer


class Store:
    """The results of a folder, to be added to; until then nothing is written."""

    def __init__(self, folder: Path):
        self.folder = folder / _FOLDER
        self._known: dict[str, dict[str, str]] = {}
        for path in self.folder.glob(".part-*"):  # which a killed run left
            with contextlib.suppress(OSError):
                if time.time() - path.stat().st_mtime > _ABANDONED:
                    path.unlink()

    def statuses(self) -> dict[str, str]:
        """How each task that is done ended, by its key, whichever run did it.

        Damaged files are set aside.
        """
        there = {path.name: path for path in self.folder.glob(_PATTERN)}
        self._known = {
            name: self._known.get(name) or self._read(path) for name, path in there.items()
        }
        return {key: status for each in self._known.values() for key, status in each.items()}

    def append(self, rows: list[Row]) -> None:
        """Add the rows as one file, whole or not at all.

        Raises OSError: The disk is full or refuses; nothing of these rows is kept.
        """
        keys = "".join(sorted(row["key"] for row in rows))
        name = hashlib.sha256(keys.encode()).hexdigest()[:16]
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"part-{name}.parquet"
        table = pa.Table.from_pylist(rows, schema=SCHEMA)
        with replacing(path) as temporary:
            pq.write_table(table, temporary, compression="zstd", write_page_checksum=True)
            with temporary.open("rb") as file:
                os.fsync(file.fileno())
        self._known[path.name] = {row["key"]: row["status"] for row in rows}

    def _read(self, path: Path) -> dict[str, str]:
        try:
            table = read_part(path)
            return dict(zip(*table.select(["key", "status"]).to_pydict().values(), strict=True))
        except FileNotFoundError:  # another run has set it aside
            return {}
        except (OSError, pa.ArrowException) as error:
            aside = path.with_suffix(".damaged")
            with contextlib.suppress(FileNotFoundError):
                path.replace(aside)
            warnings.warn(
                f"{path} is damaged ({str(error).splitlines()[0]}): it is set aside as "
                f"{aside.name} and its tasks are done again",
                stacklevel=3,
            )
            return {}


def keep_experiment(folder: Path, name: str, text: str) -> None:
    """Keep a copy of an experiment's text, so that a folder says what its results are of.

    Raises OSError: The folder cannot be written to.
    """
    digest = hashlib.sha256(text.encode()).hexdigest()[:8]
    copy = folder / _EXPERIMENTS / f"{name}-{digest}.toml"
    if not copy.exists():
        copy.parent.mkdir(parents=True, exist_ok=True)
        with replacing(copy) as temporary:
            temporary.write_text(text, encoding="utf-8")


def experiments(folder: Path) -> list[str]:
    """Names of the experiments that were run into a folder."""
    return sorted(path.stem for path in (folder / _EXPERIMENTS).glob("*.toml"))


def read_part(path: Path, columns: list[str] | None = None) -> pa.Table:
    """One file's rows, its checksums compared.

    Raises OSError, pyarrow.ArrowException: The file is damaged.
    """
    # Opened once, so that a rename under way cannot come between.
    with path.open("rb") as file:
        return pq.ParquetFile(file, page_checksum_verification=True).read(columns)


def parts(folder: Path) -> list[Path]:
    """The files of a folder's results, in the order of their names.

    Raises ValueError: There are none.
    """
    found = sorted((Path(folder) / _FOLDER).glob(_PATTERN))
    if not found:
        made = f"jaxclay sweep EXPERIMENT --out {shlex.quote(str(folder))}"
        raise ValueError(f"no results in {folder}: make some with {made}")
    return found
