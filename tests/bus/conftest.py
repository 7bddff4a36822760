"""Fixtures of the tests on a bus."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.bus.dap_site import Site


@pytest.fixture
def site() -> Iterator[Site]:
    site = Site()
    with site.others, site.bus:
        yield site
