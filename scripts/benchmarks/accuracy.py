"""Speed against accuracy on random scenes: medians, orders and the picture."""

from jaxclay.experiments.compare.accuracy_command import main

if __name__ == "__main__":
    raise SystemExit(main())
