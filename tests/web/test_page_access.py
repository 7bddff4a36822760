"""The page without a mouse, and without eyes: all by keys, everything with a name."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.benchmarks.page_load import METER
from tests.conftest import CHECKOUT
from tests.waiting import DEADLINE_S
from tests.web.browser import CHROMIUM, Watched, chromium
from tests.web.staged import Staged, staged
from tests.web.test_board import track

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")

RECORDING = CHECKOUT / "recordings" / "corridor.mcap"
SIZES = [(390, 844), (1024, 768), (1920, 1080)]
NAMED = {"button", "tab", "textbox", "checkbox", "combobox", "slider", "dialog", "application",
         "tablist", "region", "group"}  # fmt: skip
MOST_TABS = 60


@pytest.fixture(scope="module")
def shown() -> Iterator[Staged]:
    with staged(RECORDING, 25.0) as shown:
        yield shown


@pytest.fixture(scope="module")
def page(shown: Staged) -> Iterator[Page]:
    with chromium() as browser:
        page = browser.new_page(viewport={"width": 1024, "height": 768})
        page.add_init_script(path=METER)
        page.set_default_timeout(1e3 * DEADLINE_S)
        expect.set_options(timeout=1e3 * DEADLINE_S)
        page.goto(shown.url)
        expect(page.locator("#alert-list > li")).to_have_count(1)
        yield page


def nameless(page: Page) -> list[str]:
    """Return what a screen reader would have no name for."""
    session = page.context.new_cdp_session(page)
    tree = session.send("Accessibility.getFullAXTree")["nodes"]
    return [
        node["role"]["value"]
        for node in tree
        if not node["ignored"]
        and node["role"]["value"] in NAMED
        and not node.get("name", {}).get("value", "").strip()
    ]


def tab_to(page: Page, there: Callable[[], bool]) -> None:
    """Go on by the tab key until ``there``, in sight of the ring that says where one is."""
    for _ in range(MOST_TABS):
        page.keyboard.press("Tab")
        if there():
            ring = "getComputedStyle(document.activeElement).outlineStyle"
            assert page.evaluate(ring) != "none"
            return
    raise AssertionError("the tab key does not lead there")


def focused_name(page: Page) -> str:
    name = page.evaluate(
        "document.activeElement.getAttribute('aria-label') ?? document.activeElement.textContent"
    )
    return str(name)


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_everything_has_a_name(page: Page, size: tuple[int, int]) -> None:
    page.set_viewport_size({"width": size[0], "height": size[1]})
    assert nameless(page) == []
    for button in ("Evacuate", "Roll call", "Message"):
        page.get_by_role("button", name=button, exact=True).click()
        assert nameless(page) == []
        page.get_by_role("dialog").press("Escape")
        expect(page.get_by_role("dialog")).to_have_count(0)


def test_an_alert_is_dealt_with_by_keys_alone(page: Page, shown: Staged) -> None:
    watched, who = Watched(page), shown.caller
    alert = page.locator("#alert-list > li")
    tab_to(page, lambda: focused_name(page) == f"Acknowledge: MAYDAY, {who}")
    page.keyboard.press("Enter")
    _heed_once_asked(page, shown)
    expect(alert).to_contain_text("acknowledged (by local)")
    assert focused_name(page) == f"Assign: MAYDAY, {who}", "where one was is where one is"
    page.keyboard.press("Enter")
    expect(page.get_by_role("dialog", name="Assign")).to_be_visible()
    page.keyboard.press("Enter")
    _heed_once_asked(page, shown)
    expect(alert).to_contain_text("assigned to")
    tab_to(page, lambda: focused_name(page) == f"Resolve: MAYDAY, {who}")
    page.keyboard.press("Enter")
    _heed_once_asked(page, shown)
    expect(page.locator("#no-alerts")).to_be_visible()
    assert page.evaluate("document.activeElement.id") == "alerts"
    assert watched.errors == []


def test_the_map_and_the_floors_are_gone_through_by_keys(page: Page) -> None:
    page.get_by_role("tab", name="All floors").focus()
    tab_to(page, lambda: focused_name(page) == "Floor 0")
    page.keyboard.press("Enter")
    expect(page.get_by_role("tab", name="Floor 0")).to_have_attribute("aria-selected", "true")
    assert focused_name(page) == "Floor 0"
    scale = page.locator(".ol-scale-line-inner")
    before = scale.text_content()
    tab_to(page, lambda: page.evaluate("document.activeElement.id") == "map")
    for _ in range(3):
        page.keyboard.press("+")
    expect(scale).not_to_have_text(before or "")


def test_whatever_changes_is_drawn_all_of_it_at_once(page: Page, shown: Staged) -> None:
    key = f"clew/v1/{shown.incident.settings.incident}/post/post/track"
    counted = "[clewMeter.late_ms.length, clewMeter.renders]"
    drawn, renders = page.evaluate(counted)
    for step in range(5):
        for number in range(40):
            shown.page.published(key, track(float(step), float(step + 1), f"x{number}"))
        for _ in range(1000):
            drawn_now, renders_now = page.evaluate(counted)
            if drawn_now >= drawn + 40 * (step + 1):
                break
            page.wait_for_timeout(10)
    assert drawn_now - drawn >= 5 * 40
    assert renders_now - renders < (drawn_now - drawn) / 4


def _heed_once_asked(page: Page, shown: Staged) -> None:
    """Have the incident do what was asked, once it was."""
    for _ in range(1000):
        if shown.heed():
            return
        page.wait_for_timeout(10)
    raise AssertionError("nothing was asked for")
