"""``python -m jaxclay.cli``."""

from jaxclay.cli.main import entry

entry()
