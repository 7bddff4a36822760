"""What the shell of every program needs: logging, stopping, waiting, exit codes."""

from __future__ import annotations

import _thread
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from enum import IntEnum
from types import FrameType
from typing import Literal, NoReturn, TypeAlias

import structlog

from shared.clock import Clock

LogLevel: TypeAlias = Literal["debug", "info", "warning", "error"]

IMPATIENCE_S = 0.5
"""A signal that follows another within this is the same one, sent to process and group."""

AGAIN_S = 0.02
"""When an interruption that was lost is tried again."""

end_process: Callable[[int], NoReturn] = os._exit
"""What ends this process; tests that run a program in theirs put another in its place."""

LONGEST_WAIT_S = 0.5
"""So that a clock that is set meanwhile is noticed, and Ctrl-C where a wait cannot be broken."""


class ExitCode(IntEnum):
    """What a program's exit says."""

    OK = 0
    """Done, or stopped when asked to."""

    FAILURE = 1
    """What was asked for could not be done; the log says why."""

    USAGE = 2
    """The command line or a settings file is wrong: nothing was begun."""

    INTERRUPTED = 130
    """Stopped by a signal before there was a result, or by a second one before all was closed."""


def configure_logging(level: LogLevel = "info", *, json: bool = False) -> None:
    """Send all logs, structlog's and the standard library's, to standard error.

    On a terminal for people to read, else one ``key=value`` line each, or one JSON object with
    ``json``. Standard output stays free for results.
    """
    annotate: list[structlog.typing.Processor] = [
        structlog.contextvars.merge_contextvars,
        structlog.stdlib.add_log_level,
        structlog.stdlib.add_logger_name,
        structlog.stdlib.ExtraAdder(),
        structlog.processors.TimeStamper(fmt="iso", utc=True),
        _withhold_secrets,
    ]
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=annotate,
            processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *_render(json)],
        )
    )
    handler.set_name("json" if json else "text")
    logging.basicConfig(level=level.upper(), handlers=[handler], force=True)
    logging.captureWarnings(capture=True)
    structlog.configure(
        processors=[
            structlog.stdlib.filter_by_level,
            *annotate,
            structlog.stdlib.PositionalArgumentsFormatter(),
            structlog.stdlib.ProcessorFormatter.wrap_for_formatter,
        ],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
    )


def logging_options() -> tuple[str, str]:
    """Return how ``configure_logging`` was told to log: the level, and ``text`` or ``json``."""
    root = logging.getLogger()
    forms = {handler.get_name() for handler in root.handlers}
    return logging.getLevelName(root.level).lower(), "json" if "json" in forms else "text"


def quieten_logging() -> None:
    """Log warnings and worse alone from now on."""
    root = logging.getLogger()
    root.setLevel(max(root.level, logging.WARNING))


def _withhold_secrets(
    _logger: object, _name: str, event: structlog.typing.EventDict
) -> structlog.typing.EventDict:
    """Let no private key into a log, whoever hands one over by mistake."""
    for name, value in event.items():
        if "PRIVATE KEY" in str(value):
            event[name] = "(a private key, withheld)"
    return event


def _render(json: bool) -> list[structlog.typing.Processor]:
    if json:
        return [structlog.processors.format_exc_info, structlog.processors.JSONRenderer()]
    if sys.stderr.isatty():
        return [structlog.dev.ConsoleRenderer(colors="NO_COLOR" not in os.environ)]
    first = ["timestamp", "level", "logger", "event"]
    return [
        structlog.processors.format_exc_info,
        structlog.processors.LogfmtRenderer(key_order=first, bool_as_flag=False),
    ]


@contextmanager
def stop_on_signals() -> Iterator[threading.Event]:
    """Give an event that is set by SIGINT or SIGTERM; whoever is impatient signals again.

    So it is by SIGHUP, when the terminal is gone, unless that is to be ignored (``nohup``). A
    second signal ends the program on the spot with ``ExitCode.INTERRUPTED``. To be entered in the
    main thread (else ``ValueError``); the former handlers return at the end of the block.
    """
    stop = threading.Event()
    asked_s: float | None = None

    def ask(_number: int, _frame: FrameType | None) -> None:
        """Ask for the end; end at once if that was asked for a while ago."""
        nonlocal asked_s
        if asked_s is None:
            asked_s = time.monotonic()
            # The main thread may be inside this very event, holding its lock.
            _thread.start_new_thread(stop.set, ())
        elif time.monotonic() - asked_s > IMPATIENCE_S:
            os._exit(ExitCode.INTERRUPTED)

    former = {number: signal.signal(number, ask) for number in _stopping()}
    try:
        yield stop
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)


