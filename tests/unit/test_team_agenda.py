"""When crews are solved: each once a period, one after another, whatever the others do."""

from __future__ import annotations

from itertools import pairwise

from command_post.fusion.team.agenda import BUSY_SHARE, Agenda, Due
from command_post.fusion.team.crews import Bonds
from command_post.fusion.team.lines import Lines
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.settings import TeamSettings
from shared.units import NS_PER_S

SETTINGS = TeamSettings(crew_most=2, solved_a_second=1.0)
PERIOD_NS = round(SETTINGS.commit_s * NS_PER_S)
LONERS = 60
"""Each is a crew, solved once a period."""


def bonds(late: bool = False) -> Bonds:
    bonds = Bonds()
    for number in range(LONERS):
        bonds.note_began(f"r{number}", 1 + number)
    if late:
        bonds.note_began("late", 0)
    return bonds


def asked(bonds: Bonds, times_ns: range) -> list[Due]:
    """Return who is due in the second period, asked at these times after its beginning."""
    agenda = Agenda(Lines(TeamLog(), bonds, SETTINGS), SETTINGS)
    agenda.due_before(PERIOD_NS)
    return [due for each in times_ns for due in agenda.due_before(PERIOD_NS + each + 1)]


def test_each_is_solved_once_a_period_and_none_while_another_has_its_time() -> None:
    due = asked(bonds(), range(0, PERIOD_NS, NS_PER_S // 1000))
    assert {each.crew.leader for each in due} == {f"r{number}" for number in range(LONERS)}
    assert len(due) == LONERS
    assert all(each.time_ns <= each.at_ns < 2 * PERIOD_NS for each in due)
    share_ns = round(BUSY_SHARE * PERIOD_NS / LONERS)
    assert min(other.at_ns - one.at_ns for one, other in pairwise(due)) >= share_ns
    as_of_ns = [each.time_ns for each in due]
    assert as_of_ns == sorted(as_of_ns)
    assert min(other - one for one, other in pairwise(as_of_ns)) < share_ns / 10


def test_asked_rarely_it_tells_the_same() -> None:
    often = asked(bonds(), range(0, PERIOD_NS, NS_PER_S // 1000))
    assert asked(bonds(), range(0, PERIOD_NS, NS_PER_S // 2)) == often
    assert asked(bonds(), range(PERIOD_NS - 1, PERIOD_NS)) == often


def test_who_turns_out_to_have_begun_first_moves_nobody_else_in_time() -> None:
    every = range(0, PERIOD_NS, NS_PER_S // 1000)
    as_of = {due.crew: due.time_ns for due in asked(bonds(), every)}
    with_late = {due.crew: due.time_ns for due in asked(bonds(late=True), every)}
    assert {crew: at for crew, at in with_late.items() if crew.leader != "late"} == as_of
