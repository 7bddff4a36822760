"""Carried, installed, placed."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dap_node.installation import Installation, Standing
from shared.messages import DapEstimate, LocalPosition

TIME_NS = 1_700_000_000_000_000_000


def place(north_m: float) -> LocalPosition:
    return LocalPosition(north_m=north_m, east_m=2.0, down_m=0.0, covariance_m2=(1.0, 0.0, 1.0))


def estimate(
    north_m: float, *, dap_id: str = "dap2", time_ns: int = TIME_NS, sequence: int = 0
) -> DapEstimate:
    return DapEstimate(
        event_time_ns=time_ns, sequence=sequence, dap_id=dap_id, position=place(north_m)
    )


def installed() -> Standing:
    standing = Standing("dap2")
    standing.set_down(Installation(TIME_NS, "r1", None))
    return standing


def test_a_dap_is_carried_then_installed_then_placed() -> None:
    standing = Standing("dap2")
    assert (standing.stage, standing.installation) == ("carried", None)
    standing.set_down(Installation(TIME_NS, "r1", None))
    assert (standing.stage, standing.installation) == ("installed", (TIME_NS, "r1", None))
    news = standing.learn(estimate(5.0))
    assert news == standing.installation == (TIME_NS, "r1", place(5.0))
    assert standing.stage == "placed"


def test_a_dap_at_a_known_place_is_placed_at_once() -> None:
    standing = Standing("dap1")
    standing.set_down(Installation(TIME_NS, None, place(0.0)))
    assert standing.stage == "placed"


def test_estimates_of_others_and_other_times_are_none_of_ours() -> None:
    standing = installed()
    assert standing.learn(estimate(5.0, dap_id="dap3")) is None
    assert standing.learn(estimate(5.0, time_ns=TIME_NS - 1)) is None
    assert standing.learn(estimate(5.0, time_ns=TIME_NS + 1)) is None
    assert standing.stage == "installed"


def test_while_it_is_carried_nothing_is_learned() -> None:
    standing = Standing("dap2")
    assert standing.learn(estimate(5.0)) is None
    assert standing.stage == "carried"


def test_being_told_the_same_again_is_no_news() -> None:
    standing = installed()
    assert standing.learn(estimate(5.0)) is not None
    assert standing.learn(estimate(5.0, sequence=1)) is None


def test_a_post_that_restarts_is_believed() -> None:
    standing = installed()
    standing.learn(estimate(5.0, sequence=7))
    assert standing.learn(estimate(6.0, sequence=0)) == (TIME_NS, "r1", place(6.0))


def test_set_down_anew_its_place_is_unknown_again() -> None:
    standing = installed()
    standing.learn(estimate(5.0))
    standing.set_down(Installation(TIME_NS + 1, "r2", None))
    assert standing.stage == "installed"
    assert standing.learn(estimate(5.0)) is None
    assert standing.learn(estimate(8.0, time_ns=TIME_NS + 1)) == (TIME_NS + 1, "r2", place(8.0))


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["dap2", "dap3"]),
            st.sampled_from([TIME_NS, TIME_NS + 1]),
            st.integers(0, 3),
        )
    )
)
def test_the_last_of_ours_counts_whatever_comes_between(told: list[tuple[str, int, int]]) -> None:
    standing = installed()
    for number, (dap_id, time_ns, north_m) in enumerate(told):
        standing.learn(estimate(north_m, dap_id=dap_id, time_ns=time_ns, sequence=number))
    ours = [north_m for dap_id, time_ns, north_m in told if (dap_id, time_ns) == ("dap2", TIME_NS)]
    expected = place(ours[-1]) if ours else None
    assert standing.installation == (TIME_NS, "r1", expected)
