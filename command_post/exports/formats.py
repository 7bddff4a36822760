"""Makes a file of a recording, in the format that its name's ending says."""

from __future__ import annotations

from pathlib import Path

from command_post.exports.endings import FORMATS, NEEDS_ORIGIN
from command_post.exports.maps import geojson_of, kml_of
from command_post.exports.material import Material
from command_post.exports.report import report_of
from command_post.exports.table import csv_of
from shared.geodesy import Origin


def exported(ending: str, material: Material, file: Path, origin: Origin | None) -> bytes:
    """Return a recording, read from ``file``, in the format of ``ending``.

    Raises ``ValueError`` for an ending that is none of ``FORMATS``, or that needs an origin.
    """
    if ending in NEEDS_ORIGIN and origin is None:
        raise ValueError(
            f"{ending}: needs to know where on the Earth the incident was; say its origin"
        )
    match ending:
        case ".csv":
            return csv_of(material, origin)
        case ".geojson" if origin is not None:
            return geojson_of(material, origin)
        case ".kml" if origin is not None:
            return kml_of(material, origin)
        case ".html":
            return report_of(material, file)
        case _:
            raise ValueError(f"{ending!r}: use one of {', '.join(FORMATS)}")
