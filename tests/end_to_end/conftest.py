"""What these tests share: a post that need not build its machine code while somebody waits."""

from __future__ import annotations

import pytest

from command_post.fusion.methods import prepare_fusion
from command_post.fusion.settings import FusionSettings


@pytest.fixture(scope="session", autouse=True)
def _prepared() -> None:
    prepare_fusion(FusionSettings())
