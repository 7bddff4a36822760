"""How likely it is that a DAP tells a responder at a given place to be near."""

from __future__ import annotations

from typing import Annotated, TypeAlias

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]


class ProximityModel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """To be told near is to be at the DAP, give or take ``sd_m`` to the north and to the east.

    Only nearness is used, no range, and the DAP counts as known exactly, frozen at its installer's
    estimate ("Indoor location tracking for first responders using data network"). While a
    responder stands, one DAP's repeats all tell the same: the next counts after ``again_after_m``.
    """

    sd_m: Annotated[float, Meta(ge=0.1, le=100.0)] = 2.5
    again_after_m: Annotated[float, Meta(ge=0.0, le=100.0)] = 1.0

    def log_likelihood(
        self, north_m: Floats, east_m: Floats, dap_north_m: float, dap_east_m: float
    ) -> Floats:
        """Return the natural logarithm of the likelihood (n,) of being near at each place (n,)."""
        square_m2 = (north_m - dap_north_m) ** 2 + (east_m - dap_east_m) ** 2
        return square_m2 * (-0.5 / self.sd_m**2)
