"""Fixtures for every test."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

# The same examples every time, and as much time as a loaded machine needs.
settings.register_profile("clew", derandomize=True, deadline=None)
settings.load_profile("clew")

CHECKOUT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the real recordings: ``CLEW_DATA``, else ``shared/data`` beside the checkout."""
    named = os.environ.get("CLEW_DATA")
    folder = Path(named) if named else CHECKOUT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no real recordings at {folder}: set CLEW_DATA to their folder")
    return folder
