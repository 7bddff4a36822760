"""How every program runs its command line."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pkgutil import resolve_name
from types import MappingProxyType
from typing import Annotated, Literal

import structlog
from cyclopts import App, CycloptsError, Group, Parameter

from shared.process import ExitCode, LogLevel, configure_logging, interrupt_on_signals, leave

_EVERYWHERE = Group("Logging")

_log = structlog.stdlib.get_logger(__name__)


def run_command_line(app: App, commands: Mapping[str, str] = MappingProxyType({})) -> None:
    """Run ``app`` on this process's arguments and exit with what its command returns.

    ``commands`` are those that ``app`` knows as ``module:function``: each is imported when it is
    run. Where none is named they all are, so that help has each one's own words.

    A mistake in the arguments is told by ``app`` and exits with ``ExitCode.USAGE``. A signal that
    the command does not heed itself breaks it off, and exits with ``ExitCode.INTERRUPTED``.
    """
    configure_logging()
    interrupt_on_signals()
    if not any(argument in commands for argument in sys.argv[1:]):
        for name, where in commands.items():
            del app[name]
            app.command(resolve_name(where), name=name)
    if app.meta.default_command is None:
        app.meta.default(_with_logging(app))
    try:
        code = app.meta(sys.argv[1:], exit_on_error=False, result_action="return_value")
    except CycloptsError:
        code = ExitCode.USAGE
    except KeyboardInterrupt:
        code = ExitCode.INTERRUPTED
    leave(code if isinstance(code, int) else ExitCode.OK)


def _with_logging(app: App) -> Callable[..., object]:
    """Return what runs a command of ``app``, and heeds the options that all commands have."""

    def run(
        *tokens: Annotated[str, Parameter(show=False, allow_leading_hyphen=True)],
        log: Annotated[Literal["text", "json"], Parameter(group=_EVERYWHERE)] = "text",
        log_level: Annotated[LogLevel, Parameter(group=_EVERYWHERE)] = "info",
    ) -> object:
        """Run a command.

        Parameters
        ----------
        tokens
            The command and its own arguments.
        log
            What goes to standard error: for people, or one JSON object a line.
        log_level
            The least that is logged.

        """
        configure_logging(log_level, json=log == "json")
        empty = _empty(tokens)
        if empty is not None:
            _log.error(f"{empty}: is empty; give a value, or leave it out")
            return ExitCode.USAGE
        return app(tokens, exit_on_error=False, result_action="return_value")

    return run


def _empty(tokens: Sequence[str]) -> str | None:
    """Return what is given no value, as by a shell's variable that is not set.

    A path without a name would be the folder one is in.
    """
    for before, token in pairwise(("", *tokens)):
        option, equals, value = token.partition("=")
        if not token:
            return before if before.startswith("--") else "an argument"
        if option.startswith("--") and equals and not value:
            return option
    return None
