"""Who is heard by whom, and the DAPs: where they were set down."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from shared.messages.values import (
    Confidence,
    Duration,
    Listed,
    LocalPosition,
    Message,
    NodeId,
    PowerDbm,
    StandardDeviation,
    Words,
)


class RssiReport(Message, frozen=True, kw_only=True):
    """One reading of a responder's signal strength at a DAP."""

    responder_id: NodeId
    rssi_dbm: PowerDbm


class ProximityEvent(Message, frozen=True, kw_only=True, omit_defaults=True):
    """A responder is near a DAP, or has just ceased to be.

    ``entered`` and ``left`` bound a stay; ``near`` repeats while it lasts. Mean and variance are
    of the RSSI over the DAP's window, ``sample_count`` the samples in it. A DAP that weighs
    likelihoods also says the log odds that they are near, and what it holds of the range: mean and
    standard deviation.
    """

    responder_id: NodeId
    phase: Literal["entered", "near", "left"]
    rssi_mean_dbm: PowerDbm
    rssi_variance_db2: StandardDeviation
    sample_count: Annotated[int, Meta(ge=0, le=100_000)]
    near_log_odds: Annotated[float, Meta(ge=-100.0, le=100.0)] | None = None
    range_m: Annotated[float, Meta(ge=0.0, le=1e4)] | None = None
    range_sd_m: Annotated[float, Meta(ge=0.0, le=1e4)] | None = None


class RssiPeak(Message, frozen=True, kw_only=True):
    """A responder passed a DAP: when their signal was strongest, how strong, and for how long.

    ``event_time_ns`` is the power-weighted middle of the readings within 6 dB of the strongest,
    ``width_s`` the time over which they were; the sharper, the nearer and the better known.
    """

    responder_id: NodeId
    peak_dbm: PowerDbm
    width_s: Duration
    sample_count: Annotated[int, Meta(ge=1, le=100_000)]


class DapReading(Message, frozen=True, kw_only=True):
    """One reading of a DAP's signal strength at a responder's unit."""

    dap_id: NodeId
    rssi_dbm: PowerDbm


class DapPeak(Message, frozen=True, kw_only=True):
    """A responder passed a DAP, as their unit heard it: what ``RssiPeak`` says, from this side."""

    dap_id: NodeId
    peak_dbm: PowerDbm
    width_s: Duration
    sample_count: Annotated[int, Meta(ge=1, le=100_000)]


class Contact(Message, frozen=True, kw_only=True):
    """Two responders met: one's unit heard the other's, loudest at ``event_time_ns``."""

    other_id: NodeId
    peak_dbm: PowerDbm
    width_s: Duration
    sample_count: Annotated[int, Meta(ge=1, le=100_000)]


class NeighbourHeard(Message, frozen=True, kw_only=True):
    """A DAP heard another one: mean and variance of its signal over the last seconds."""

    dap_id: NodeId
    rssi_mean_dbm: PowerDbm
    rssi_variance_db2: StandardDeviation
    sample_count: Annotated[int, Meta(ge=1, le=100_000)]


class DapInstallation(Message, frozen=True, kw_only=True, omit_defaults=True):
    """A DAP was set down: when, by whom, and where once that is known.

    Without ``position`` it stands where its installer stood at ``event_time_ns``; the command
    post works that out and tells the DAP, which says it again with the position. A DAP placed at
    a known point (the entrance) has a position from the first and may have no installer. With
    neither it was taken up, and stands nowhere from then on; or, ``at_rest``, it lies still again,
    nobody knows where until it is passed.
    """

    installer_id: NodeId | None
    position: LocalPosition | None
    at_rest: bool = False


class DapState(Message, frozen=True, kw_only=True, omit_defaults=True):
    """What a DAP's box is like: how much battery is left, how hot it is; ``None``: it cannot tell.

    ``going`` says why it is heard no more from now on, ``worry`` what of it does not work.
    """

    battery_share: Confidence | None
    temperature_c: Annotated[float, Meta(ge=-300.0, le=2000.0)] | None
    going: Words | None
    worry: Words | None = None


class SetDownHere(Message, frozen=True, kw_only=True):
    """Somebody tells a DAP that it stands now: at ``position``, or else beside who says so.

    A responder's unit says so where its wearer sets the DAP down; a post gives the position.
    """

    dap_id: NodeId
    position: LocalPosition | None


class StationTable(Message, frozen=True, kw_only=True):
    """Whose radios are whose: by it, signal strengths of addresses become those of nodes."""

    responders: Listed
    daps: Listed
