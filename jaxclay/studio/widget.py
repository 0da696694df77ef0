"""The modeller in Jupyter: an anywidget with ``static/studio.js`` for its front end."""

from __future__ import annotations

import asyncio
import contextlib
import math
from pathlib import Path
from typing import Any

from jaxclay.clay.clay import Clay
from jaxclay.files.piece import Piece
from jaxclay.files.stroke import Solver
from jaxclay.model.material import Material
from jaxclay.numerics.checks import needing
from jaxclay.studio.messages import Desk
from jaxclay.studio.modeller import Modeller
from jaxclay.studio.solving import FIXED, OFFERED, SCHEMES, Compilations, is_adaptive
from jaxclay.studio.starts import STARTS

with needing("studio", "jaxclay.studio.Studio"):
    import anywidget
    import traitlets

_SOON = 1e-3  # seconds
_UNITS = 64  # slices whose raw differences alpha and beta weigh: snake units
_SETTINGS = ("k", "mu", "alpha", "beta", "method", "scheme", "slices")


class Studio(anywidget.AnyWidget):
    """A piece of clay to be shaped with the pointer: the system of Figs. 6 and 7 (eqs. 1 to 22).

    Parameters
    ----------
    clay : Clay or Piece, optional
        What to begin with; a cylinder if not given.
    material : Material, optional
        Of strokes to come.
    target : Clay, optional
        Whose outline is drawn behind the clay.

    Attributes
    ----------
    modeller : Modeller
        The piece, its strokes, undo: usable from Python beside the pointer.
    k, mu, alpha, beta : float
        The material, alpha and beta in snake units of 64 slices.
    method, scheme : str
    slices : int
        How strokes are solved; 0 slices for as many as the tolerance needs.
    """

    _esm = Path(__file__).parent / "static" / "studio.js"
    k = traitlets.Float(1.0).tag(sync=True)
    mu = traitlets.Float(1.0).tag(sync=True)
    alpha = traitlets.Float(1.0).tag(sync=True)
    beta = traitlets.Float(1.0).tag(sync=True)
    method = traitlets.Enum(OFFERED, "newton").tag(sync=True)
    scheme = traitlets.Enum(SCHEMES, "slices").tag(sync=True)
    slices = traitlets.Enum(FIXED, 0).tag(sync=True)
    prepared = traitlets.Dict().tag(sync=True)

    def __init__(
        self,
        clay: Clay | Piece | None = None,
        material: Material | None = None,
        target: Clay | None = None,
        *,
        compilations: Compilations | None = None,
    ):
        self.modeller = Modeller(STARTS["cylinder"]() if clay is None else clay, material, target)
        self._compilations = Compilations() if compilations is None else compilations
        self._compilations.told = self._tell_prepared
        self._desk = Desk(self.modeller, self._compilations)
        super().__init__(**self._constants(), prepared=self._desk.state())
        self.on_msg(self._asked)
        self.observe(self._set, _SETTINGS)
        self._compilations.start()

    @property
    def clay(self) -> Clay:
        """The clay as it is now."""
        return self.modeller.clay

    @traitlets.validate("k", "mu", "alpha", "beta")
    def _checked(self, proposal: Any) -> float:
        name, value = proposal["trait"].name, proposal["value"]
        if not math.isfinite(value) or value < 0 or (name == "k" and value == 0):
            least = "above 0" if name == "k" else "at least 0"
            raise traitlets.TraitError(f"{name} must be finite and {least}, got {value:g}")
        return value

    def set_state(self, sync_data: dict[str, Any]) -> None:
        """Take settings from the front end, those that are allowed; others are refused."""
        try:
            for name, value in sync_data.items():
                if name not in _SETTINGS:
                    raise ValueError(f"{name[:40]!r} is no setting: {', '.join(_SETTINGS)} are")
                if type(value) is bool:
                    raise ValueError(f"{name} must not be {value}")
            super().set_state(sync_data)
        except (traitlets.TraitError, ValueError, TypeError, OverflowError) as error:
            self.send({"type": "refused", "message": str(error)[:300], "view": "", "id": 0})
            self.send_state(list(_SETTINGS))

    def left(self, view: str) -> None:
        """A view is gone: what it was drawing is done."""
        for content, buffers in self._desk.left(view):
            self.send(content, buffers)

    def _asked(self, _widget: Any, message: Any, buffers: list) -> None:
        for content, sent in self._desk.answer(message, buffers):
            if content["type"] == "material":
                with self.hold_trait_notifications():
                    for name, value in self._constants().items():
                        self.set_trait(name, value)
                continue
            self.send(content, sent)
        with contextlib.suppress(RuntimeError):  # no loop runs: the next message finds it undone
            # Once the answer is on its way.
            asyncio.get_running_loop().call_later(_SOON, self._desk.work_ahead)

    def _constants(self) -> dict[str, float]:
        m = self.modeller.material
        return {
            "k": float(m.k), "mu": float(m.mu), "alpha": float(m.alpha) * _UNITS**2,
            "beta": float(m.beta) * _UNITS**4,
        }  # fmt: skip

    def _set(self, _change: Any) -> None:
        now = self._constants()
        if any(getattr(self, name) != now[name] for name in now):
            self.modeller.material = Material.from_snake_units(
                self.k, self.mu, self.alpha, self.beta, _UNITS
            )
        solver = Solver(self.method, self.scheme, self.slices)
        if solver == self.modeller.solver:
            return
        self.modeller.solver = solver
        if not (is_adaptive(solver) or self._compilations.has(solver)):
            self._compilations.start(solver)
        self._tell_prepared()

    def _tell_prepared(self) -> None:
        self.prepared = self._desk.state()
