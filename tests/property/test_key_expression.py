"""Key expressions mean in memory what they mean to Zenoh."""

from __future__ import annotations

import pytest
import zenoh
from hypothesis import example, given
from hypothesis import strategies as st

from shared.bus.key_expression import check_key, check_key_expression, matches

chunks = st.sampled_from(["a", "b", "v1", "@v1", "ab"])
keys = st.lists(chunks, min_size=1, max_size=6).map("/".join)
expressions = (
    st.lists(chunks | st.sampled_from(["*", "**"]), min_size=1, max_size=6)
    .map("/".join)
    .filter(lambda text: "**/*" not in text)
)


@given(expression=expressions, key=keys)
@example("clew/**", "clew")
@example("**/b", "b")
@example("*/**/b", "a/b")
@example("**/@v1", "a/@v1")
def test_matching_agrees_with_zenoh(expression: str, key: str) -> None:
    expected = zenoh.KeyExpr(check_key_expression(expression)).intersects(zenoh.KeyExpr(key))
    assert matches(expression, check_key(key)) == expected


@given(text=st.text(st.sampled_from("ab/*$#?@é "), max_size=8))
def test_what_is_accepted_zenoh_accepts(text: str) -> None:
    try:
        check_key_expression(text)
    except ValueError:
        return
    assert str(zenoh.KeyExpr(text)) == text


@pytest.mark.parametrize(
    "text", ["", "/a", "a/", "a//b", "a*", "**/**", "**/*", "a/$*", "a#", "a?"]
)
def test_malformed_expressions_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match="key expression"):
        check_key_expression(text)
