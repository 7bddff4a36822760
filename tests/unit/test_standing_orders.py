"""Orders stand until everybody they are for has acknowledged them, and are said again till then."""

from __future__ import annotations

from typing import get_args

import msgspec
import pytest
from rich.console import Console

from command_post.desks.orders import MOST_STANDING, REPEAT_NS, Issued, OrderRepeats, Orders
from command_post.incident import Incident, IncidentSettings
from command_post.roster import RosterSettings, make_roster
from command_post.roster_json import ROSTER, roster_json
from command_post.table import roster_table
from shared.codec import decode, encode, parse_key
from shared.messages import (
    Message,
    NodeHealth,
    Order,
    OrderAnswer,
    OrderKind,
    OrderReply,
    OrderRequest,
)
from shared.topics import Key
from shared.units import NS_PER_S
from tests.stride_world import at_ns

KNOWN = ("r1", "r2", "r3")


def request(
    kind: str = "message", *to: str, text: str = "to the north stair", sequence: int = 0
) -> OrderRequest:
    return OrderRequest(
        event_time_ns=at_ns(0.0), sequence=sequence, kind=kind, to=to, text=text,  # type: ignore[arg-type]
    )  # fmt: skip


def reply(order: Order, stage: str, post_id: str = "post") -> OrderReply:
    return OrderReply(
        event_time_ns=at_ns(1.0), sequence=0, post_id=post_id,
        order_sequence=order.sequence, stage=stage,  # type: ignore[arg-type]
    )  # fmt: skip


def issued(orders: Orders, kind: str, *to: str, at_s: float = 0.0) -> Order:
    done = orders.request(request(kind, *to), KNOWN, at_ns(at_s))
    assert isinstance(done, Issued)
    assert done.order is not None
    return done.order


@pytest.mark.parametrize("kind", get_args(OrderKind))
def test_an_order_stands_until_each_has_acknowledged_it(kind: str) -> None:
    orders = Orders()
    order = issued(orders, kind, "r1", "r2")
    assert (order.kind, order.to, order.event_time_ns) == (kind, ("r1", "r2"), at_ns(0.0))
    assert orders.of("r1") == [(order, "sent")]
    orders.take("r1", reply(order, "received"))
    assert orders.of("r1") == [(order, "received")]
    assert orders.of("r2") == [(order, "sent")]
    assert orders.of("r3") == []
    orders.take("r1", reply(order, "acknowledged"))
    assert orders.of("r1") == []
    orders.take("r2", reply(order, "acknowledged"))
    assert list(orders.waited_for()) == []


def test_replies_may_come_in_any_order_and_again() -> None:
    orders = Orders()
    order = issued(orders, "message", "r1")
    orders.take("r1", reply(order, "acknowledged"))
    orders.take("r1", reply(order, "received"))
    orders.take("r3", reply(order, "acknowledged"))
    assert orders.of("r1") == []


def test_whom_nobody_has_heard_cannot_be_ordered_anything() -> None:
    orders = Orders()
    assert (
        orders.request(request("evacuate", "r9", "r1"), KNOWN, at_ns(0.0))
        == "r9: not heard so far; r1, r2, r3 have been"
    )
    assert orders.request(request("roll_call"), (), at_ns(0.0)) == "no responder has been heard"
    assert list(orders.waited_for()) == []


def test_to_evacuate_is_also_for_who_is_heard_later_and_comes_first() -> None:
    orders = Orders()
    call = issued(orders, "roll_call")
    out = issued(orders, "evacuate", at_s=5.0)
    orders.meet("r9")
    assert [each.order for each in orders.of("r9")] == [out]
    assert [each.order for each in orders.of("r1")] == [out, call]
    for each in (*KNOWN, "r9"):
        orders.take(each, reply(out, "acknowledged"))
    orders.meet("r10")
    assert [each.order for each in orders.of("r10")] == [out]


def test_a_second_order_is_a_new_one_however_soon() -> None:
    orders = Orders()
    first, second = (issued(orders, "roll_call") for _ in "ab")
    assert second.sequence > first.sequence
    # A post that begins anew, a moment later, does not come back to a number it has given.
    assert issued(Orders(), "roll_call", at_s=1.0).sequence > second.sequence


def test_what_is_withdrawn_is_waited_for_no_longer() -> None:
    orders = Orders()
    issued(orders, "evacuate")
    issued(orders, "message", "r2")
    done = orders.request(request("withdraw", "r1"), KNOWN, at_ns(9.0))
    assert done == Issued(None, ("r1",))
    assert orders.of("r1") == []
    assert len(orders.of("r2")) == 2
    assert orders.request(request("withdraw"), KNOWN, at_ns(9.0)) == Issued(None, ("r2", "r3"))
    orders.meet("r9")
    assert orders.of("r9") == []


