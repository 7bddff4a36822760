"""Whether all that nodes had said by some moment is safe at their post, by their beats (pure)."""

from __future__ import annotations

from collections.abc import Iterable

from shared.messages import Beat


class LastWords:
    """Hears beats from the moment on: each node's first says how much it had said by then."""

    def __init__(self) -> None:
        self._said: dict[str, int] = {}
        self._safe: dict[str, int] = {}

    def hear(self, node_id: str, beat: Beat) -> None:
        """Take in what a node says of its journal."""
        self._said.setdefault(node_id, beat.last_number)
        self._safe[node_id] = beat.acknowledged

    def are_safe(self, node_ids: Iterable[str]) -> bool:
        """Say whether the post has acknowledged all that these nodes had said."""
        return all(
            node_id in self._said and self._safe[node_id] >= self._said[node_id]
            for node_id in node_ids
        )
