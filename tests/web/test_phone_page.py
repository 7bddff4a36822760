"""The page that makes a phone a unit, in a real browser: what sensors tell gets to the agent."""

from __future__ import annotations

from collections.abc import Generator
from itertools import islice

import pytest

from edge_agent.sources.phone_server import PhoneServer
from edge_agent.sources.reading import Quiet
from shared.messages import ImuSample
from tests.web.browser import CHROMIUM, Watched, chromium

NOW_NS = 1_900_000_000_000_000_000
MOVES = """(first) => {
  for (let k = first; k < first + 100; k += 1) {
    const motion = new DeviceMotionEvent("devicemotion", {
      accelerationIncludingGravity: { x: 0.1, y: 9.8, z: k },
      rotationRate: { alpha: 90, beta: 180, gamma: 0 },
    });
    Object.defineProperty(motion, "timeStamp", { value: 50 * k });
    window.dispatchEvent(motion);
  }
}"""
"""A hundred moments of motion, 50 ms apart."""


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium (.ci/run installs it)")
def test_motion_is_sent_and_sent_again_after_the_link_was_lost() -> None:
    server = PhoneServer("127.0.0.1:0", lambda: NOW_NS, None, "secret")
    readings = server.readings()
    assert isinstance(readings, Generator)
    assert isinstance(next(readings), Quiet)
    with chromium() as browser:
        page = browser.new_page()
        watched = Watched(page)
        page.goto(server.url)
        page.get_by_role("button", name="Send this phone's motion").press("Enter")
        page.get_by_role("status").filter(has_text="Waiting for the sensors").wait_for()
        page.evaluate(MOVES, 0)
        page.get_by_role("status").filter(has_text="200 readings sent").wait_for()
        page.evaluate("link.close()")
        page.evaluate(MOVES, 100)
        page.get_by_role("status").filter(has_text="400 readings sent").wait_for()
        assert watched.errors == []
    samples = [one for one in islice(readings, 220) if isinstance(one, ImuSample)][:200]
    readings.close()
    assert [one.force_m_s2 for one in samples] == [(0.1, 9.8, float(k)) for k in range(200)]
    assert samples[0].rate_rad_s == pytest.approx((3.14159, 0.0, 1.5708), abs=1e-3)
