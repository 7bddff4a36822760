"""Wire logs: what goes in comes out, and what is missing is told."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.bus.interface import BusClosedError
from shared.bus.wire_log import WireFrame, WireLogBus, WireLogError, read_wire_log
from shared.clock import ManualClock
from shared.codec import MAX_PAYLOAD_BYTES

FRAMES = [
    WireFrame(0, "clew/v1/i/responder/r1/start", b""),
    WireFrame(1_750_000_000_000_000_000, "clew/v1/i/responder/r1/increment", b"\x00\xff"),
    WireFrame(1_750_000_000_000_000_000, "clew/ä", bytes(MAX_PAYLOAD_BYTES)),
    WireFrame(5, "clew/back-in-time", b"CLEWLOG1"),
]


def write(path: Path, frames: list[WireFrame]) -> None:
    clock = ManualClock()
    with WireLogBus(path, clock) as bus:
        for frame in frames:
            clock.set_ns(frame.time_ns)
            bus.publish(frame.key, frame.payload)


@pytest.mark.parametrize("frames", [[], FRAMES[:1], FRAMES])
def test_frames_come_back(tmp_path: Path, frames: list[WireFrame]) -> None:
    write(tmp_path / "r1.wire", frames)
    assert list(read_wire_log(tmp_path / "r1.wire")) == frames


def test_the_file_appears_when_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "r1.wire"
    bus = WireLogBus(path, ManualClock())
    bus.publish("clew/x", b"1")
    assert not path.exists()
    bus.close()
    bus.close()
    bus.publish("clew/x", b"2")
    assert list(read_wire_log(path)) == [WireFrame(0, "clew/x", b"1")]
    assert list(tmp_path.iterdir()) == [path]


def test_an_error_discards_it(tmp_path: Path) -> None:
    def fail() -> None:
        with WireLogBus(tmp_path / "r1.wire", ManualClock()) as bus:
            bus.publish("clew/x", b"1")
            raise RuntimeError("simulation failed")

    with pytest.raises(RuntimeError, match="simulation failed"):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_cut_anywhere_the_whole_frames_come_and_then_the_error(tmp_path: Path) -> None:
    frames = [WireFrame(1, "clew/a", b"12"), WireFrame(2, "clew/bc", b"345")]
    write(tmp_path / "r1.wire", frames)
    whole = (tmp_path / "r1.wire").read_bytes()
    cut = tmp_path / "cut.wire"
    ends = [8 + 14 + 6 + 2, 8 + 14 + 6 + 2 + 14 + 7 + 3]
    for length in range(8, len(whole)):
        cut.write_bytes(whole[:length])
        count = sum(length >= end for end in ends)
        reader = read_wire_log(cut)
        assert [next(reader) for _ in range(count)] == frames[:count]
        with pytest.raises(WireLogError, match=rf"cut\.wire: cut off after {count} whole frames"):
            next(reader)


@pytest.mark.parametrize("content", [b"", b"CLEW", b"\x89MCAP0\r\n and more"])
def test_another_file_is_told_from_a_wire_log(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.wire"
    path.write_bytes(content)
    with pytest.raises(WireLogError, match="not a wire log"):
        next(read_wire_log(path))


def test_a_missing_frame_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "x.wire"
    write(path, FRAMES[:2])
    whole = path.read_bytes()
    first = 14 + len(FRAMES[0].key)
    path.write_bytes(whole[:8] + whole[8 + first :])
    reader = read_wire_log(path)
    assert next(reader) == FRAMES[1]
    with pytest.raises(WireLogError, match="damaged"):
        next(reader)


@given(st.binary(max_size=300))
def test_any_bytes_are_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, tail: bytes
) -> None:
    path = tmp_path_factory.mktemp("any") / "x.wire"
    path.write_bytes(b"CLEWLOG1" + tail)
    with suppress(WireLogError):
        assert all(len(frame.payload) < len(tail) for frame in read_wire_log(path))


def test_nobody_else_is_there(tmp_path: Path) -> None:
    with WireLogBus(tmp_path / "r1.wire", ManualClock()) as bus:
        bus.subscribe("clew/**", lambda received: pytest.fail(received.key))
        bus.answer("clew/x", lambda _: pytest.fail("asked"))
        bus.watch_alive("clew/**", lambda key, alive: pytest.fail(f"{key} {alive}"))
        bus.declare_alive("clew/alive")
        bus.publish("clew/x", b"1")
        assert bus.query("clew/**", timeout_s=10.0) == []
    with pytest.raises(BusClosedError):
        bus.subscribe("clew/**", lambda received: pytest.fail(received.key))


def test_what_no_receiver_would_take_is_refused(tmp_path: Path) -> None:
    with WireLogBus(tmp_path / "r1.wire", ManualClock()) as bus:
        with pytest.raises(ValueError, match="limit is 65536"):
            bus.publish("clew/x", bytes(MAX_PAYLOAD_BYTES + 1))
        with pytest.raises(ValueError, match="key"):
            bus.publish("clew/*", b"")
