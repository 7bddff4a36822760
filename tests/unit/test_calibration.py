"""Readings brought to scale by the radio's make, and by the installer beside the box."""

from __future__ import annotations

import pytest

from dap_node.calibration import Calibration, CalibrationSettings, Scale, calibrate
from dap_node.settings import DapSettings
from shared.config import ConfigError, parse_toml
from shared.units import NS_PER_S

SETTINGS = CalibrationSettings()
SET_DOWN_NS = 100 * NS_PER_S


def beside(*values_dbm: float, from_s: float = -2.0) -> dict[int, float]:
    """Return readings five times a second from ``from_s`` after the installation on."""
    return {
        SET_DOWN_NS + round((from_s + 0.2 * number) * NS_PER_S): value_dbm
        for number, value_dbm in enumerate(values_dbm)
    }


def learnt(readings: dict[int, float], settings: CalibrationSettings = SETTINGS) -> Calibration:
    calibration = calibrate(readings, SET_DOWN_NS, settings)
    assert calibration is not None
    return calibration


def test_what_the_installer_lacks_is_added_in_part() -> None:
    told = learnt(beside(*[SETTINGS.beside_dbm - 6.0] * 10))
    assert 0.0 < told.others_db < told.installer_db < 6.0
    assert told.installer_sd_db < (SETTINGS.box_sd_db**2 + SETTINGS.radio_sd_db**2) ** 0.5
    assert told.sample_count == 10
    sure = CalibrationSettings(beside_sd_db=0.01)
    assert learnt(beside(*[-49.0, -49.0] * 200, from_s=-2.0), sure).installer_db > 5.9


def test_a_body_in_between_now_and_then_changes_little() -> None:
    clear = learnt(beside(*[-45.0] * 15))
    blocked = learnt(beside(*[-45.0, -45.0, -60.0] * 5))
    assert blocked.installer_db == pytest.approx(clear.installer_db)
    assert blocked.installer_sd_db >= clear.installer_sd_db


@pytest.mark.parametrize(
    "readings",
    [
        beside(-45.0, -45.0, -45.0),
        beside(*[-45.0] * 9, from_s=5.0),
        beside(*[-45.0] * 9, from_s=-9.0),
    ],
)
def test_too_few_readings_or_none_of_that_moment_say_nothing(readings: dict[int, float]) -> None:
    assert calibrate(readings, SET_DOWN_NS, SETTINGS) is None


def test_a_dap_learns_by_its_installer_and_anew_by_the_next() -> None:
    scale = Scale(1.0, {"r2": 3.0}, SETTINGS)
    for time_ns, dbm in beside(*[-51.0] * 15).items():
        assert scale.calibrated_dbm(time_ns, "r1", dbm) == -50.0
    scale.set_down(SET_DOWN_NS, "r1")
    assert scale.tick(SET_DOWN_NS + NS_PER_S) is None
    told = scale.tick(SET_DOWN_NS + 2 * NS_PER_S)
    assert told is not None
    assert told.installer_db > 1.0
    later_ns = SET_DOWN_NS + 3 * NS_PER_S
    assert scale.tick(later_ns) is None
    assert scale.calibrated_dbm(later_ns, "r1", -60.0) == -59.0 + told.installer_db
    assert scale.calibrated_dbm(later_ns, "r2", -60.0) == -57.0 + told.others_db
    scale.set_down(later_ns, None)
    assert scale.calibrated_dbm(later_ns, "r1", -60.0) == -59.0


def test_nothing_is_learnt_unless_it_is_asked_for() -> None:
    scale = DapSettings().scale()
    for time_ns, dbm in beside(*[-60.0] * 15).items():
        assert scale.calibrated_dbm(time_ns, "r1", dbm) == dbm
    scale.set_down(SET_DOWN_NS, "r1")
    assert scale.tick(SET_DOWN_NS + 5 * NS_PER_S) is None


def test_models_have_offsets_of_their_own() -> None:
    toml = 'offset_db = 2.0\n[model_offset_db]\nold = -3.5\n[model_of]\nr1 = "old"\n[calibration]\n'
    settings = parse_toml(toml, DapSettings, "dap.toml")
    assert settings.calibration == SETTINGS
    scale = settings.scale()
    assert scale.calibrated_dbm(0, "r1", -60.0) == -61.5
    assert scale.calibrated_dbm(0, "r2", -60.0) == -58.0
    with pytest.raises(ConfigError, match="no model_offset_db for new; give one"):
        parse_toml('[model_of]\nr1 = "new"\n', DapSettings, "dap.toml")
