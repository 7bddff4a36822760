"""Who passes where a DAP is wanted is told by the post, and by their unit if they carry one."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType, SimpleNamespace
from typing import cast

import pytest

from command_post.desks.announcer import Outgoing
from command_post.desks.site_desk import AGAIN_NS, SiteDesk
from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.track import Estimate
from edge_agent.drop_desk import DropDesk
from edge_agent.site_desk import FRESH_NS
from edge_agent.site_desk import SiteDesk as UnitSiteDesk
from shared.bus.memory import MemoryNetwork
from shared.clock import ManualClock
from shared.codec import encode
from shared.drop_adviser import Advice
from shared.messages import LocalPosition, SiteAdvice
from shared.node import Node
from shared.sender import Sender
from shared.units import NS_PER_S
from tests.stride_world import START_NS


class _World:
    """An incident of which only places are known."""

    def __init__(self) -> None:
        self.estimates: Mapping[str, Estimate] = {}
        self.daps: Mapping[str, InstalledDap] = MappingProxyType({})
        self.advised: list[SiteAdvice] = []

    def said(self, message: SiteAdvice) -> Outgoing:
        self.advised.append(message)
        return Outgoing("clew/v1/fire/post/post/site", encode(message))

    def put(self, name: str, north_m: float, sd_m: float, now_ns: int) -> None:
        self.estimates = {
            name: Estimate(now_ns, north_m, 0.0, 0.0, (sd_m**2, 0.0, sd_m**2), 0.0, 0.1, None)
        }


def pass_by(world: _World, desk: SiteDesk, crowd: int, began_ns: int = START_NS) -> int:
    """Let ``crowd`` go along a way one after the other; return the time when all have."""
    now_ns = began_ns
    for one in range(crowd):
        for metre in range(0, 30, 2):
            now_ns += NS_PER_S
            world.put(f"r{one}", float(metre), 0.5 if metre < 20 else 4.0, now_ns)
            desk.due(world, now_ns)
    return now_ns


def test_who_is_where_a_dap_would_tell_most_is_told_once_a_minute() -> None:
    world, desk = _World(), SiteDesk()
    pass_by(world, desk, 1)
    assert not world.advised
    now_ns = pass_by(world, desk, 2, START_NS + 60 * NS_PER_S)
    assert {each.responder_id for each in world.advised} <= {"r0", "r1"}
    assert all("known to ±4.0 m there" in each.reason for each in world.advised)
    told = len(world.advised)
    assert told
    world.put("r9", 24.0, 4.0, now_ns)
    for later_ns in (0, AGAIN_NS // 2, AGAIN_NS - 1):
        world.put("r9", 24.0, 4.0, now_ns + later_ns)
        desk.due(world, now_ns + later_ns)
    assert [each.responder_id for each in world.advised[told:]] == ["r9"]
    world.put("r9", 24.0, 4.0, now_ns)
    desk.due(world, now_ns + AGAIN_NS)
    assert len(world.advised) == told + 1, "where they were a minute ago they need not be"


def test_where_a_dap_stands_nobody_is_told() -> None:
    world, desk = _World(), SiteDesk()
    position = LocalPosition(north_m=22.0, east_m=0.0, down_m=0.0, covariance_m2=(1.0, 0.0, 1.0))
    world.daps = {"d1": cast("InstalledDap", SimpleNamespace(position=position))}
    pass_by(world, desk, 3)
    assert not world.advised


@pytest.mark.parametrize(
    ("boxes", "to", "age_ns", "of", "is_told"),
    [
        (2, "r1", 0, "post", True),
        (0, "r1", 0, "post", False),
        (2, "r2", 0, "post", False),
        (2, "r1", 2 * FRESH_NS, "post", False),
        (2, "r1", 0, "other", False),
    ],
)
def test_the_unit_of_who_carries_one_tells_its_wearer(
    boxes: int, to: str, age_ns: int, of: str, is_told: bool
) -> None:
    network, told = MemoryNetwork(), list[Advice]()
    own, post = network.connect(), network.connect()
    drop_desk = DropDesk(Sender(own, "fire", "responder", "r1"), boxes, told.append)
    node = SimpleNamespace(
        bus=own, incident="fire", node_id="r1", verifier=None, clock=ManualClock(START_NS)
    )
    desk = UnitSiteDesk(cast("Node", node), "post", drop_desk, lambda _: START_NS + age_ns)
    advice = SiteAdvice(event_time_ns=START_NS, sequence=0, responder_id=to, reason="passed twice")
    for _ in range(2):
        post.publish(f"clew/v1/fire/post/{of}/site", encode(advice))
    desk.attend()
    assert [each.reason for each in told] == (["the post: passed twice"] if is_told else [])