def test_there_is_an_end_to_what_stands() -> None:
    orders = Orders()
    for _ in range(MOST_STANDING):
        issued(orders, "message", "r1")
    refusal = orders.request(request("message", "r1"), KNOWN, at_ns(0.0))
    assert isinstance(refusal, str)
    assert "withdraw" in refusal


def test_an_order_is_said_again_while_somebody_alive_has_not_acknowledged_it() -> None:
    orders, repeats = Orders(), OrderRepeats()
    order = issued(orders, "message", "r1", "r2")
    soon_ns, later_ns = at_ns(0.0) + REPEAT_NS - 1, at_ns(0.0) + REPEAT_NS
    assert repeats.due(orders, {"r1"}, soon_ns) == []
    assert repeats.due(orders, {"r3"}, later_ns) == []
    assert repeats.due(orders, {"r1"}, later_ns) == [order]
    assert repeats.due(orders, {"r1"}, later_ns + REPEAT_NS - 1) == []
    assert repeats.due(orders, {"r1"}, later_ns + REPEAT_NS) == [order]
    orders.take("r1", reply(order, "received"))
    assert repeats.due(orders, {"r1"}, later_ns + 2 * REPEAT_NS) == [order]
    orders.take("r1", reply(order, "acknowledged"))
    assert repeats.due(orders, {"r1"}, later_ns + 3 * REPEAT_NS) == []
    # A clock that was set back must not silence it.
    assert repeats.due(orders, {"r2"}, at_ns(0.0) - NS_PER_S) == [order]


def words_of(incident: Incident) -> str:
    """Return what the roster's table reads, its lines joined."""
    console = Console(width=200)
    with console.capture() as capture:
        console.print(roster_table(make_roster(incident, at_ns(46.0), RosterSettings())))
    return " ".join(capture.get().split())


def heard(
    incident: Incident, role: str, node_id: str, message: Message, at_s: float
) -> list[Message]:
    topics = {NodeHealth: "health", OrderRequest: "order_request", OrderReply: "order_reply"}
    key = f"clew/v1/exercise/{role}/{node_id}/{topics[type(message)]}"
    made = []
    for outgoing in incident.handle(key, encode(message), at_ns(at_s)):
        parsed = parse_key(outgoing.key)
        assert isinstance(parsed, Key)
        assert parsed[1:3] == ("post", "post")
        decoded = decode(parsed, outgoing.payload)
        assert isinstance(decoded, Message)
        made.append(decoded)
    return made


def health(at_s: float) -> NodeHealth:
    return NodeHealth(event_time_ns=at_ns(at_s), sequence=0, level="ok", findings=())


def test_the_post_issues_what_a_commander_requests_and_shows_who_has_not_acknowledged() -> None:
    incident = Incident(IncidentSettings())
    for each in ("r1", "r2"):
        heard(incident, "responder", each, health(0.0), 0.0)
    wanted = request("evacuate", "r2", text="by the north stair", sequence=7)
    order, answer = heard(incident, "post", "commander", wanted, 1.0)
    assert isinstance(order, Order)
    assert isinstance(answer, OrderAnswer)
    assert (order.kind, order.to, order.text) == ("evacuate", ("r2",), "by the north stair")
    assert (answer.commander_id, answer.request_sequence) == ("commander", 7)
    assert (answer.refusal, answer.waited_for) == (None, ("r2",))
    heard(incident, "responder", "r2", reply(order, "received", post_id="another"), 2.0)
    first, second = make_roster(incident, at_ns(46.0), RosterSettings()).responders
    assert (first.responder_id, second.responder_id) == ("r2", "r1")
    assert first.orders == ((order, 45.0, False),)
    assert second.orders == ()
    assert "EVACUATE: not received for 45 s" in words_of(incident)
    encoded = roster_json(make_roster(incident, at_ns(46.0), RosterSettings()))
    told = msgspec.json.decode(encoded)
    (waiting,) = told["responders"][0]["orders"]
    assert (waiting["order"]["kind"], waiting["received"]) == ("evacuate", False)
    assert msgspec.json.encode(msgspec.json.decode(encoded, type=ROSTER)) == encoded
    heard(incident, "responder", "r2", reply(order, "received"), 3.0)
    assert "EVACUATE: received, not acknowledged for 45 s" in words_of(incident)
    heard(incident, "responder", "r2", reply(order, "acknowledged"), 4.0)
    assert not any(row.orders for row in make_roster(incident, at_ns(46.0), RosterSettings())[1])


def test_a_request_that_cannot_be_done_is_answered_with_the_reason() -> None:
    incident = Incident(IncidentSettings())
    heard(incident, "responder", "r1", health(0.0), 0.0)
    (answer,) = heard(incident, "post", "commander", request("roll_call", "r9", sequence=3), 1.0)
    assert isinstance(answer, OrderAnswer)
    assert answer.request_sequence == 3
    assert answer.refusal == "r9: not heard so far; r1 have been"
