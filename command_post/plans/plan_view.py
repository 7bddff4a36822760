"""The plan that a page draws beneath its map (pure): walls, and images with where they lie.

An image is placed by its world file (six numbers: how metres east and north grow along a row and
down a column, and where the first pixel is), or by two of its points whose places are known. A
plan's north is up as it is drawn, so two points tell all: how large, how turned, and where.
"""

from __future__ import annotations

import re
from typing import NamedTuple, TypeAlias

import msgspec

from command_post.fusion.walls import Wall

Placing: TypeAlias = tuple[float, float, float, float, float, float]
"""East is ``a·column + b·row + c``, north ``d·column + e·row + f``: (a, d, b, e, c, f)."""

PNG = b"\x89PNG\r\n\x1a\n"
_NUMBER = r"[+-]?\d+(?:\.\d*)?"
_POINT = rf"({_NUMBER}),({_NUMBER})=({_NUMBER}),({_NUMBER})"
_SPEC = re.compile(rf"(?P<file>[^;]+?)(?:@(?P<height>{_NUMBER}))?(?P<points>(?:;{_POINT}){{2}})?")


class ImageSpec(NamedTuple):
    """Which image, at what height (m above the origin), and where, unless a world file says so."""

    file: str
    height_m: float
    placing: Placing | None


class PlanImage(msgspec.Struct, frozen=True):
    """An image of one storey; ``number`` is what it is asked for by."""

    number: int
    down_m: float
    placing: Placing


class PlanView(msgspec.Struct, frozen=True):
    """What a page draws of a plan: walls (north, east, north, east) and images."""

    walls_m: tuple[Wall, ...] = ()
    images: tuple[PlanImage, ...] = ()


def parse_spec(text: str) -> ImageSpec:
    """Return what ``FILE[@HEIGHT][;X,Y=NORTH,EAST;X,Y=NORTH,EAST]`` says. Raises ``ValueError``."""
    parts = _SPEC.fullmatch(text)
    if parts is None:
        raise ValueError(
            f"--plan-image {text!r}: write FILE.png, FILE.png@HEIGHT, or with two points "
            "'FILE.png@HEIGHT;X,Y=NORTH,EAST;X,Y=NORTH,EAST'"
        )
    points = [tuple(map(float, each)) for each in re.findall(_POINT, parts["points"] or "")]
    placing = None if not points else _through(*points[0], *points[1])
    return ImageSpec(parts["file"], float(parts["height"] or 0.0), placing)


def parse_world_file(text: str, name: str) -> Placing:
    """Return what a world file says, of metres east and north. Raises ``ValueError``."""
    try:
        a, d, b, e, c, f = map(float, text.split())
    except ValueError:
        raise ValueError(f"{name}: not six numbers, as a world file has") from None
    if abs(a * e - b * d) < 1e-12:
        raise ValueError(f"{name}: the image would have no area")
    # It tells of pixels' middles; pixels are drawn from their corners.
    return (a, d, b, e, c - 0.5 * (a + b), f - 0.5 * (d + e))


def _through(
    x0: float, y0: float, north0_m: float, east0_m: float,
    x1: float, y1: float, north1_m: float, east1_m: float,
) -> Placing:  # fmt: skip
    """Return the placing, turned and scaled and not mirrored, that puts two pixels there."""
    pixels = complex(x1 - x0, y0 - y1)
    if not abs(pixels):
        raise ValueError("--plan-image: give two different points of the image")
    turn = complex(east1_m - east0_m, north1_m - north0_m) / pixels
    if not abs(turn):
        raise ValueError("--plan-image: give two points at different places")
    a, d = turn.real, turn.imag
    b, e = d, -a
    return (a, d, b, e, east0_m - a * x0 - b * y0, north0_m - d * x0 - e * y0)
