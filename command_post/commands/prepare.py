"""``command-post prepare``: what the first start would wait for, done ahead."""

from __future__ import annotations

from time import perf_counter
from typing import Annotated

import structlog
from cyclopts import Parameter

from command_post.fusion.methods import prepare_fusion
from command_post.fusion.settings import FusionSettings
from shared.process import ExitCode, end_with_parent, ended_by_signals

_log = structlog.stdlib.get_logger(__name__)


def prepare(*, with_parent: Annotated[bool, Parameter(show=False)] = False) -> int:
    """Build the machine code of the fusion, once for all posts on this machine.

    Takes some tens of seconds after an installation, and about one from then on; a post that
    starts without it does the same first. Example: command-post prepare

    Parameters
    ----------
    with_parent
        End when standard input closes.

    """
    if with_parent:
        end_with_parent()
    with ended_by_signals():
        make_ready(FusionSettings())
    return ExitCode.OK


def make_ready(settings: FusionSettings) -> None:
    """Have the fusion's machine code built or loaded, and say how long that took."""
    _log.info("getting the fusion ready; after an installation some tens of seconds")
    began_s = perf_counter()
    prepare_fusion(settings)
    _log.info("fusion ready", method=settings.method, seconds=round(perf_counter() - began_s, 2))
