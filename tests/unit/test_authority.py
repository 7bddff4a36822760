"""The authority names each node once, and its bundles are whole and safe or are refused."""

from __future__ import annotations

import json
import os
import stat
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.x509.oid import ExtendedKeyUsageOID

from command_post.__main__ import app
from command_post.authority import Authority, AuthorityError, opened_authority
from shared.process import ExitCode
from shared.security.bundle import Bundle, BundleError, read_pem_certificate
from shared.security.certificates import CertificateError, Identity, read_certificate

NOW = datetime(2026, 11, 22, 12, tzinfo=UTC)
R1, DAP1 = Identity("responder", "r1"), Identity("dap", "dap1")

posix = pytest.mark.skipif(os.name != "posix", reason="file modes are POSIX's")


@pytest.fixture
def authority(tmp_path: Path) -> Authority:
    return Authority.create(tmp_path / "keys", NOW)


def names_of(certificate: x509.Certificate) -> set[str]:
    names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    return {str(name.value) for name in names}


def test_a_bundle_says_who_its_node_is_and_signs(authority: Authority) -> None:
    (folder,) = authority.issue([R1], (), NOW, 30.0)
    bundle = Bundle(folder)
    assert bundle.identity == R1
    assert bundle.certificate.not_before_ns == 0
    assert bundle.certificate.not_after_ns == (NOW + timedelta(days=30)).timestamp() * 1e9
    bundle.certificate.public_key.verify(bundle.sign(b"said"), b"said")
    assert [Identity(node.role, node.id) for node in bundle.nodes.nodes] == [R1]
    assert read_certificate(bundle.certificate.der, bundle.authority).identity == R1


def test_only_posts_and_daps_may_be_dialled(authority: Authority) -> None:
    issued = authority.issue([DAP1], ["10.0.0.7", "dap.lan"], NOW, 30.0)
    issued += authority.issue([R1], (), NOW, 30.0)
    dap, responder = (read_pem_certificate(folder / "certificate.pem") for folder in issued)
    uses = [
        each.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
        for each in (dap, responder)
    ]
    assert [ExtendedKeyUsageOID.SERVER_AUTH in each for each in uses] == [True, False]
    assert names_of(dap) == {
        "localhost", "127.0.0.1", "::1", "dap1", "dap1.local", "10.0.0.7", "dap.lan",
    }  # fmt: skip
    with pytest.raises(x509.ExtensionNotFound):
        names_of(responder)


@pytest.mark.parametrize("host", ["10.0.0.7:7447", "a b", "-x.lan", "", "x" * 64])
def test_a_host_that_is_none_is_refused(authority: Authority, host: str) -> None:
    with pytest.raises(AuthorityError, match="give a name or an address"):
        authority.issue([DAP1], [host], NOW, 30.0)
    assert not authority.issued


def test_an_id_is_one_of_a_kind_across_roles(authority: Authority) -> None:
    authority.issue([R1], (), NOW, 30.0)
    key = (authority.folder / "r1" / "private.key").read_bytes()
    for again in (R1, Identity("dap", "r1")):
        with pytest.raises(AuthorityError, match="is a responder already"):
            authority.issue([again], (), NOW, 30.0)
    with pytest.raises(AuthorityError, match="is a responder already"):
        authority.issue([Identity("dap", "r1")], (), NOW, 30.0, replace=True)
    assert (authority.folder / "r1" / "private.key").read_bytes() == key


@pytest.mark.parametrize("node_id", ["authority", "r 1", "../r1", ""])
def test_an_id_that_cannot_be_is_refused(authority: Authority, node_id: str) -> None:
    with pytest.raises(ValueError, match="--id"):
        authority.issue([Identity("responder", node_id)], (), NOW, 30.0)


def test_a_key_that_was_never_issued_is_not_overwritten(authority: Authority) -> None:
    (authority.folder / "r1").mkdir()
    (authority.folder / "r1" / "private.key").write_text("somebody's")
    with pytest.raises(AuthorityError, match="move it away"):
        authority.issue([R1], (), NOW, 30.0)
    assert (authority.folder / "r1" / "private.key").read_text() == "somebody's"


def test_a_replaced_key_is_withdrawn_in_every_bundle(authority: Authority) -> None:
    first, other = authority.issue([R1, DAP1], (), NOW, 30.0)
    lost = Bundle(first).certificate.key_hex
    authority.issue([R1], (), NOW, 30.0, replace=True)
    assert Bundle(first).certificate.key_hex != lost
    assert Bundle(other).nodes.withdrawn == (lost,)
    assert [node.id for node in Bundle(other).nodes.nodes] == ["dap1", "r1"]
    assert [(each.id, each.withdrawn) for each in Authority(authority.folder).issued] == [
        ("r1", True), ("dap1", False), ("r1", False),
    ]  # fmt: skip


