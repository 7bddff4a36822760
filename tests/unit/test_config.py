"""Settings files: what is read, and what each mistake is told."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import pytest

from shared.config import ConfigError, checked, load_toml


class Noise(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="noise"):
    """One of two kinds of channel."""

    sigma_db: Annotated[float, msgspec.Meta(gt=0)]


class Silence(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="silence"):
    """The other."""

    floor_dbm: float = -95.0


class Wall(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Something repeated."""

    start_m: tuple[float, float]
    loss_db: float = 5.0


class Span(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Two values and a rule between them."""

    first_s: float
    last_s: float

    def __post_init__(self) -> None:
        if self.last_s < self.first_s:
            raise ValueError("last_s is before first_s")


class Site(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Everything a settings file may nest."""

    name: str
    walls: tuple[Wall, ...] = ()
    channel: Noise | Silence = Silence()
    daps: dict[str, Wall] = {}
    span: Span | None = None


@pytest.fixture
def site_toml(tmp_path: Path) -> Path:
    return tmp_path / "site.toml"


def test_reads_every_nesting(site_toml: Path) -> None:
    site_toml.write_text(
        """
        name = "Müller's"
        channel = { type = "noise", sigma_db = 3 }
        walls = [{ start_m = [0, 1.5] }, { start_m = [2, 2], loss_db = 12 }]
        [daps.door]
        start_m = [1, 1]
        [span]
        first_s = 0
        last_s = 9
        """,
        encoding="utf-8",
    )
    assert load_toml(site_toml, Site) == Site(
        name="Müller's",
        walls=(Wall((0.0, 1.5)), Wall((2.0, 2.0), 12.0)),
        channel=Noise(3.0),
        daps={"door": Wall((1.0, 1.0))},
        span=Span(0.0, 9.0),
    )


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("name = 3", ["name: Expected `str`, got `int`"]),
        ("", ["name: missing; add it"]),
        ("name = 'x'\nnaem = 1", ["naem: unknown key", "did you mean 'name'?"]),
        ("nmae = 'x'", ["nmae: unknown key", "did you mean 'name'?"]),
        ("name = 'x'\nqqqq = 1", ["qqqq: unknown key", "use name, walls, channel, daps, span"]),
        (
            "name = 'x'\nwalls = [{start_m=[0,0]}, {start_m=[0,0], los_db=1}]",
            ["walls[1].los_db: unknown key", "'loss_db'"],
        ),
        ("name = 'x'\ndaps.door = {start=[0,0]}", ["daps.door.start: unknown", "'start_m'"]),
        ("name = 'x'\ndaps.door = {start_m=[0,'a']}", ["daps.door.start_m[1]: Expected `float`"]),
        ("name = 'x'\nchannel = {type='noise', sigm_db=1}", ["channel.sigm_db", "'sigma_db'"]),
        ("name = 'x'\nchannel = {type='noise'}", ["channel.sigma_db: missing"]),
        ("name = 'x'\nchannel = {type='noice'}", ["channel.type: Invalid value 'noice'"]),
        ("name = 'x'\nchannel = {sigma_db=1}", ["channel.type: missing"]),
        ("name = 'x'\nchannel = {type='noise', sigma_db=0}", ["channel.sigma_db", "> 0"]),
        ("name = 'x'\nchannel = {type='noise', sigma_db=nan}", ["channel.sigma_db", "finite"]),
        ("name = 'x'\nwalls = [{start_m=[0, -inf]}]", ["walls[0].start_m[1]", "finite"]),
        ("name = 'x'\nspan = {first_s=2, last_s=1}", ["span: last_s is before first_s"]),
        ("name = 'x'\nspan = {first=2, last_s=1}", ["span.first: unknown", "'first_s'"]),
        ("name = 'x'\nwalls = 3", ["walls: Expected `array`, got `int`"]),
        ("name = 'x'\n\nwalls = [", ["not valid TOML", "line 3, the end"]),
        ("name = 'x'\nname = 'y'", ["not valid TOML", "line 2"]),
    ],
)
def test_a_mistake_is_told_with_file_and_key(site_toml: Path, text: str, told: list[str]) -> None:
    site_toml.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_toml(site_toml, Site)
    assert str(caught.value).startswith(f"{site_toml}: ")
    for words in told:
        assert words in str(caught.value)


def test_an_unreadable_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such file"):
        load_toml(tmp_path / "absent.toml", Site)
    with pytest.raises(ConfigError, match="cannot be read"):
        load_toml(tmp_path, Site)
    latin = tmp_path / "latin.toml"
    latin.write_bytes("name = 'Müller'".encode("latin-1"))
    with pytest.raises(ConfigError, match="UTF-8"):
        load_toml(latin, Site)


def test_unknown_keys_are_refused_even_where_a_struct_would_pass_them_over(
    site_toml: Path,
) -> None:
    class Lenient(msgspec.Struct, frozen=True):
        rate_hz: float = 100.0

    site_toml.write_text("rate = 50", encoding="utf-8")
    with pytest.raises(ConfigError, match="did you mean 'rate_hz'"):
        load_toml(site_toml, Lenient)


def test_settings_made_in_code_can_be_checked_as_well() -> None:
    assert checked(Noise(sigma_db=2.0)) == Noise(sigma_db=2.0)
    with pytest.raises(ConfigError, match=r"^sigma_db: Expected `float` > 0.0; correct it$"):
        checked(Noise(sigma_db=-1.0))
