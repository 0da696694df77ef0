"""The methods, one file each; :data:`METHODS` is the table of them."""

from __future__ import annotations

from jaxclay.methods import newton
from jaxclay.methods.base import Method

METHODS: dict[str, Method] = {
    "newton": newton.METHOD,
}
