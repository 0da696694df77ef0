"""``python -m jaxclay``: the command ``jaxclay``."""

from jaxclay.cli.main import entry

if __name__ == "__main__":
    entry()
