"""Where machine code is kept, and when it is not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from numba import njit

from shared import compiled as module
from shared.compiled import compiled, direct, is_kept


def doubled(number: float) -> float:
    return 2.0 * number


def test_without_a_place_to_keep_it_a_kernel_is_compiled_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    original: Callable[..., Any] = njit

    def nowhere(*, cache: bool = False, **options: str) -> Any:
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return original(**options)

    monkeypatch.setattr(module, "njit", nowhere)
    kernel = compiled(doubled)
    assert kernel(4.0) == 8.0
    assert not is_kept(kernel)


def test_machine_code_older_than_any_kernel_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel: Any = compiled(doubled)
    kernel(4.0)
    (index,) = Path(kernel.stats.cache_path).glob("*.doubled-*.nbi")
    assert is_kept(kernel)
    again: Any = compiled(doubled)
    assert index.exists()
    assert again(4.0) == 8.0
    assert sum(again.stats.cache_hits.values()) == 1
    later_ns = index.stat().st_mtime_ns + 1
    monkeypatch.setattr(module, "_sources_changed_ns", lambda _: later_ns)
    compiled(doubled)
    assert not index.exists()
    assert not is_kept(kernel)


def test_machine_code_called_directly_is_the_kernel() -> None:
    kernel = compiled(doubled)
    with pytest.raises(ValueError, match="not enough values"):
        direct(kernel)
    kernel(4.0)
    assert direct(kernel)(4.5) == 9.0
    assert direct(kernel)(4) == 8.0
