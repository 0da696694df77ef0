"""What the studio compiles, once for all tests."""

import pytest

from jaxclay.studio.solving import Compilations


@pytest.fixture(scope="session")
def ready():
    """All sizes compiled, once."""
    compilations = Compilations()
    assert compilations.most == 0
    compilations.run()
    return compilations
