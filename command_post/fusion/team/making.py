"""How a crew's commit is made, once it is known from what (pure)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from command_post.fusion.team.alone import commit_of_crowd
from command_post.fusion.team.crews import Crew
from command_post.fusion.team.doubts import examine
from command_post.fusion.team.height_assembly import Heights, solve_heights, walked_storeys
from command_post.fusion.team.heights import with_known
from command_post.fusion.team.log import Installed, TeamLog
from command_post.fusion.team.quarters import with_all_ways, with_likeliest_quarter
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import Solution
from command_post.fusion.team.solving import Solved, commit
from command_post.fusion.team.suspicions import supposed
from command_post.fusion.team.whole_turns import likeliest


class Commit(NamedTuple):
    """A crew as it was solved, where the DAPs stood that it set down, and what it was made of.

    ``made_of`` are the serial numbers of other commits.
    """

    serial: int
    crew: Crew
    solution: Solution
    places: Mapping[str, tuple[Installed, ...]]
    made_of: tuple[int, ...]


class Fresh(NamedTuple):
    """What was solved last of a crew, of which log, and its heights."""

    time_ns: int
    log: TeamLog
    solved: Solved
    heights: Heights


def solved_crew(
    crew: Crew, log: TeamLog, time_ns: int, before: Solution, settings: TeamSettings
) -> tuple[Solution, Fresh] | None:
    """Return a commit's solution, and what is behind it; ``None`` if there is none."""
    solve = commit if crew.is_everybody else commit_of_crowd
    solved = solve(supposed(log, before.suspicions), time_ns, before, settings)
    if solved is None or not solved.is_sound:
        return None
    solved = likeliest(solved, settings)
    if crew.is_everybody:
        solved = with_likeliest_quarter(solved, settings)
    solved, held, examined = examine(
        log, time_ns, solved, before, settings, of_crowd=not crew.is_everybody
    )
    solution = solved.solution(time_ns, solved.noise(settings))._replace(
        held=held, examined=examined, storeys_m=before.storeys_m
    )
    log = supposed(log, solution.suspicions)
    heights = solve_heights(log, solved.assembled, time_ns, settings)
    if heights.is_sound:
        levels_m = walked_storeys(solved.assembled, heights).tolist()
        if not crew.is_everybody:
            levels_m = with_known(levels_m, before.storeys_m)
        solution = solution._replace(storeys_m=tuple(levels_m))
    solved = with_all_ways(
        solved, settings, settings.commit_iterations, is_everybody=crew.is_everybody
    )
    return solution, Fresh(time_ns, log, solved, heights)
