"""A recording in a real browser: played, scrubbed, gone through by what happened; only seen."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Page, expect

from command_post.listening import Address
from command_post.review.background import Background
from command_post.review.wishes import Sources
from command_post.web.review_app import Exhibit, make_review_app
from command_post.web.serving import served
from shared.geodesy import Origin
from tests.eventful import eventful, opened
from tests.machine_code import build_machine_code
from tests.waiting import DEADLINE_S
from tests.web.browser import CHROMIUM, Watched, chromium

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")

SIZES = [(390, 844), (1920, 1080), (1024, 768)]
ORIGIN = Origin(latitude_deg=37.5665, longitude_deg=126.978)
PATIENCE_MS = 1e3 * 3 * DEADLINE_S


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    build_machine_code()
    path: Path = eventful(tmp_path_factory.mktemp("review") / "eventful.mcap")
    with (
        opened(path) as past,
        Background(Sources(path), past.begin_ns, past.end_ns) as background,
        served(
            lambda ends: make_review_app(Exhibit(past, background, ORIGIN), ends),
            Address("127.0.0.1", 0),
            None,
        ) as url,
    ):
        yield url


@pytest.fixture
def page(url: str) -> Iterator[Page]:
    with chromium() as browser:
        page = browser.new_page(timezone_id="UTC", viewport={"width": 1024, "height": 768})
        page.set_default_timeout(PATIENCE_MS)
        expect.set_options(timeout=PATIENCE_MS)
        yield page


def test_a_recording_is_gone_through(url: str, page: Page) -> None:
    watched = Watched(page)
    page.goto(url)
    clock, alert = page.locator("#clock"), page.locator("#alert-list > li")
    expect(clock).to_have_text("00:00:00 (+0:00:00)")
    for size in SIZES:
        page.set_viewport_size({"width": size[0], "height": size[1]})
        assert page.evaluate("document.documentElement.scrollWidth") <= size[0]

    page.get_by_text("What happened").click()
    told = page.locator("#happened button")
    expect(told.first).to_contain_text("00:01:00 MAYDAY: r2.")
    expect(told.first).to_contain_text("00:01:05 acknowledged by kim; 00:01:30 resolved by kim")
    told.first.click()
    expect(clock).to_have_text("00:01:00 (+0:01:00)")
    expect(alert).to_contain_text("MAYDAY: r2")
    expect(page.locator("#responder-list strong")).to_have_text(["r2", "r1"])
    for name in ("Evacuate", "Acknowledge: MAYDAY, r2", "Send"):
        expect(page.get_by_role("button", name=name, exact=True)).to_have_count(0)
    words_then = _way_to(page, "r2")

    scrub = page.get_by_role("slider", name="Time line")
    scrub.press("ArrowRight")
    expect(clock).to_have_text("00:01:01 (+0:01:01)")
    box = scrub.bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 0.9 * box["width"], box["y"] + 0.5 * box["height"])
    expect(clock).to_contain_text("(+0:03:")
    expect(page.locator("#way-words")).not_to_have_text(words_then)
    page.get_by_role("button", name="Close").click()
    expect(alert).to_have_count(0)
    scrub.press("Home")
    expect(clock).to_have_text("00:00:00 (+0:00:00)")

    page.get_by_label("Speed").select_option("30")
    scrub.press("Space")
    expect(page.get_by_role("button", name="Pause")).to_be_visible()
    expect(alert).to_contain_text("acknowledged (by kim)")
    expect(alert).to_have_count(0)
    page.get_by_role("button", name="Pause").click()
    expect(page.get_by_role("button", name="Play")).to_be_visible()

    _compare(page)
    box, line = (page.locator(each).bounding_box() for each in ("#place", "#timeline"))
    assert box is not None
    assert line is not None
    assert box["y"] + box["height"] <= line["y"] + 1, "the map is above the time line"
    assert {urlsplit(each).netloc for each in watched.asked} == {urlsplit(url).netloc}
    assert watched.errors == []


def _way_to(page: Page, name: str) -> str:
    page.get_by_role("button", name=f"Rescue: {name}").click()
    expect(page.locator("#way-title")).to_have_text(f"Rescue {name} ← r1")
    expect(page.locator("#way-words")).to_contain_text("crawling: ")
    return page.locator("#way-words").inner_text()


def _compare(page: Page) -> None:
    """See how far off the smoothed ways are, and keep them."""
    clock, scrub = page.locator("#clock"), page.get_by_role("slider", name="Time line")
    page.locator("#compare summary").click()
    page.locator("#compare-go").click()
    scrub.press("End")
    row = page.locator("#differences tbody tr").first
    expect(row.locator("td").first).to_have_text("r1")
    expect(row.locator("td").nth(1)).to_contain_text(" m")
    page.get_by_role("button", name="Play").focus()
    row.get_by_role("button").click()
    expect(clock).not_to_contain_text("(+0:03:5")
    with page.expect_download() as downloaded:
        page.get_by_role("link", name="KML").click()
    assert downloaded.value.suggested_filename.endswith(".kml")
