"""``python -m jaxclay.cli``."""

from jaxclay.cli.main import entry

if __name__ == "__main__":
    entry()
