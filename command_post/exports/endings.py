"""Which formats a recording is exported to, by the endings of their files' names."""

from __future__ import annotations

FORMATS: dict[str, str] = {
    ".csv": "text/csv",
    ".geojson": "application/geo+json",
    ".kml": "application/vnd.google-earth.kml+xml",
    ".html": "text/html",
}
"""Media types, by ending."""

NEEDS_ORIGIN = frozenset({".geojson", ".kml"})
