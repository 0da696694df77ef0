"""Several files of profiles: those that are none are named, and left out or an error."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from jaxclay.files.profiles import read_profile


class RefusedProfile(UserWarning):
    """One of several files is no profile, and was left out; the message names it and says why."""


def only_profiles(files: list[str], minimum_radius: float | None = None) -> list[str]:
    """Those of the files that are profiles.

    Raises
    ------
    ValueError
        None is, or the only one is not: why.

    Warns
    -----
    RefusedProfile
        Some are not: which, and why.
    """
    good, refused = [], []
    for file in files:
        try:
            read_profile(file, minimum_radius)
            good.append(file)
        except (ValueError, OSError) as error:
            refused.append(str(error))
    if not good:
        more = f" (and {len(files) - 1} others are none)" if len(files) > 1 else ""
        raise ValueError(refused[0] + more)
    for message in refused:
        warnings.warn(f"left out {message}", RefusedProfile, stacklevel=2)
    return good


@contextmanager
def refusing(strict: bool) -> Iterator[None]:
    """Files that are refused are named on standard error and left out; or if strict, an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error" if strict else "always", RefusedProfile)
        plain = warnings.showwarning

        def shown(message, category, *rest, **more) -> None:
            if category is RefusedProfile:
                print(message, file=sys.stderr)
            else:
                plain(message, category, *rest, **more)

        warnings.showwarning = shown
        try:
            yield
        except RefusedProfile as refused:
            raise ValueError(str(refused).removeprefix("left out ")) from None
