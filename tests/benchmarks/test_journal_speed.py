"""How long a stride waits to be on the disk before it is said, and a post for what it missed."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

import numpy as np
from pytest_benchmark.fixture import BenchmarkFixture

from shared.codec import encode
from shared.outbox import JournalledOutbox
from shared.refill import MOST_REPLY_BYTES, MOST_ROWS
from shared.topics import TOPICS
from tests.traffic import increment

KEY = "clew/v1/fire/responder/r1/increment"


def test_keeping_strides_and_giving_them_again(tmp_path: Path, benchmark: BenchmarkFixture) -> None:
    count = 1000 if benchmark.enabled else 20
    with JournalledOutbox(tmp_path / "r1") as outbox:
        took_s = []

        def keep_all() -> None:
            for number in range(count):
                payload, began_s = encode(increment(number)), perf_counter()
                outbox.seal(TOPICS["increment"], KEY, payload)
                took_s.append(perf_counter() - began_s)

        benchmark.pedantic(keep_all, rounds=1, iterations=1)  # type: ignore[no-untyped-call]
        (holding,) = outbox.holdings()
        began_s = perf_counter()
        rows = outbox.rows(holding.run, 1, count, MOST_ROWS, MOST_REPLY_BYTES)
        read_s = perf_counter() - began_s
    assert [row.number for row in rows] == list(range(1, len(rows) + 1))
    assert holding.last_number == count
    kept_bytes = (tmp_path / "r1").stat().st_size
    benchmark.extra_info.update(
        keep_p50_ms=round(1e3 * float(np.percentile(took_s, 50)), 2),
        keep_p99_ms=round(1e3 * float(np.percentile(took_s, 99)), 2),
        read_ms=round(1e3 * read_s, 2),
        rows_read=len(rows),
        bytes_each=round(kept_bytes / count),
    )
