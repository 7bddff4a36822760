"""A pass told by both ends of a link counts once."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest

from command_post.fusion.team.team_tracker import TeamTracker
from command_post.incident import Incident, IncidentSettings
from command_post.nodes.both_ways import MOST_PAIRS, SAME_PASS_NS, BothWays
from shared.codec import encode
from shared.messages import DapPeak, RssiPeak
from shared.units import NS_PER_S

START_NS = 1_700_000_000 * NS_PER_S


def test_the_other_sides_word_for_the_same_pass_is_known() -> None:
    ways = BothWays()
    assert not ways.is_told("dap", "d1", "r1", START_NS)
    assert ways.is_told("responder", "d1", "r1", START_NS + SAME_PASS_NS)
    assert not ways.is_told("responder", "d1", "r1", START_NS + SAME_PASS_NS + 1)
    assert not ways.is_told("responder", "d2", "r1", START_NS)
    assert not ways.is_told("responder", "d1", "r2", START_NS)
    assert ways.repeated == 1


def test_what_one_side_tells_twice_is_for_others_to_judge() -> None:
    ways = BothWays()
    assert not any(ways.is_told("dap", "d1", "r1", START_NS + n) for n in range(3))


def test_it_does_not_grow_without_end() -> None:
    ways = BothWays()
    for number in range(MOST_PAIRS + 1):
        ways.is_told("dap", "d1", f"r{number}", START_NS)
    assert not ways.is_told("responder", "d1", "r0", START_NS)
    assert ways.is_told("responder", "d1", "r9", START_NS)


@pytest.mark.parametrize("first", ["dap", "responder"])
def test_either_end_reaches_the_same_tie_once(monkeypatch: pytest.MonkeyPatch, first: str) -> None:
    taken: list[tuple[str, RssiPeak]] = []
    monkeypatch.setattr(TeamTracker, "peak", lambda _, dap_id, said: taken.append((dap_id, said)))
    incident = Incident(IncidentSettings(incident="fire"))
    common: Any = {"sequence": 0, "peak_dbm": -44.0, "width_s": 1.0, "sample_count": 9}
    own = RssiPeak(event_time_ns=START_NS, responder_id="r1", **common)
    other = DapPeak(event_time_ns=START_NS + NS_PER_S, dap_id="d1", **common)
    said = [("clew/v1/fire/dap/d1/peak", own), ("clew/v1/fire/responder/r1/dap_peak", other)]
    for key, message in said if first == "dap" else reversed(said):
        incident.handle(key, encode(message), START_NS + 4 * NS_PER_S)
    incident.finish(START_NS + 60 * NS_PER_S)
    ((dap_id, peak),) = taken
    assert (dap_id, peak.responder_id, peak.peak_dbm) == ("d1", "r1", -44.0)
    assert incident.counts["told_by_both"] == 1
    assert incident.refusals == Counter()
