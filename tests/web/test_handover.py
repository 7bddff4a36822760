"""The post and its page: whatever the page is at, the post only leaves what it says and goes on."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from command_post.roster import Roster
from command_post.web.board import Board
from command_post.web.handover import MOST_RARE, MOST_TRACKS
from command_post.web.page import Page
from command_post.web.pathfinder import Pathfinder
from shared.codec import encode
from shared.messages import Alert
from shared.units import NS_PER_S
from tests.waiting import DEADLINE_S
from tests.web.test_board import KEY, track

ALERT_KEY = "clew/v1/test/post/post/alert"


def alert(number: int) -> bytes:
    return encode(
        Alert(
            event_time_ns=1, sequence=0, number=number, kind="fall", role="responder",
            node_id="r1", since_ns=1, stage="raised", words="has fallen", by=None,
            assigned_to=None,
        )
    )  # fmt: skip


@contextmanager
def held(page: Page, monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Have one who watches and one who searches be stuck at it until the event is set."""
    inside, let_go = threading.Semaphore(0), threading.Event()

    def stuck(*_: object) -> None:
        inside.release()
        assert let_go.wait(DEADLINE_S)

    with monkeypatch.context() as patched:
        patched.setattr(Board, "since", stuck)
        patched.setattr(Pathfinder, "rescue", stuck)
        at_it = [
            threading.Thread(target=page.since, args=(0,)),
            threading.Thread(target=page.rescue, args=("r1",)),
        ]
        for thread in at_it:
            thread.start()
        for _ in at_it:
            assert inside.acquire(timeout=DEADLINE_S)
        yield let_go
        let_go.set()
        for thread in at_it:
            thread.join()


def test_the_post_goes_on_while_the_page_is_stuck(monkeypatch: pytest.MonkeyPatch) -> None:
    page = Page("test")
    page.published(KEY, track(0.0, 0.0))
    with held(page, monkeypatch) as let_go:
        page.published(ALERT_KEY, alert(7))
        for number in range(MOST_TRACKS + 100):
            page.published(KEY, track(1.0 + number, 1.0, f"r{number % 200}"))
        page.published(KEY, track(30_000.0, 9.0, "r1"))
        page.show(Roster(5 * NS_PER_S, (), ()))
        page.show(Roster(6 * NS_PER_S, (), ()))
        assert page.now_ns == 6 * NS_PER_S
        assert not let_go.is_set(), "all of it was left while the page did nothing"
    told = page.since(0)
    assert [each.number for each in told.alerts] == [7], "a crowd of estimates displaces no alert"
    assert {each.responder_id: each.north_m for each in told.tracks}["r1"] == 9.0
    assert len(told.tracks) == 200
    assert told.roster is not None
    assert b'"now_ns":6000000000' in bytes(told.roster)


def test_the_post_does_none_of_the_pages_work(monkeypatch: pytest.MonkeyPatch) -> None:
    page, worked = Page("test"), list[str]()
    publish = Board.publish

    def noted(board: Board, key: str, payload: bytes) -> None:
        worked.append(threading.current_thread().name)
        publish(board, key, payload)

    monkeypatch.setattr(Board, "publish", noted)
    for number in range(100):
        page.published(KEY, track(float(number), 1.0))
    assert worked == []
    stop, kept_up = threading.Event(), threading.Event()
    keeper = threading.Thread(target=page.keep_up, args=(stop, kept_up.set), name="keeper")
    keeper.start()
    assert kept_up.wait(DEADLINE_S), "what was left to be taken in"
    assert len(worked) == 100
    stop.set()
    keeper.join()
    assert set(worked) == {"keeper"}


def test_what_nobody_takes_is_bounded_and_counted() -> None:
    page = Page("test")
    for number in range(MOST_RARE + 10):
        page.published(ALERT_KEY, alert(number))
    for number in range(MOST_TRACKS + 5):
        page.published(KEY, track(1.0 + number, 1.0))
    assert page.dropped == 10 + 5
    assert len(page.since(0).alerts) == MOST_RARE


def test_a_search_holds_up_nobody_who_watches(monkeypatch: pytest.MonkeyPatch) -> None:
    page = Page("test")
    searching, let_go = threading.Event(), threading.Event()

    def search(_: Pathfinder, __: str) -> None:
        searching.set()
        assert let_go.wait(DEADLINE_S)

    monkeypatch.setattr(Pathfinder, "rescue", search)
    searcher = threading.Thread(target=page.rescue, args=("r1",))
    searcher.start()
    assert searching.wait(DEADLINE_S)
    page.published(KEY, track(1.0, 3.0))
    (view,) = page.since(0).tracks
    assert view.north_m == 3.0
    let_go.set()
    searcher.join()
