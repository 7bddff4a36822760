"""What ties responders to places: DAPs set down and passed, and meetings (pure)."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

from command_post.fusion.team.chain import Chain
from command_post.fusion.team.log import Installed, Peak, ResponderLog, TeamLog
from command_post.fusion.team.settings import TeamSettings
from shared.messages import LocalPosition
from shared.units import NS_PER_S

PlaceId: TypeAlias = tuple[str, ...]
"""A DAP where it stood since a time, or a meeting of two responders."""

SAME_PASS_S = 5.0
LEAST_SD_M = 0.1


class Tie(NamedTuple):
    """A place reached by the chain: when, stance, offset from there, deviation, freedom.

    ``share`` of a whole tie is what it says: its deviation is as much wider as is due to that.
    """

    chain: int
    time_ns: int
    stance: int
    north_m: float
    east_m: float
    place: PlaceId
    sd_m: float
    dof: float
    share: float = 1.0


class Known(NamedTuple):
    """What is known of a place beforehand: where it is, and each way's standard deviation.

    Of one that was ``found`` by passes it is known where it is passed, and not where it stands.
    """

    north_m: float
    east_m: float
    sd_m: float
    found: bool = False


def ties_of(
    log: TeamLog, chains: list[Chain], until_ns: int, settings: TeamSettings
) -> tuple[list[Tie], dict[PlaceId, Known]]:
    """Return all ties, and what is known of places beforehand."""
    number = {chain.responder_id: index for index, chain in enumerate(chains)}
    stands: dict[str, list[Installed]] = {}
    known: dict[PlaceId, Known] = {}
    ties: list[Tie] = []
    for dap_id in sorted(log.daps):
        for installed in log.daps[dap_id]:
            if installed.time_ns > until_ns:
                break
            place = _dap_place(dap_id, installed)
            chain = number.get(installed.installer_id or "")
            if chain is not None:
                ties.append(_install_tie(chains, chain, installed.time_ns, place, settings))
            elif installed.position is not None:
                known[place] = _known(installed.position, found=installed.found)
            elif not installed.is_taken_up:
                continue
            stands.setdefault(dap_id, []).append(installed)
    for index in range(len(chains)):
        ties += _pass_ties(log, chains, index, stands, until_ns, settings)
        ties += _meeting_ties(log, chains, index, number, until_ns, settings)
    return ties, known


def _install_tie(
    chains: list[Chain], chain: int, time_ns: int, place: PlaceId, settings: TeamSettings
) -> Tie:
    """Return the tie of a DAP to its installer, who set it down before them."""
    tie = _tie(chains, chain, time_ns, place, settings.install_sd_m, 0.0)
    ahead_north, ahead_east = chains[chain].ahead(time_ns)
    return tie._replace(
        north_m=tie.north_m + settings.install_ahead_m * ahead_north,
        east_m=tie.east_m + settings.install_ahead_m * ahead_east,
    )


def asides_m2(
    ties: Sequence[Tie], known: Mapping[PlaceId, Known], settings: TeamSettings
) -> dict[PlaceId, float]:
    """Return, of each known place, the variance of how far aside of it all pass it (m²), each way.

    Walls, bodies and where there is a way put all passes of a DAP off alike: many say no more than
    a few of where its wearers are, and the blunter each one is, the less.
    """
    passes_m2: dict[PlaceId, list[float]] = {
        place: [] for place, each in known.items() if not each.found
    }
    for tie in ties:
        if tie.dof and tie.place in passes_m2:
            passes_m2[tie.place].append(tie.share * tie.sd_m**2)
    blunt_m2 = settings.sharpness.sd_at_m(settings.sharpness.least_dbm) ** 2
    return {
        place: settings.aside_share**2 * (math.fsum(each) / len(each) if each else blunt_m2)
        for place, each in passes_m2.items()
    }


def _known(position: LocalPosition, *, found: bool) -> Known:
    return Known(position.north_m, position.east_m, level_sd_m(position), found)


def level_sd_m(position: LocalPosition) -> float:
    """Return how well a place is known, each way alike; what no covariance can be counts as 0."""
    nn, _, ee = position.covariance_m2
    return math.sqrt(max(0.5 * (nn + ee), LEAST_SD_M**2))


def _pass_ties(
    log: TeamLog, chains: list[Chain], index: int, stands: dict[str, list[Installed]],
    until_ns: int, settings: TeamSettings,
) -> list[Tie]:  # fmt: skip
    """Return a responder's passes of DAPs, each tied to where the DAP then stood, if it did."""
    heard = log.responders[chains[index].responder_id]
    ties = []
    for peak in _passes(heard, until_ns, settings):
        standing = stands.get(peak.other_id, [])
        at = bisect_right(standing, peak.time_ns, key=lambda each: each.time_ns)
        if at and not standing[at - 1].is_taken_up:
            place = _dap_place(peak.other_id, standing[at - 1])
            sd_m = settings.sharpness.sd_at_m(peak.peak_dbm)
            ties.append(_tie(chains, index, peak.time_ns, place, sd_m, settings.sharpness.dof))
    return _shadowed_alike(ties, chains[index], settings.shadowing_m)


