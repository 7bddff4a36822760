"""Zenoh's trace of its access rules: look-ups are told from messages that are turned away."""

from __future__ import annotations

import pytest

from shared.bus.access_log import MOST_LINKS, AccessLog, Act, Breach

R2 = "clew/v1/fire/responder/r2/increment"
WHERE = "Interface(lo)+CertCommonName(r1)+Transport(Tls)+fdd2"
TARGET = "zenoh::net::routing::interceptor::access_control"


def told(words: str, thread: int = 9) -> str:
    return f"\x1b[2m2026-11-22T18:44:54Z\x1b[0m TRACE rx-0 ThreadId({thread:02}) {TARGET}: {words}"


def looks_up(key: str, thread: int = 9) -> list[str]:
    return [
        told(f"ACL (ingress): caching permissions for `{key}` ...", thread),
        *(
            told(f"fdd2 on {WHERE} is unauthorized to {action} (ingress) on {key}", thread)
            for action in (
                "Query",
                "Reply",
                "Put",
                "Delete",
                "Declare/Undeclare Subscriber",
                "Declare/Undeclare Queryable",
                "Declare/Undeclare Liveliness Token",
                "Liveliness Query",
                "Declare Liveliness Subscriber",
            )
        ),
    ]


def found(lines: list[str], log: AccessLog | None = None) -> list[Breach]:
    log = log or AccessLog()
    return [breach for line in lines if (breach := log.take(line)) is not None]


def test_a_look_up_is_no_breach() -> None:
    assert found(looks_up(R2)) == []


def test_what_was_looked_up_and_is_turned_away_then_is_of_whose_link_it_is() -> None:
    away = told(f"Using cached result: fdd2 is unauthorized to Put (ingress) on {R2}", 3)
    assert found([*looks_up(R2), away, away]) == [Breach("r1", R2)] * 2


def test_what_is_turned_away_without_a_look_up_is_a_breach() -> None:
    away = told(f"fdd2 on {WHERE} is unauthorized to Put (ingress) on {R2}")
    assert found([away]) == [Breach("r1", R2)]
    elsewhere = looks_up("clew/v1/fire/responder/r2/alarm")
    assert found([*elsewhere, away]) == [Breach("r1", R2)]
    assert found([*looks_up(R2, thread=4), away]) == [Breach("r1", R2)]


def test_what_is_let_pass_and_what_goes_out_is_none() -> None:
    assert found([
        told(f"Using cached result: fdd2 is authorized to Put (ingress) on {R2}"),
        told(f"Using cached result: fdd2 is unauthorized to Put (egress) on {R2}"),
        "something else (ingress)", "",
    ]) == []  # fmt: skip


@pytest.mark.parametrize(
    ("word", "act"),
    [("Query", "ask"), ("Declare Subscriber", "listen"), ("Declare Queryable", "answer"),
     ("Liveliness Token", "be there")],
)  # fmt: skip
def test_questions_and_declarations_are_told_apart_from_look_ups(word: str, act: Act) -> None:
    cached = told(f"Using cached result: fdd2 is unauthorized to {word} (ingress) on {R2}")
    assert found([*looks_up(R2), cached]) == [Breach("r1", R2, act)]
    wide = told(f"fdd2 on {WHERE} is unauthorized to {word} (ingress) on clew/**")
    assert found([wide]) == [Breach("r1", "clew/**", act)]
    assert found([wide.replace("on clew/", "on @/")]) == []


def test_of_an_unknown_link_the_sender_is_not_known() -> None:
    away = "Using cached result: 77 is unauthorized to Put (ingress) on x"
    assert found([told(away)]) == [Breach("", "x")]


def test_links_without_end_are_forgotten() -> None:
    log = AccessLog()
    away = f"is unauthorized to Put (ingress) on {R2}"
    for number in range(3 * MOST_LINKS):
        assert found([told(f"{number:x} on {WHERE} {away}")], log) == [Breach("r1", R2)]
    assert found([told(f"Using cached result: 1 {away}")], log) == [Breach("", R2)]
