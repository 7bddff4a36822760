"""Fixtures for every test."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import structlog
from hypothesis import settings

from tests.machine_code import build_machine_code

# The same examples every time, and as much time as a loaded machine needs.
settings.register_profile("clew", derandomize=True, deadline=None, max_examples=50)
settings.load_profile("clew")

CHECKOUT = Path(__file__).resolve().parent.parent
COLLECT = (sys.executable, "-m", "pytest", "--collect-only", "--quiet", "-n", "0")


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Have benchmarks run by themselves: nothing else is to be at work beside them."""
    if config.option.benchmark_enable:
        config.option.numprocesses, config.option.dist = 0, "no"


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes(config: pytest.Config) -> None:
    """Have machine code and bytecode made once, before several of all tests want it at a time."""
    if config.args_source == pytest.Config.ArgsSource.TESTPATHS:
        with ExitStack() as meanwhile:
            if not sys.dont_write_bytecode:
                meanwhile.enter_context(subprocess.Popen(COLLECT, stdout=subprocess.DEVNULL))
            build_machine_code()


@pytest.fixture(scope="session", autouse=True)
def _own_state(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep journals of tests apart from the user's own, in processes that tests start too."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(scope="session", autouse=True)
def _stay() -> Iterator[None]:
    """Have a program that a test runs in this process raise ``SystemExit`` at its end."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("shared.process.end_process", sys.exit)
        yield


@pytest.fixture(autouse=True)
def _own_logging() -> Iterator[None]:
    """Undo what a program that a test runs in this process does to the logs of all others."""
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    yield
    structlog.reset_defaults()
    logging.captureWarnings(capture=False)
    root.handlers[:], root.level = handlers, level


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the real recordings: ``CLEW_DATA``, else ``shared/data`` beside the checkout."""
    named = os.environ.get("CLEW_DATA")
    folder = Path(named) if named else CHECKOUT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no real recordings at {folder}: set CLEW_DATA to their folder")
    return folder


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Write each benchmark's figures, as in ``messages_per_s=85000``."""
    session = getattr(terminalreporter.config, "_benchmarksession", None)
    for benchmark in session.benchmarks if session is not None else ():
        figures = ", ".join(f"{name}={value}" for name, value in benchmark.extra_info.items())
        if figures:
            terminalreporter.write_line(f"{benchmark.name}: {figures}")
