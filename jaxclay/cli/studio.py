"""``jaxclay studio``: the interactive modeller on a page of its own."""

from __future__ import annotations

import argparse
import asyncio
import sys
from typing import Any

from jaxclay.files.output import stay_silent
from jaxclay.files.profiles import PROFILES


def add_to(commands) -> None:
    """Add the command."""
    command = commands.add_parser(
        "studio",
        help="shape clay with the pointer, in a browser",
        description="Serve the interactive modeller on a page of this machine alone, until Ctrl-C.",
    )
    command.add_argument(
        "profile", nargs="?",
        help=f"{', '.join(PROFILES)}, a table of height and radius (CSV), or a piece (JSON) "
        "(default: a cylinder)",
    )  # fmt: skip
    command.add_argument("--target", metavar="CSV", help="profile whose outline is to be met")
    command.add_argument(
        "--port", type=int, default=0, metavar="N", help="default: any that is free"
    )
    command.add_argument("--open", action="store_true", help="open the page in the browser")
    command.set_defaults(run=_studio)


def _studio(options: argparse.Namespace) -> int:
    from jaxclay.files.profiles import read_profile
    from jaxclay.studio.host import Host
    from jaxclay.studio.starts import piece_of

    if not 0 <= options.port < 65_536:
        raise ValueError(f"--port must lie between 0 and 65535, got {options.port}")
    piece, target = None, None
    if options.profile is not None:
        profile = read_profile(options.profile)
        piece = piece_of(profile)
        if profile.said:
            print(f"{profile.name}: {profile.said}", file=sys.stderr)
    if options.target is not None:
        target = read_profile(options.target).cut().clay

    def make() -> Any:
        from jaxclay.studio.widget import Studio

        return Studio(piece, target=target)

    def started(address: str) -> None:
        print(f"jaxclay studio: {address} (Ctrl-C ends it)", flush=True)
        if options.open:
            import webbrowser

            webbrowser.open(address)

    stay_silent()
    try:
        asyncio.run(Host(make, options.port).run(started))
    except KeyboardInterrupt:
        print("jaxclay studio: ended", file=sys.stderr)
    return 0
