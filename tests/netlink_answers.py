"""What the kernel sends of a Wi-Fi station, in bytes, as ``nl80211.h`` numbers them."""

from __future__ import annotations

import struct

NEW_STATION = 19
MAC, STA_INFO, GENERATION, IFINDEX = 6, 21, 46, 3
INACTIVE_TIME, RX_BYTES, SIGNAL, RX_PACKETS, TX_PACKETS = 1, 2, 7, 9, 10
SIGNAL_AVG, RX_BYTES64, CHAIN_SIGNAL, CHAIN_SIGNAL_AVG = 13, 23, 25, 26
NESTED = 0x8000


def attribute(kind: int, value: bytes) -> bytes:
    """Return one attribute, padded to four bytes."""
    length = 4 + len(value)
    return struct.pack("<HH", length, kind) + value + bytes(-length % 4)


def station(
    mac: str,
    *,
    packets: int,
    inactive_ms: int = 0,
    signal_dbm: int | None = None,
    average_dbm: int | None = None,
    chains_dbm: tuple[int, ...] = (),
) -> bytes:
    """Return the message of a dump that tells of one station; others than those given are there."""
    told = {
        INACTIVE_TIME: struct.pack("<I", inactive_ms),
        RX_PACKETS: struct.pack("<I", packets),
        TX_PACKETS: struct.pack("<I", 7),
        RX_BYTES: struct.pack("<I", (100 * packets) & 0xFFFFFFFF),
        RX_BYTES64: struct.pack("<Q", 100 * packets),
    }
    if signal_dbm is not None:
        told[SIGNAL] = struct.pack("<b", signal_dbm)
    if average_dbm is not None:
        told[SIGNAL_AVG] = struct.pack("<b", average_dbm)
    if chains_dbm:
        chains = b"".join(attribute(n, struct.pack("<b", dbm)) for n, dbm in enumerate(chains_dbm))
        told[CHAIN_SIGNAL | NESTED] = chains
        told[CHAIN_SIGNAL_AVG | NESTED] = chains
    return message(
        attribute(IFINDEX, struct.pack("<I", 4))
        + attribute(MAC, bytes.fromhex(mac.replace(":", "")))
        + attribute(GENERATION, struct.pack("<I", 1))
        + attribute(STA_INFO | NESTED, b"".join(attribute(*each) for each in told.items()))
    )


def message(attributes: bytes) -> bytes:
    """Return a whole message with its headers."""
    body = struct.pack("<BBH", NEW_STATION, 1, 0) + attributes
    return struct.pack("<IHHII", 16 + len(body), 30, 2, 1, 1) + body
