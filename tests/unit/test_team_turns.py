"""Whose headings are tried at a commit: all of a team, of a crowd each in turn."""

from __future__ import annotations

from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solving import turned_at
from shared.units import NS_PER_S

SETTINGS = TeamSettings()
MOST = SETTINGS.turned_a_commit
COMMIT_NS = round(SETTINGS.commit_s * NS_PER_S)


def test_all_of_a_team_are_tried_each_time() -> None:
    for commit in range(3):
        assert turned_at(commit * COMMIT_NS, 16, MOST, SETTINGS) == list(range(16))


def test_of_a_crowd_everybody_is_tried_in_turn() -> None:
    tried = [turned_at(commit * COMMIT_NS, 37, MOST, SETTINGS) for commit in range(5)]
    assert all(len(set(each)) == MOST for each in tried)
    assert set(tried[0]) | set(tried[1]) | set(tried[2]) == set(range(37))
    assert turned_at(3 * COMMIT_NS, 37, MOST, SETTINGS) == tried[3]
