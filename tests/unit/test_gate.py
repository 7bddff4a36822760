"""The gate lets each message in once, and only whose word it is."""

from __future__ import annotations

from msgspec import structs

from shared.codec import encode
from shared.gate import MOST_RUNS_OF_A_NODE, Gate, JournalRun, Turned, numbering
from shared.gate_notes import noted, recalled
from shared.messages import Beat, NodeHealth
from shared.received_numbers import Hole
from shared.seal import Seal, sealed
from shared.sender import Unkept
from shared.topics import TOPICS, Key
from shared.units import NS_PER_S
from tests.traffic import increment

RUN, LATER_RUN = b"first run"[:8], b"laterrun"
INCREMENT = "clew/v1/fire/responder/r1/increment"
HEALTH = "clew/v1/fire/responder/r1/health"
BEAT = "clew/v1/fire/responder/r1/beat"


def stride_of(number: int) -> bytes:
    return encode(increment(number))


def health(said_s: int = 1) -> bytes:
    said_ns = said_s * NS_PER_S
    return encode(NodeHealth(event_time_ns=said_ns, sequence=0, level="ok", findings=()))


def beat(last: int, kept_from: int = 1) -> Beat:
    return Beat(
        event_time_ns=1,
        sequence=0,
        run=RUN.hex(),
        last_number=last,
        kept_from=kept_from,
        acknowledged=0,
    )


def test_a_journalled_message_comes_in_once_in_any_order() -> None:
    gate = Gate()
    came = [gate.admit(INCREMENT, sealed(stride_of(n), RUN, n)) for n in (1, 3, 2, 3, 1)]
    assert came == [None, None, None, "repeated", "repeated"]
    assert gate.turned == {("repeated", "r1"): 2}


def test_a_new_journal_counts_anew() -> None:
    gate = Gate()
    assert gate.admit(INCREMENT, sealed(stride_of(0), RUN, 1)) is None
    assert gate.admit(INCREMENT, sealed(stride_of(0), LATER_RUN, 1)) is None
    assert gate.admit(INCREMENT, sealed(stride_of(0), RUN, 1)) == "repeated"


def test_a_beat_tells_what_is_missing_and_what_is_gone() -> None:
    gate, outbox = Gate(), Unkept(run=LATER_RUN)
    gate.admit(INCREMENT, sealed(stride_of(0), RUN, 4))
    gate.admit(BEAT, outbox.seal(TOPICS["beat"], BEAT, encode(beat(6))))
    journal = JournalRun("responder", "r1", RUN)
    assert gate.missing() == [(journal, Hole(1, 3), 5)]
    gate.admit(BEAT, outbox.seal(TOPICS["beat"], BEAT, encode(beat(6, kept_from=3))))
    assert gate.missing() == [(journal, Hole(3, 3), 3)]
    assert gate.gone[journal] == 2


def test_what_is_not_kept_must_not_be_said_again() -> None:
    gate = Gate()
    said = [(RUN, 1), (RUN, 2), (RUN, 1), (RUN, 2), (LATER_RUN, 1), (RUN, 1), (LATER_RUN, 2)]
    came = [gate.admit(HEALTH, sealed(health(), run, number)) for run, number in said]
    assert came == [None, None, "replayed", "repeated", None, "replayed", None]


def test_of_two_by_one_name_who_stays_is_heard_and_nothing_again() -> None:
    gate = Gate()
    said = [(RUN, 1), (LATER_RUN, 1), (RUN, 2), (LATER_RUN, 1), (RUN, 1), (RUN, 2), (RUN, 3)]
    came = [gate.admit(HEALTH, sealed(health(), run, number)) for run, number in said]
    assert came == [None, None, None, "repeated", "replayed", "repeated", None]


def admitted(gate: Gate, *said: tuple[bytes, int, int]) -> list[Turned | None]:
    """Return what a gate makes of what one unit says: run, number, and when that was said, s."""
    return [gate.admit(HEALTH, sealed(health(at_s), run, number)) for run, number, at_s in said]


def test_what_was_kept_of_a_process_cannot_be_said_once_another_speaks_in_its_place() -> None:
    gate = Gate()
    # A relay hands on two, keeps the rest, and the unit is started anew elsewhere.
    assert admitted(gate, (RUN, 1, 1), (RUN, 2, 2), (LATER_RUN, 1, 100)) == [None, None, None]
    kept = [(RUN, number, number) for number in range(3, 90)]
    assert set(admitted(gate, *kept)) == {"replayed"}
    known = Gate()
    known.remember(recalled(noted(gate.remembered())))
    assert set(admitted(known, *kept)) == {"replayed"}
    assert admitted(known, (LATER_RUN, 2, 101), (RUN, 95, 95)) == [None, None], "two in turns"


def test_who_stays_of_two_is_heard_though_their_clock_is_behind() -> None:
    gate, behind_s = Gate(), 60
    assert admitted(gate, (RUN, 1, 0), (LATER_RUN, 1, behind_s)) == [None, None]
    stays = [(RUN, number, number) for number in range(2, 100)]
    came = admitted(gate, *stays)
    assert came.index(None) == came.count("replayed") <= behind_s
    assert set(came[came.index(None) :]) == {None}