def test_renewed_nodes_keep_their_keys(authority: Authority) -> None:
    authority.issue([R1, DAP1], (), NOW, 1.0)
    before = [Bundle(authority.folder / name).certificate for name in ("r1", "dap1")]
    later = NOW + timedelta(days=5)
    authority.renew([], later, 10.0)
    after = [Bundle(authority.folder / name).certificate for name in ("r1", "dap1")]
    assert [each.key_hex for each in after] == [each.key_hex for each in before]
    assert after[0].not_after_ns == (NOW + timedelta(days=15)).timestamp() * 1e9
    assert len(authority.valid) == 2
    assert Bundle(authority.folder / "r1").nodes.withdrawn == ()
    with pytest.raises(AuthorityError, match="never issued: r9"):
        authority.renew(["r9"], later, 10.0)


def test_no_certificate_outlives_the_authority(tmp_path: Path) -> None:
    authority = Authority.create(tmp_path / "keys", NOW, days=10)
    (folder,) = authority.issue([R1], (), NOW, 30.0)
    until = Bundle(folder).certificate.not_after_ns
    assert until == (NOW + timedelta(days=10)).timestamp() * 1e9
    with pytest.raises(AuthorityError, match="has expired"):
        authority.renew([], NOW + timedelta(days=10), 1.0)


def test_an_authority_is_never_made_over_another(authority: Authority) -> None:
    with pytest.raises(AuthorityError, match="stays as it is"):
        Authority.create(authority.folder, NOW)
    with (
        pytest.raises(AuthorityError, match="keys init"),
        opened_authority(authority.folder / "none"),
    ):
        pass


def test_another_authoritys_certificate_is_foreign(authority: Authority, tmp_path: Path) -> None:
    stranger = Authority.create(tmp_path / "others", NOW)
    (folder,) = stranger.issue([R1], (), NOW, 30.0)
    ours = read_pem_certificate(authority.folder / "authority" / "certificate.pem")
    theirs = Bundle(folder).certificate.der
    altered = theirs[:-1] + bytes([theirs[-1] ^ 1])
    for der, kind in ((theirs, "foreign"), (altered, "foreign"), (b"x", "unreadable")):
        with pytest.raises(CertificateError) as refused:
            read_certificate(der, ours)
        assert refused.value.kind == kind


@posix
def test_private_keys_are_for_their_owner_alone(authority: Authority) -> None:
    (folder,) = authority.issue([R1], (), NOW, 30.0)
    for key in (folder / "private.key", authority.folder / "authority" / "private.key"):
        assert stat.S_IMODE(key.stat().st_mode) == 0o600
        assert stat.S_IMODE(key.parent.stat().st_mode) == 0o700
    (folder / "private.key").chmod(0o640)
    with pytest.raises(BundleError, match=r"others may read.*chmod 600"):
        Bundle(folder)


def test_a_bundle_that_is_not_whole_is_refused(authority: Authority) -> None:
    first, other = authority.issue([R1, DAP1], (), NOW, 30.0)
    key = (first / "private.key").read_bytes()
    (first / "private.key").write_bytes((other / "private.key").read_bytes())
    with pytest.raises(BundleError, match="not the key of"):
        Bundle(first)
    (first / "private.key").write_bytes(b"nonsense")
    with pytest.raises(BundleError, match="not a private key") as refused:
        Bundle(first)
    assert "nonsense" not in str(refused.value)
    (first / "private.key").write_bytes(key)
    (first / "certificate.pem").write_bytes(b"")
    with pytest.raises(BundleError, match="not a certificate"):
        Bundle(first)
    with pytest.raises(BundleError, match="keys issue"):
        Bundle(first / "nowhere")


def test_the_commands_name_renew_and_list(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = ["--folder", str(tmp_path / "keys")]

    def told(*words: str) -> int:
        return int(app(["keys", *words, *folder], result_action="return_value"))

    assert told("issue", "--role", "dap", "--id", "dap1") == ExitCode.USAGE
    assert told("init") == ExitCode.OK
    assert told("init") == ExitCode.USAGE
    assert told("issue", "--role", "dap", "--id", "dap1", "--id", "dap2") == ExitCode.OK
    assert told("issue", "--role", "responder", "--id", "dap1") == ExitCode.USAGE
    assert told("issue", "--role", "dap", "--id", "dap1", "--replace") == ExitCode.OK
    assert told("renew", "--id", "dap2", "--days", "3") == ExitCode.OK
    assert told("list") == ExitCode.OK
    capsys.readouterr()
    assert told("list", "--json") == ExitCode.OK
    rows = json.loads(capsys.readouterr().out)
    assert [(row["id"], row["state"]) for row in rows] == [
        ("dap1", "withdrawn"), ("dap2", "replaced"), ("dap1", "valid"), ("dap2", "valid"),
    ]  # fmt: skip
