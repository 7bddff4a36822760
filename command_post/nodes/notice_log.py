"""What an incident has to tell of nodes, in the log."""

from __future__ import annotations

from collections.abc import Iterable

import structlog

from command_post.nodes.notices import Notice

_log = structlog.stdlib.get_logger(__name__)


def log_notices(notices: Iterable[Notice]) -> None:
    """Log what is told of nodes: as an error, with its trace, what failed for a fault of ours."""
    for reason, node_id, detail, trace in notices:
        if trace:
            _log.error(detail, reason=reason, node_id=node_id, trace=trace)
        else:
            _log.warning(detail, reason=reason, node_id=node_id)


def log_faults(notices: Iterable[Notice]) -> None:
    """Log of what is told only what failed for a fault of ours: it is not in what was made."""
    log_notices(each for each in notices if each.trace)
