"""Tables as text: the encoding, the delimiter and the decimal sign of an export."""

from __future__ import annotations

import codecs
from pathlib import Path

from edge_agent.sources.recording import SourceError


def read_lines(path: Path) -> tuple[list[str], bool]:
    """Return the lines of a file, and whether the last one was ended.

    Raises ``SourceError`` if it cannot be read.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise SourceError(f"{path}: cannot be read ({error.strerror}); give another") from None
    text = decoded(raw)
    return text.splitlines(), text.endswith(("\n", "\r"))


def decoded(raw: bytes) -> str:
    """Return the text of a file, in UTF-8, UTF-16 or the code page of older Windows programs."""
    if raw[:2] in {codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE}:
        return raw.decode("utf-16", errors="replace")
    # A first letter that is one of ours, in two bytes.
    if raw[1:2] == b"\0":
        return raw.decode("utf-16-le", errors="replace")
    if raw[:1] == b"\0":
        return raw.decode("utf-16-be", errors="replace")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        # Older Windows programs write ° and µ in their own code page.
        return raw.decode("cp1252", errors="replace")


def delimiter_of(line: str) -> str:
    """Return the delimiter that stands in a line most often."""
    return max(",;\t", key=line.count)


def cells_of(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line, without quotes and the spaces around."""
    return [cell.strip(' "') for cell in line.split(delimiter)]


def number_in(cell: str, delimiter: str) -> float:
    """Return the number in a cell; ``ValueError`` if there is none.

    Where commas do not part the cells, they may stand for the decimal point.
    """
    return float(cell if delimiter == "," else cell.replace(",", "."))
