"""Readings brought to the product's scale: by the make of the radio, and by who set the DAP down.

Radios differ, and so do places: a box behind a metal cabinet hears everybody weakly. The installer
stands beside it at the moment of installation, and what their readings then lack of the nominal
power at arm's length is the offset of this link, known to some decibels. Part of it is the box's,
and holds for everybody.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import hypot, pi, sqrt
from typing import Annotated, NamedTuple, TypeAlias

import msgspec
from msgspec import Meta

from shared.messages import NodeId
from shared.rssi_window import Readings
from shared.units import NS_PER_S

Decibel: TypeAlias = Annotated[float, Meta(gt=0.0, le=60.0)]
Duration: TypeAlias = Annotated[float, Meta(gt=0.0, le=60.0)]

DEVIATION_TO_SIGMA = 1.4826
"""Standard deviation of a Gaussian by its median absolute deviation."""

LEAST_SIGMA_DB = 1.0
"""Readings are whole decibels: where all are alike they are still no better known."""


class CalibrationSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How much the installer's readings beside the box are worth.

    Those from ``before_s`` before to ``after_s`` after the installation count, if there are
    ``least_samples``. Who stands over a box on the floor, half the time with the body in between,
    gives ``beside_dbm`` on average; body, range and place make this differ from one installation to
    the next by ``beside_sd_db``. Boxes differ by ``box_sd_db``, responders' radios by
    ``radio_sd_db``.
    """

    before_s: Duration = 3.0
    after_s: Duration = 1.5
    least_samples: Annotated[int, Meta(ge=1, le=1000)] = 4
    beside_dbm: Annotated[float, Meta(ge=-200.0, le=100.0)] = -43.0
    beside_sd_db: Decibel = 4.0
    box_sd_db: Decibel = 1.5
    radio_sd_db: Decibel = 2.0


class Calibration(NamedTuple):
    """What is to be added to readings (dB), each with its standard deviation.

    ``installer_db`` to those of the installer, ``others_db`` to everybody else's; of
    ``sample_count`` readings.
    """

    installer_db: float
    installer_sd_db: float
    others_db: float
    others_sd_db: float
    sample_count: int


def calibrate(
    rssi_dbm: Mapping[int, float], set_down_ns: int, settings: CalibrationSettings
) -> Calibration | None:
    """Return what the installer's readings (dBm by time, ns) around ``set_down_ns`` say.

    ``None`` if there are too few. Their median stands up to a third of them being blocked by the
    body. It is weighed with what is known beforehand: that radios differ little (conditional
    Gaussian), so that the less is known of where the installer stood, the less is added.
    """
    from_ns = set_down_ns - round(settings.before_s * NS_PER_S)
    to_ns = set_down_ns + round(settings.after_s * NS_PER_S)
    beside = [dbm for time_ns, dbm in rssi_dbm.items() if from_ns <= time_ns <= to_ns]
    if len(beside) < settings.least_samples:
        return None
    # Of use once, when a box is set down, and to those alone that learn: it is large.
    from statistics import median  # noqa: PLC0415

    level_dbm = median(beside)
    deviation_db = median(abs(dbm - level_dbm) for dbm in beside)
    sigma_db = max(LEAST_SIGMA_DB, DEVIATION_TO_SIGMA * deviation_db)
    # The median of n Gaussian values has π/2 times the variance of their mean.
    seen_db2 = hypot(settings.beside_sd_db, sigma_db * sqrt(pi / 2.0 / len(beside))) ** 2
    lacking_db = settings.beside_dbm - level_dbm
    box_db2, radio_db2 = settings.box_sd_db**2, settings.radio_sd_db**2
    link_db2 = box_db2 + radio_db2
    whole_db2 = link_db2 + seen_db2
    return Calibration(
        installer_db=lacking_db * link_db2 / whole_db2,
        installer_sd_db=sqrt(link_db2 * seen_db2 / whole_db2),
        others_db=lacking_db * box_db2 / whole_db2,
        others_sd_db=sqrt(box_db2 * (1.0 - box_db2 / whole_db2) + radio_db2),
        sample_count=len(beside),
    )


class Scale:
    """Brings a DAP's readings to the product's scale, and learns by whom it was set down.

    ``offset_of_db`` says what is added to a responder's readings for the make of their radio. With
    no ``settings`` nothing is learnt.
    """

    def __init__(
        self, default_db: float, offset_of_db: Mapping[NodeId, float],
        settings: CalibrationSettings | None,
    ) -> None:  # fmt: skip
        self._default_db = default_db
        self._offset_of_db = offset_of_db
        self._settings = settings
        self._readings: dict[NodeId, Readings] = {}
        self._set_down: tuple[int, NodeId] | None = None
        self._installer_id: NodeId | None = None
        self._learnt: Calibration | None = None

    def calibrated_dbm(self, time_ns: int, responder_id: NodeId, rssi_dbm: float) -> float:
        """Return a reading on the product's scale."""
        made_dbm = rssi_dbm + self._offset_of_db.get(responder_id, self._default_db)
        if self._settings is not None:
            readings = self._readings.setdefault(responder_id, Readings())
            readings.add(time_ns, made_dbm)
            readings.forget_until(time_ns - round(2.0 * self._settings.before_s * NS_PER_S))
        if self._learnt is None:
            return made_dbm
        own = responder_id == self._installer_id
        return made_dbm + (self._learnt.installer_db if own else self._learnt.others_db)

    def set_down(self, time_ns: int, installer_id: NodeId | None) -> None:
        """Note when the DAP was set down, and by whom; what was learnt elsewhere is forgotten."""
        self._learnt = None
        self._set_down = None if installer_id is None else (time_ns, installer_id)

    def tick(self, now_ns: int) -> Calibration | None:
        """Return what has been learnt, once all is heard that it is learnt from."""
        if self._settings is None or self._set_down is None:
            return None
        time_ns, installer_id = self._set_down
        until_ns = time_ns + round(self._settings.after_s * NS_PER_S)
        if now_ns < until_ns:
            return None
        self._set_down, self._installer_id = None, installer_id
        since_ns = time_ns - round(self._settings.before_s * NS_PER_S)
        heard = self._readings.get(installer_id, Readings()).between(since_ns - 1, until_ns)
        self._learnt = calibrate(heard, time_ns, self._settings)
        return self._learnt
