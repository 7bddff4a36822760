"""Benchmarks tell what they counted, beside pytest-benchmark's table."""

from __future__ import annotations

import pytest


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Write each benchmark's figures, as in ``messages_per_s=85000``."""
    session = getattr(terminalreporter.config, "_benchmarksession", None)
    for benchmark in session.benchmarks if session is not None else ():
        figures = ", ".join(f"{name}={value}" for name, value in benchmark.extra_info.items())
        if figures:
            terminalreporter.write_line(f"{benchmark.name}: {figures}")