def test_a_process_may_begin_with_its_clock_set_back() -> None:
    gate = Gate()
    anew = [(LATER_RUN, 1, 3), (LATER_RUN, 2, 4)]
    assert admitted(gate, (RUN, 1, 5000), *anew) == [None, None, None]


def test_an_order_is_remembered_when_many_were_given_since() -> None:
    gate = Gate()
    processes = [(b"%08d" % number, 1, number) for number in range(300)]
    assert set(admitted(gate, *processes)) == {None}
    assert set(admitted(gate, *processes)) == {"repeated"}


def test_who_makes_up_journals_takes_nobody_elses_room() -> None:
    gate, outbox = Gate(), Unkept(run=LATER_RUN)
    for number in range(2 * MOST_RUNS_OF_A_NODE):
        made_up = structs.replace(beat(9), run=f"{number:016x}")
        gate.admit(BEAT, outbox.seal(TOPICS["beat"], BEAT, encode(made_up)))
    assert len(list(gate.journals())) == MOST_RUNS_OF_A_NODE
    assert gate.admit(INCREMENT, sealed(stride_of(0), RUN, 1)) == "too_many_runs"
    another = INCREMENT.replace("r1", "r2")
    assert gate.admit(another, sealed(stride_of(0), RUN, 1)) is None


class _Knows:
    """Knows one signature."""

    def verdict(self, _key: Key, _key_text: str, seal: Seal) -> Turned | None:
        return None if seal.signature == b"s" * 64 else "forged"


def test_where_keys_are_known_all_must_be_signed() -> None:
    gate = Gate(_Knows())
    whole = Unkept(lambda _: b"s" * 64, RUN).seal(TOPICS["health"], HEALTH, health())
    altered = whole[:-1] + b"t"
    tries = [health(), sealed(health(), RUN, 1), altered, whole]
    assert [gate.admit(HEALTH, each) for each in tries] == ["unsealed", "unsigned", "forged", None]
    assert gate.turned.total() == 3


def test_forged_numbers_do_not_use_up_the_true_ones() -> None:
    gate = Gate(_Knows())
    sign_badly, sign_well = (lambda _: b"t" * 64), (lambda _: b"s" * 64)
    forged = Unkept(sign_badly, RUN).seal(TOPICS["increment"], INCREMENT, stride_of(1))
    true = Unkept(sign_well, RUN).seal(TOPICS["increment"], INCREMENT, stride_of(1))
    assert gate.admit(INCREMENT, forged) == "forged"
    assert gate.admit(INCREMENT, true) is None


def test_what_is_no_key_of_ours_is_left_to_whoever_counts_it() -> None:
    gate = Gate(_Knows())
    assert gate.admit("clew/v1/fire/responder/r1/weather", b"rain") is None
    assert gate.turned.total() == 0


def test_what_is_recalled_has_come_and_is_not_judged_again() -> None:
    class Nobody:
        def verdict(self, _key: Key, _key_text: str, _seal: Seal) -> Turned | None:
            return "unknown_signer"

    gate = Gate(Nobody())
    live = Unkept(run=LATER_RUN)
    gate.recall(INCREMENT, sealed(stride_of(0), RUN, 1))
    gate.recall(INCREMENT, sealed(stride_of(2), RUN, 3))
    gate.recall(BEAT, live.seal(TOPICS["beat"], BEAT, encode(beat(6))))
    gate.recall("nobody's", b"?")
    gate.recall(INCREMENT, b"?")
    assert [each[:2] for each in gate.missing()] == [
        (JournalRun("responder", "r1", RUN), Hole(2, 2))
    ]
    assert not gate.turned


def test_what_is_recalled_of_a_live_run_cannot_be_replayed() -> None:
    gate, outbox = Gate(), Unkept(run=RUN)
    first, second = (outbox.seal(TOPICS["health"], HEALTH, health()) for _ in range(2))
    gate.recall(HEALTH, first)
    gate.recall(HEALTH, second)
    assert gate.admit(HEALTH, first) == "replayed"
    assert gate.admit(HEALTH, second) == "repeated"


def test_what_was_lost_after_it_was_let_in_is_missing_again() -> None:
    gate, journal = Gate(), JournalRun("responder", "r1", RUN)
    for number in range(1, 6):
        gate.admit(INCREMENT, sealed(stride_of(0), RUN, number))
    assert numbering(INCREMENT, sealed(stride_of(0), RUN, 3)) == (journal, 3)
    assert numbering(HEALTH, sealed(health(), RUN, 3)) is None
    assert numbering(INCREMENT, stride_of(0)) is None
    gate.forget(journal, [Hole(3, 4)])
    gate.forget(JournalRun("responder", "r9", RUN), [Hole(1, 2)])
    assert [each[:2] for each in gate.missing()] == [(journal, Hole(3, 4))]
    assert gate.admit(INCREMENT, sealed(stride_of(0), RUN, 3)) is None
    assert gate.admit(INCREMENT, sealed(stride_of(0), RUN, 5)) == "repeated"
