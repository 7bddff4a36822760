"""The time service over a network whose two ways are uneven."""

from __future__ import annotations

from shared.bus.zenoh_bus import open_zenoh
from shared.clock import PacedClock, SystemClock
from shared.time_service import TimeAsker, time_answerer
from shared.topics import time_key
from shared.units import NS_PER_S
from tests.bus.relay import Relay
from tests.bus.test_zenoh import port_of
from tests.faulty_clocks import FaultyClock
from tests.waiting import wait_for

DAY_NS = 86_400 * NS_PER_S


def test_a_node_a_day_off_that_drifts_knows_its_offset_over_an_uneven_link() -> None:
    clock = FaultyClock(DAY_NS, 100e-6)
    own = SystemClock()
    with open_zenoh("router", listen=["tcp/127.0.0.1:0"]) as post:
        post.answer(time_key("test", "post"), time_answerer(PacedClock(own)))
        with (
            Relay(port_of(post.locators()[0]), there_s=0.02, back_s=0.08) as relay,
            open_zenoh("client", connect=[f"tcp/127.0.0.1:{relay.port}"]) as bus,
            TimeAsker(bus, "test", PacedClock(clock)) as asker,
        ):
            wait_for(asker.stated, "an answer")
            stated = asker.stated()
            true_ns = own.now_ns() - clock.now_ns()
            bus.close()
    assert stated is not None
    assert abs(stated.offset.offset_ns - true_ns) <= stated.offset.uncertainty_ns
    # The link's two ways are not the same: half their difference is what nobody can know.
    assert abs(stated.offset.offset_ns - true_ns) >= 0.02 * NS_PER_S
    assert stated.offset.uncertainty_ns >= 0.05 * NS_PER_S
