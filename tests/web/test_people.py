"""Who may come in: those of the file with their password, for so long, and not by trying."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

from command_post.__main__ import app
from command_post.web.people import SESSION_S, TRIES, Door, Person, hashed, load_people
from shared.config import ConfigError
from shared.process import ExitCode


def door() -> Door:
    return Door({"kim": Person(role="operator", password=hashed("open sesame", bytes(16)))}, 0.0)


def test_the_right_password_opens() -> None:
    entered = door().sign_in("kim", "open sesame", 1.0)
    assert entered is not None
    secret, session = entered
    assert (session.name, session.role) == ("kim", "operator")
    assert session.token not in secret
    assert session.may("viewer")
    assert session.may("operator")
    assert not session.may("commander")


@pytest.mark.parametrize(
    ("name", "password"), [("kim", "sesame"), ("lee", "open sesame"), ("", "")]
)
def test_nothing_else_does(name: str, password: str) -> None:
    assert door().sign_in(name, password, 1.0) is None


def test_a_session_ends() -> None:
    opened = door()
    entered = opened.sign_in("kim", "open sesame", 1.0)
    assert entered is not None
    secret, session = entered
    assert opened.session(secret, 2.0) == session
    assert opened.session(secret, 1.0 + SESSION_S) is None
    assert opened.session("made up", 2.0) is None
    assert opened.session(None, 2.0) is None
    opened.sign_out(secret)
    assert opened.session(secret, 2.0) is None


def test_passwords_are_not_tried_by_the_thousand() -> None:
    opened = door()
    for _ in range(round(TRIES)):
        assert opened.sign_in("kim", "wrong", 1.0) is None
    assert opened.sign_in("kim", "open sesame", 1.0) is None
    assert opened.sign_in("kim", "open sesame", 60.0) is not None


def test_the_file_says_who_may(tmp_path: Path) -> None:
    path = tmp_path / "people.toml"
    password = hashed("x", bytes(16))
    path.write_text(f'[people.kim]\nrole = "commander"\npassword = "{password}"\n')
    assert load_people(path).people["kim"].role == "commander"
    path.write_text('[people.kim]\nrole = "commander"\npassword = "plain"\n')
    with pytest.raises(ConfigError, match="password"):
        load_people(path)


def test_people_are_added_listed_and_removed_by_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "people.toml"

    def people(*arguments: str, typed: str = "") -> int:
        monkeypatch.setattr("sys.stdin", io.StringIO(f"{typed}\n"))
        command = ["people", *arguments, "--file", str(file)]
        code = app(command, exit_on_error=False, result_action="return_value")
        assert isinstance(code, int)
        return code

    assert people("add", "kim", "--role", "viewer", typed="short") == ExitCode.USAGE
    assert not file.exists()
    assert people("add", "kim", "--role", "viewer", typed="open sesame") == ExitCode.OK
    assert people("add", "../x", "--role", "viewer", typed="open sesame") == ExitCode.USAGE
    assert people("add", "lee", "--role", "commander", typed="hush hush") == ExitCode.OK
    assert file.stat().st_mode & 0o777 == 0o600
    assert "sesame" not in file.read_text()
    assert Door(load_people(file).people, 0.0).sign_in("kim", "open sesame", 0.0) is not None
    assert people("remove", "kim") == ExitCode.OK
    assert people("remove", "kim") == ExitCode.USAGE
    capsys.readouterr()
    assert people("list") == ExitCode.OK
    assert capsys.readouterr().out == "lee: commander\n"