def _stopping() -> Iterator[signal.Signals]:
    yield from (signal.SIGINT, signal.SIGTERM)
    # Windows has none.
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        yield signal.SIGHUP


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Within the block, SIGINT and SIGTERM end the process on the spot.

    For what holds nothing that would have to be given back, and cannot be interrupted: the building
    of machine code heeds no handler for seconds. To be entered in the main thread; elsewhere
    nothing is changed.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = (signal.SIGINT, signal.SIGTERM)
    former = {number: signal.signal(number, signal.SIG_DFL) for number in numbers}
    try:
        yield
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)


def leave(code: int) -> NoReturn:
    """End the process with ``code``, on the spot: all that had to be closed has been.

    The interpreter would take half a second of a core to take apart what it has loaded, which is
    many seconds on a machine that is busy, and would wait for threads that a link holds which
    answers nobody.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    end_process(code)


def interrupt_on_signals() -> None:
    """Have SIGINT and SIGTERM raise ``KeyboardInterrupt`` in the main thread, from now on.

    For work without a loop that could heed ``stop_on_signals``: what it holds is given back on the
    way out. A second signal ends the program on the spot with ``ExitCode.INTERRUPTED``.
    """
    asked_s: float | None = None

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        """Raise it once; end at once if that was done a while ago."""
        nonlocal asked_s
        if asked_s is None:
            asked_s = time.monotonic()
            raise KeyboardInterrupt
        if time.monotonic() - asked_s > IMPATIENCE_S:
            os._exit(ExitCode.INTERRUPTED)

    def interrupt_again(ignored: sys.UnraisableHookArgs) -> None:
        """Raise once more what was lost where nobody could catch it."""
        nonlocal asked_s
        if ignored.exc_type is not KeyboardInterrupt:
            sys.__unraisablehook__(ignored)
            return
        # It was raised where C calls back, as a compiler does, and was lost there.
        asked_s = None
        again = threading.Timer(AGAIN_S, os.kill, (os.getpid(), signal.SIGTERM))
        again.daemon = True
        again.start()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, interrupt)
    sys.unraisablehook = interrupt_again


def stop_with_parent(stop: threading.Event, pipe: int = 0) -> None:
    """Set ``stop`` once the other end of ``pipe`` (standard input) is closed.

    A launcher that starts a child with a pipe on its standard input, and holds the other end, so
    takes the child along even when it is killed itself. Call this in such children only: with
    standard input from a file or from /dev/null the end comes at once.
    """
    _at_the_end_of(pipe, stop.set)


def end_with_parent(pipe: int = 0) -> None:
    """Send this process SIGTERM once the other end of ``pipe`` is closed (``stop_with_parent``)."""
    _at_the_end_of(pipe, lambda: os.kill(os.getpid(), signal.SIGTERM))


def _at_the_end_of(pipe: int, act: Callable[[], None]) -> None:
    def wait_for_the_end() -> None:
        # os.read, for a thread blocked inside sys.stdin would hold its lock at exit.
        while os.read(pipe, 4096):
            pass
        act()

    threading.Thread(target=wait_for_the_end, name="stop-with-parent", daemon=True).start()


@contextmanager
def set_by_button() -> Iterator[threading.Event]:
    """Give an event that SIGUSR1 sets: what a button on a unit or a box is to send the program.

    To be entered in the main thread. Where there is no such signal (Windows) nothing sets it.
    """
    pressed = threading.Event()
    if not hasattr(signal, "SIGUSR1"):
        yield pressed
        return

    def note(_number: int, _frame: FrameType | None) -> None:
        # The main thread may be inside this very event, holding its lock.
        _thread.start_new_thread(pressed.set, ())

    former = signal.signal(signal.SIGUSR1, note)
    try:
        yield pressed
    finally:
        signal.signal(signal.SIGUSR1, former)


def wait_until(clock: Clock, time_ns: int, stop: threading.Event) -> bool:
    """Wait until ``clock`` reads ``time_ns``; return whether it does, ``False`` on ``stop``."""
    while not stop.is_set():
        remaining_s = clock.real_seconds_until(time_ns)
        if remaining_s <= 0.0:
            return True
        stop.wait(min(remaining_s, LONGEST_WAIT_S))
    return False
