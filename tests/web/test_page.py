"""The page in a real browser, of a real post with a real agent: seen, heeded, and acted on."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.bus.test_zenoh import free_endpoint
from tests.machine_code import build_machine_code
from tests.waiting import DEADLINE_S, wait_for
from tests.web.browser import CHROMIUM, Watched, chromium

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")

SIZES = [(390, 844), (1024, 768), (1920, 1080)]
PATIENCE_MS = 1e3 * 3 * DEADLINE_S


class Running(NamedTuple):
    """A post with a page, and an agent."""

    url: str
    agent: subprocess.Popen[bytes]


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    build_machine_code()
    folder = tmp_path_factory.mktemp("page")
    endpoint, log = free_endpoint(), folder / "post.log"
    teams = folder / "teams.toml"
    teams.write_text('[teams]\nalpha = ["r1"]\nbravo = ["r9"]\n')
    common = ("--insecure", "--incident", "test")
    post = (*common, "--listen", endpoint, "--record", str(folder / "incident.mcap"),
            "--page", "127.0.0.1:0", "--teams", str(teams))  # fmt: skip
    walk = (*common, "--connect", endpoint, "--id", "r1", "--source", "simulated:four_daps",
            "--journal", str(folder / "r1.journal"), "--no-imu")  # fmt: skip
    python = (sys.executable, "-m")
    with log.open("wb") as said:
        children = [
            subprocess.Popen([*python, "command_post", "run", *post], stderr=said),
            subprocess.Popen(
                [*python, "edge_agent", "run", *walk],
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            ),
        ]  # fmt: skip
        try:
            wait_for(lambda: _url(log), "the page to be served", 3 * DEADLINE_S)
            yield Running(_url(log), children[1])
        finally:
            for child in reversed(children):
                child.terminate()
            for child in reversed(children):
                child.wait(DEADLINE_S)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


def _url(log: Path) -> str:
    found = re.search(r"url=(http://\S+)", log.read_text())
    return found[1] if found else ""


def _opened(browser: Browser, url: str, size: tuple[int, int]) -> tuple[Page, Watched]:
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.set_default_timeout(PATIENCE_MS)
    expect.set_options(timeout=PATIENCE_MS)
    watched = Watched(page)
    page.goto(url)
    expect(page.locator("#responder-list strong")).to_have_text(["r1"])
    return page, watched


SHOWN = """() => [...document.querySelectorAll("button, [role=tab]")]
  .filter((one) => one.checkVisibility())
  .map((one) => [one.innerText, one.ariaLabel, one.getBoundingClientRect().toJSON()])"""
"""What can be pressed, all at one moment: rows come and go."""


WRITTEN = """() => [...document.querySelectorAll("body *")].flatMap((one) => [
  ...[...one.childNodes].filter((it) => it.nodeName === "#text").map((it) => it.data.trim()),
  one.title, one.ariaLabel, one.placeholder].filter(Boolean))"""
"""All that stands in the page, seen or read out."""


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_all_is_in_its_place_and_nobody_else_is_asked(
    running: Running, browser: Browser, size: tuple[int, int]
) -> None:
    page, watched = _opened(browser, running.url, size)
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    boxes = {}
    for text, label, box in page.evaluate(SHOWN):
        assert box["height"] >= 40
        assert text or label
        boxes[text] = box
    for (one, a), (other, b) in combinations(boxes.items(), 2):
        apart = (
            a["x"] + a["width"] <= b["x"] + 1
            or b["x"] + b["width"] <= a["x"] + 1
            or a["y"] + a["height"] <= b["y"] + 1
            or b["y"] + b["height"] <= a["y"] + 1
        )
        assert apart, f"{one!r} and {other!r} overlap"
    assert {urlsplit(url).netloc for url in watched.asked} == {urlsplit(running.url).netloc}
    assert watched.errors == []
    page.close()


def test_floors_units_and_language_are_chosen(running: Running, browser: Browser) -> None:
    page, watched = _opened(browser, running.url, (1024, 768))
    page.get_by_role("tab", name="Floor 0").click()
    expect(page.get_by_role("tab", name="Floor 0")).to_have_attribute("aria-selected", "true")
    expect(page.locator("#responder-list .sure")).to_contain_text(" m")
    page.get_by_role("button", name="m / ft").click()
    expect(page.locator("#responder-list .sure")).to_contain_text(" ft")
    expect(page.locator(".ol-scale-line")).to_contain_text("ft")
    page.get_by_role("button", name="한국어").click()
    expect(page.get_by_role("button", name="대피")).to_be_visible()
    expect(page.locator("html")).to_have_attribute("lang", "ko")
    # What the post says of reasons, too, in whole, and what stands in dialogs.
    expect(page.locator("#responder-list .why").first).to_have_text(re.compile("^[^A-Za-z]+$"))
    written = {each.removesuffix(" ft") for each in page.evaluate(WRITTEN)}
    english = {each for each in written if re.search("[A-Za-z]{2}", each)}
    assert english <= {"test", "m / ft", "English", "CSV", "GeoJSON", "KML"}
    assert watched.errors == []
    page.close()


def test_a_way_out_is_shown_in_words(running: Running, browser: Browser) -> None:
    page, watched = _opened(browser, running.url, (1024, 768))
    expect(page.locator("#responder-list .sure")).to_contain_text(" m")
    page.get_by_role("button", name="Way out: r1").click()
    expect(page.locator("#way-words")).to_contain_text("walking")
    page.get_by_role("button", name="Close").click()
    expect(page.locator("#way")).to_be_hidden()
    page.get_by_role("button", name="Rescue: r1").click()
    expect(page.locator("#way-words")).to_contain_text("nobody's way to r1 was walked")
    watched.errors = [each for each in watched.errors if "404" not in each]
    assert watched.errors == []
    page.close()


ORDER_TO_NOBODY = """async () => {
  const me = await (await fetch("api/v1/me")).json();
  const headers = { "Content-Type": "application/json", "X-Clew-Token": me.token };
  const body = JSON.stringify({ kind: "roll_call", to: ["r9"] });
  await fetch("api/v1/orders", { method: "POST", headers, body });
}"""


def test_an_evacuation_is_ordered_by_keyboard_and_acknowledged(
    running: Running, browser: Browser
) -> None:
    page, watched = _opened(browser, running.url, (1024, 768))
    keys = page.keyboard
    for _ in range(20):
        keys.press("Tab")
        if page.evaluate("document.activeElement.id") == "evacuate":
            break
    keys.press("Enter")
    expect(page.get_by_role("dialog", name="Evacuate")).to_be_visible()
    everybody, alone = page.get_by_label("Everybody"), page.get_by_label("r1", exact=True)
    expect(page.get_by_label("Team bravo")).to_be_disabled()
    page.get_by_label("Team alpha").press("Space")
    expect(alone).to_be_checked()
    expect(everybody).not_to_be_checked()
    everybody.press("Space")
    expect(alone).not_to_be_checked()
    # Everybody is ticked already: on to the text, and to the button behind it.
    while page.evaluate("document.activeElement.id") != "order-text":
        keys.press("Tab")
    keys.type("by the north door")
    keys.press("Tab")
    keys.press("Enter")
    expect(page.get_by_role("dialog")).not_to_be_visible()
    orders = page.locator("#responder-list .why", has_text="Evacuate")
    expect(orders).to_have_text("Evacuate: has received")
    page.evaluate(ORDER_TO_NOBODY)
    expect(page.locator("#notice")).to_contain_text("The post refuses: r9: not heard so far")
    page.locator("#notice").click()
    expect(page.locator("#notice")).to_be_hidden()
    waiting = "Evacuate: 0 of 1 have acknowledged, waiting for r1"
    expect(page.locator("#remarks")).to_have_text(waiting)
    expect(page.get_by_role("button", name="Withdraw")).to_be_visible()
    running.agent.send_signal(signal.SIGUSR1)
    expect(orders).to_have_count(0)
    expect(page.locator("#remarks")).to_have_text("")
    assert watched.errors == []
    page.close()


def test_who_is_lost_is_alerted_to_and_the_alert_is_dealt_with(
    running: Running, browser: Browser
) -> None:
    page, watched = _opened(browser, running.url, (1024, 768))
    expect(page.locator("#no-alerts")).to_be_visible()
    running.agent.kill()
    alert = page.locator("#alert-list > li")
    expect(alert).to_contain_text("Lost contact: r1")
    expect(page.locator("#new-alert")).to_contain_text("Lost contact: r1")
    page.get_by_role("button", name="Acknowledge: Lost contact, r1").click()
    expect(alert).to_contain_text("acknowledged (by local)")
    page.get_by_role("button", name="Assign: Lost contact, r1").click()
    page.get_by_role("dialog", name="Assign").get_by_role("button", name="r1").click()
    expect(alert).to_contain_text("assigned to r1")
    page.get_by_role("button", name="Resolve: Lost contact, r1").click()
    expect(page.locator("#no-alerts")).to_be_visible()
    expect(page.locator("#responder-list .state")).to_have_text("LOST")
    assert watched.errors == []
    page.close()
