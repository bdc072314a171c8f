"""Files with secrets: who may access them, and what else a path can be."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from drone_mesh.errors import ConfigurationError
from drone_mesh.secret_file import read_secret
from drone_mesh.web.listening import Certificate


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "token"
    path.write_text("0123456789abcdef\n")
    path.chmod(0o600)
    return path


def test_the_secret_of_its_owner_is_read_without_the_end_of_the_line(file):
    assert read_secret(file, "token") == "0123456789abcdef"


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o666])
def test_a_file_that_others_can_access_is_refused(file, mode):
    file.chmod(mode)
    with pytest.raises(ConfigurationError, match=f"^{file}: other users can .* chmod 600 {file}$"):
        read_secret(file, "token")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_the_file_of_another_user_is_refused_also_by_root(file):
    os.chown(file, 1234, 1234)
    with pytest.raises(ConfigurationError, match=r"belongs to another user \(id 1234\).* chown 0 "):
        read_secret(file, "token")


def test_a_pipe_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe", 0o600)
    with pytest.raises(ConfigurationError, match="not a regular file"):
        read_secret(tmp_path / "pipe", "token")
    with pytest.raises(ConfigurationError, match="--cert .*pipe: not a regular file"):
        Certificate(tmp_path / "pipe", tmp_path / "pipe")


def test_an_empty_file_has_no_secret(file):
    file.write_text(" \n")
    with pytest.raises(ConfigurationError, match="the file contains no token"):
        read_secret(file, "token")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can own the file")
def test_a_credential_of_systemd_may_be_read_by_an_access_list(file, monkeypatch):
    file.chmod(0o440)
    with pytest.raises(ConfigurationError, match="other users can access it"):
        read_secret(file, "token")
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(file.parent))
    assert read_secret(file, "token") == "0123456789abcdef"
    file.chmod(0o460)
    with pytest.raises(ConfigurationError, match="other users can access it"):
        read_secret(file, "token")
    file.chmod(0o440)
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(file.parent / "credentials"))
    with pytest.raises(ConfigurationError, match="other users can access it"):
        read_secret(file, "token")
