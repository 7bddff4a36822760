"""Images of a building's storeys, read as the post starts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from command_post.fusion.walls import Wall
from command_post.plans.plan_file import load_walls
from command_post.plans.plan_view import (
    PNG,
    ImageSpec,
    Placing,
    PlanImage,
    PlanView,
    parse_spec,
    parse_world_file,
)
from shared.config import ConfigError

MOST_BYTES = 32 << 20
WORLD_FILES = (".pgw", ".pngw", ".wld")


class Plan(NamedTuple):
    """What a page draws of a plan, and its images by their number (PNG)."""

    view: PlanView = PlanView()
    images: tuple[bytes, ...] = ()


def load_plan(walls: Path | None, images: Sequence[str]) -> Plan:
    """Return walls and images. Raises ``ValueError`` for an image that cannot be used.

    Walls that cannot be used are none: whoever starts a post is told why elsewhere.
    """
    specs = [parse_spec(each) for each in images]
    placed = tuple(
        PlanImage(number, -spec.height_m, spec.placing or _world_file(Path(spec.file)))
        for number, spec in enumerate(specs)
    )
    return Plan(PlanView(_walls(walls), placed), tuple(_content(spec) for spec in specs))


def _walls(path: Path | None) -> tuple[Wall, ...]:
    try:
        return () if path is None else load_walls(path)
    except ConfigError:
        return ()


def _content(spec: ImageSpec) -> bytes:
    path = Path(spec.file)
    try:
        if path.stat().st_size > MOST_BYTES:
            raise ValueError(f"{path}: larger than {MOST_BYTES >> 20} MiB; give a smaller image")
        content = path.read_bytes()
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror}); give another") from None
    if not content.startswith(PNG):
        raise ValueError(f"{path}: not a PNG; save it as one")
    return content


def _world_file(image: Path) -> Placing:
    for ending in WORLD_FILES:
        path = image.with_suffix(ending)
        if path.is_file():
            return parse_world_file(path.read_text(encoding="utf-8", errors="replace"), str(path))
    raise ValueError(
        f"{image}: nothing says where it lies; give {image.with_suffix('.pgw').name} beside it, "
        "or two points in --plan-image"
    )
