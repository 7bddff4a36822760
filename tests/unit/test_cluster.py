"""A cluster that cannot be had is told, and what to do."""

from __future__ import annotations

import sys

import pytest

from command_post.rehearsing.cluster import ClusterError, cluster


def test_without_dask_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ClusterError, match=r"clew\[cluster\]"), cluster("tcp://127.0.0.1:8786"):
        pass
