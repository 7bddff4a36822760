"""How fresh what is known of a node is, and the words for it."""

from __future__ import annotations

import msgspec
import pytest
from rich.console import Console

from command_post.incident import Incident, IncidentSettings
from command_post.nodes.freshness import Freshness, NodeWatch
from command_post.roster import RosterSettings, make_roster
from command_post.table import roster_table
from shared.codec import encode
from shared.gate import Gate
from shared.messages import Beat, ClockStatement
from shared.seal import sealed
from shared.topics import Key, Role
from shared.units import NS_PER_S
from tests.traffic import START_NS, increment

R1: tuple[Role, str] = ("responder", "r1")
JOURNAL, PROCESS = b"journal1", b"process1"


def at(time_s: float) -> int:
    return START_NS + round(time_s * NS_PER_S)


def beat(time_s: float, last_number: int, kept_from: int = 1, acknowledged: int = 0) -> Beat:
    return Beat(
        event_time_ns=at(time_s),
        sequence=0,
        run=JOURNAL.hex(),
        last_number=last_number,
        kept_from=kept_from,
        acknowledged=acknowledged,
        clock=ClockStatement(
            post_id="post", offset_ns=-3 * NS_PER_S, uncertainty_ns=20_000_000, drift=0.0
        ),
    )


class Post:
    """A gate and a watch behind it, as at the post."""

    def __init__(self) -> None:
        self.gate = Gate()
        self.watch = NodeWatch()

    def hear(self, time_s: float, topic: str, payload: bytes, node_id: str = "r1") -> None:
        """Hear bytes under a topic."""
        key = str(Key("test", "responder", node_id, topic))
        if self.gate.admit(key, payload) is None:
            self.watch.hear(key, payload, at(time_s))

    def stride(self, time_s: float, number: int) -> None:
        """Hear what is in the journal under ``number``."""
        self.hear(time_s, "increment", sealed(encode(increment(number)), JOURNAL, number))

    def beat(self, number: int, said: Beat, time_s: float) -> None:
        """Hear a beat, under ``number`` of what is said once."""
        self.hear(time_s, "beat", sealed(encode(said), PROCESS, number))

    def of(
        self, time_s: float, *, alive: bool = True, useless: dict[str, int] | None = None
    ) -> Freshness:
        """Return how fresh the only node is."""
        (one,) = self.watch.fresh(at(time_s), [R1] if alive else [], self.gate, useless or {})
        return one


def test_of_a_node_in_good_order_there_is_no_word() -> None:
    post = Post()
    for second in range(1, 41):
        post.stride(second, second)
        post.beat(second, beat(second, second, acknowledged=second - 2), second)
    fresh = post.of(40.5)
    assert fresh.words == ()
    assert fresh.silence is None
    assert fresh.heard_age_s == pytest.approx(0.5)
    assert fresh.rates_hz["beat"] == pytest.approx(1.0, rel=0.1)
    assert fresh.rates_hz["increment"] == pytest.approx(1.0, rel=0.1)
    assert fresh.loss == 0.0
    assert (fresh.behind, fresh.gone, fresh.unacknowledged) == (0, 0, 2)
    assert (fresh.clock_offset_s, fresh.clock_uncertainty_s) == (-3.0, 0.02)


def test_silence_is_told_and_the_rates_fall() -> None:
    post = Post()
    for second in range(20):
        post.beat(second + 1, beat(second, 0), second)
    assert post.of(23.0).silence is None
    assert post.of(31.0).silence == "not heard for 12 s"
    assert post.of(60.0).rates_hz["beat"] == 0.0
    assert post.of(60.0).loss is None


def test_what_is_behind_is_told_until_it_is_here() -> None:
    post = Post()
    post.stride(1.0, 1)
    post.beat(1, beat(2.0, 241), 2.0)
    assert post.of(3.0).words == ("240 messages behind, refilling",)
    assert post.of(3.0, alive=False).words == ("240 messages behind",)
    for number in range(2, 242):
        post.stride(4.0, number)
    assert post.of(4.0).words == ()


def test_what_is_gone_is_told() -> None:
    post = Post()
    post.beat(1, beat(1.0, 100, kept_from=41), 1.0)
    fresh = post.of(2.0)
    assert (fresh.gone, fresh.behind) == (40, 60)
    assert fresh.words == ("60 messages behind, refilling", "40 messages lost for good")


def test_a_link_that_loses_is_told_by_the_gaps_in_what_is_said_once() -> None:
    post = Post()
    for number in range(1, 101):
        if number % 4:
            post.beat(number, beat(number / 10, 0), number / 10)
    fresh = post.of(10.0)
    assert fresh.loss == pytest.approx(0.25, abs=0.02)
    assert fresh.words == (f"link loses {fresh.loss:.0%}",)


def test_a_new_process_is_no_loss() -> None:
    post = Post()
    for number in range(1, 31):
        post.beat(number, beat(number / 10, 0), number / 10)
    for number in range(1000, 1031):
        said = sealed(encode(beat(4.0, 0)), b"process2", number)
        post.hear(4.0, "beat", said)
    assert post.of(5.0).loss == 0.0


def test_who_sends_what_is_of_no_use_is_named_even_if_nothing_was_let_in() -> None:
    fresh = Post().of(1.0, alive=False, useless={"responder/r1": 5000, "?": 7})
    assert fresh.silence == "never heard"
    assert fresh.words == ("5000 useless messages",)


def test_a_clock_that_is_set_back_begins_anew() -> None:
    post = Post()
    for number in range(1, 31):
        post.beat(number, beat(100.0, 0), 100.0)
    post.beat(31, beat(5.0, 0), 5.0)
    fresh = post.of(5.0)
    assert fresh.heard_age_s == 0.0
    assert fresh.rates_hz["beat"] < 1.0


def test_the_roster_shows_the_words_and_is_json() -> None:
    post = Post()
    incident = Incident(IncidentSettings(incident="test"))
    post.beat(1, beat(1.0, 240), 1.0)
    incident.handle("clew/v1/test/responder/r1/beat", encode(beat(1.0, 240)), at(1.0))
    nodes = post.watch.fresh(at(8.0), [R1], post.gate, {"responder/r1": 50, "dap/mad": 99_000})
    roster = make_roster(incident, at(8.0), RosterSettings(), [R1], nodes)
    console = Console(width=240)
    with console.capture() as captured:
        console.print(roster_table(roster))
    said = captured.get()
    (of_r1,) = (line for line in said.splitlines() if "r1" in line)
    assert "not heard for 7 s; 240 messages behind; 50 useless messages" in of_r1
    (of_mad,) = (line for line in said.splitlines() if "mad" in line)
    assert "99000 useless messages" in of_mad
    told = msgspec.json.decode(msgspec.json.encode(roster.nodes))
    assert [node[1] for node in told] == ["mad", "r1"]