def _shadowed_alike(ties: list[Tie], chain: Chain, shadowing_m: float) -> list[Tie]:
    """Return a chain's ties to what it heard, those to one within ``shadowing_m`` of way as one.

    The same walls and bodies shadow them: all of them together say no more than one does.
    """
    at_m: dict[PlaceId, list[float]] = {}
    for tie in ties:
        at_m.setdefault(tie.place[:-1], []).append(float(chain.length_m[tie.stance]))
    for way_m in at_m.values():
        way_m.sort()
    told = []
    for tie in ties:
        way_m, here_m = at_m[tie.place[:-1]], float(chain.length_m[tie.stance])
        alike = bisect_right(way_m, here_m + shadowing_m) - bisect_left(way_m, here_m - shadowing_m)
        wider_m = tie.sd_m * math.sqrt(alike)
        told.append(tie if alike == 1 else tie._replace(sd_m=wider_m, share=1.0 / alike))
    return told


def _meeting_ties(
    log: TeamLog, chains: list[Chain], index: int, number: dict[str, int],
    until_ns: int, settings: TeamSettings,
) -> list[Tie]:  # fmt: skip
    """Return both ties of each meeting that is logged with this responder."""
    responder_id = chains[index].responder_id
    own, others = [], []
    for meeting in _meetings(log.responders[responder_id].contacts, until_ns, settings):
        other = number.get(meeting.other_id)
        if other is None:
            continue
        place = ("meeting", responder_id, meeting.other_id, str(meeting.time_ns))
        sd_m = settings.sharpness.sd_at_m(meeting.peak_dbm + settings.contact_gain_db)
        # Either is half of the way from where they met.
        sd_m = settings.contact_share * max(sd_m, settings.contact_sd_least_m)
        dof = settings.sharpness.dof
        own.append(_tie(chains, index, meeting.time_ns, place, sd_m, dof))
        others.append(_tie(chains, other, meeting.time_ns, place, sd_m, dof))
    told = _shadowed_alike(own, chains[index], settings.shadowing_m)
    return [
        *told,
        *(other._replace(sd_m=own.sd_m) for own, other in zip(told, others, strict=True)),
    ]


def _dap_place(dap_id: str, installed: Installed) -> PlaceId:
    return ("dap", dap_id, str(installed.time_ns))


def _tie(
    chains: list[Chain], chain: int, time_ns: int, place: PlaceId, sd_m: float, dof: float
) -> Tie:
    return Tie(chain, time_ns, *chains[chain].nearest(time_ns), place, sd_m, dof)


def _passes(heard: ResponderLog, until_ns: int, settings: TeamSettings) -> list[Peak]:
    """Return the peaks sharp enough; of a DAP that tells none, the strongest of each stay.

    The faint ones are returned of who was never tied to anything by those.
    """
    told = {peak.other_id for peak in heard.peaks}
    passes = _as_loud(heard.peaks, until_ns, settings.sharpness.least_dbm)
    if not passes and all(start.tied_ns is None for start in heard.starts):
        passes = _as_loud(heard.peaks, until_ns, settings.sharpness.faint_dbm)
    stays: dict[str, Peak] = {}
    for near in heard.nears:
        if near.time_ns > until_ns or near.other_id in told:
            continue
        best = stays.get(near.other_id)
        if best is not None and near.time_ns - best.time_ns < SAME_PASS_S * NS_PER_S:
            if near.peak_dbm > best.peak_dbm:
                stays[near.other_id] = near
            continue
        if best is not None:
            passes.append(best)
        stays[near.other_id] = near
    return sorted([*passes, *stays.values()])


def _as_loud(peaks: list[Peak], until_ns: int, least_dbm: float) -> list[Peak]:
    return [each for each in peaks if each.time_ns <= until_ns and each.peak_dbm >= least_dbm]


def _meetings(contacts: list[Peak], until_ns: int, settings: TeamSettings) -> list[Peak]:
    """Return the contacts close enough, one for each meeting: both units may tell of it."""
    found: dict[str, Peak] = {}
    meetings = []
    for contact in contacts:
        if contact.time_ns > until_ns or contact.peak_dbm < settings.contact_least_dbm:
            continue
        last = found.get(contact.other_id)
        if last and contact.time_ns - last.time_ns < settings.contact_again_s * NS_PER_S:
            continue
        found[contact.other_id] = contact
        meetings.append(contact)
    return meetings
