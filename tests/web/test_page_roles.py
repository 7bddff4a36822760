"""Who signs in sees what they may, is asked again once that is over, and says where this is."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page as BrowserPage
from playwright.sync_api import expect

from command_post.listening import Address
from command_post.roster import Roster
from command_post.web.app import Site, make_app
from command_post.web.page import Page
from command_post.web.people import Door, Person, hashed
from command_post.web.serving import LOCAL_NAMES, served
from shared.codec import decode, parse_key
from shared.geodesy import Geodetic, Origin
from shared.messages import OriginSet
from shared.topics import Key
from tests.waiting import DEADLINE_S
from tests.web.browser import CHROMIUM, Watched, chromium
from tests.web.test_board import KEY, track
from tests.web.test_handover import ALERT_KEY, alert

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")

SESAME = hashed("sesame", bytes(16))
HERE = {"Latitude (°)": "37.5", "Longitude (°)": "127"}


@pytest.fixture
def shown() -> Iterator[tuple[Page, Door, str]]:
    page = Page("test")
    page.published(KEY, track(1.0, 2.0))
    page.published(ALERT_KEY, alert(7))
    page.show(Roster(5, (), ()))
    door = Door({"kim": Person(role="commander", password=SESAME),
                 "lee": Person(role="viewer", password=SESAME)}, 0.0)  # fmt: skip
    site = Site("test", "post", page, door, secure=False, hosts=LOCAL_NAMES)
    with served(lambda ends: make_app(site, ends), Address("127.0.0.1", 0), None) as url:
        yield page, door, url


def test_people_sign_in_and_say_where_this_is(shown: tuple[Page, Door, str]) -> None:
    page, door, url = shown
    with chromium() as browser:
        seen = browser.new_page(viewport={"width": 1024, "height": 768})
        expect.set_options(timeout=1e3 * DEADLINE_S)
        watched = Watched(seen)
        seen.goto(url)
        sign_in(seen, "lee", "open")
        expect(seen.locator("#sign-in-problem")).to_contain_text("name or password is wrong")
        sign_in(seen, "lee", "sesame")
        expect(seen.locator("#alert-list > li")).to_have_count(1)
        for name in ("Evacuate", "Roll call", "Message", "Origin", "Acknowledge", "Resolve"):
            expect(seen.get_by_role("button", name=name).first).to_be_disabled()
        # The page's process was started again: nobody is known there.
        door._sessions.clear()
        expect(seen.get_by_role("dialog", name="Sign in")).to_be_visible()
        sign_in(seen, "kim", "sesame")
        expect(seen.locator("#link")).to_have_text("live")
        expect(seen.get_by_role("button", name="Evacuate")).to_be_enabled()
        expect(seen.get_by_role("button", name="Resolve")).to_be_enabled()
        say_where(seen, page)
        seen.get_by_role("button", name="Sign out (kim)").click()
        expect(seen.get_by_role("dialog", name="Sign in")).to_be_visible()
    assert [each for each in watched.errors if "401" not in each and "403" not in each] == []


def sign_in(seen: BrowserPage, name: str, password: str) -> None:
    dialog = seen.get_by_role("dialog", name="Sign in")
    dialog.get_by_label("Name").fill(name)
    dialog.get_by_label("Password").fill(password)
    dialog.get_by_role("button").click()


def say_where(seen: BrowserPage, page: Page) -> None:
    """Click a place, and say where it is; then correct that, by typing."""
    seen.get_by_role("button", name="Origin").click()
    dialog = seen.get_by_role("dialog", name="Origin")
    for name, text in HERE.items():
        dialog.get_by_label(name).fill(text)
    dialog.get_by_role("button", name="Click on the map").click()
    expect(dialog).to_be_hidden()
    seen.locator("#map").click(position={"x": 200, "y": 150})
    north, east = dialog.get_by_label("north", exact=True), dialog.get_by_label("east", exact=True)
    expect(dialog).to_be_visible()
    clicked_m = float(north.input_value()), float(east.input_value())
    assert clicked_m != (0.0, 0.0)
    dialog.get_by_role("button", name="Set").click()
    at = Geodetic(37.5, 127.0, 0.0)
    assert asked_origin(page) == Origin.through(at, 0.0, clicked_m)
    expect(dialog).to_be_hidden()
    seen.get_by_role("button", name="Origin").click()
    for name, text in HERE.items():
        dialog.get_by_label(name).fill(text)
    north.fill("12.5")
    east.fill("-3")
    dialog.get_by_label("clockwise of true north").fill("30")
    east.press("Enter")
    assert asked_origin(page) == Origin.through(at, 30.0, (12.5, -3.0))
    expect(dialog).to_be_hidden()


def asked_origin(page: Page) -> Origin:
    """Return what the post is asked to hold, once it is."""
    ((key_text, payload),) = page.take_requests(DEADLINE_S)
    key = parse_key(key_text)
    assert isinstance(key, Key)
    said = decode(key, payload)
    assert isinstance(said, OriginSet)
    return Origin.said(said)
