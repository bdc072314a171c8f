from __future__ import annotations

import os

import pytest

from drone_mesh.communication.seals.keys import (
    MeshKey,
    keys_from_text,
    read_key_file,
    write_key_file,
)
from drone_mesh.errors import ConfigurationError
from drone_mesh.raspberry.key_command import main

KEY = MeshKey(bytes(range(16)))


def test_every_node_derives_the_same_keys():
    assert KEY.network.hex() == "b7733346657bbb89f23ca1eb2d4a3911"
    assert KEY.authority_over(3).hex() == "e5f289e9f2fe9886ed0685f6d69f6096"
    assert KEY.pair(3, 200).hex() == "4569c191826ee01e9ec362d7cc1bbf35"


def test_a_node_has_its_own_share_of_the_mesh_key():
    node = KEY.for_node(3)
    assert node.network == KEY.network
    assert node.authority_over(3) == KEY.authority_over(3)
    assert node.pair(3, 7) == node.pair(7, 3) == KEY.pair(7, 3)


def test_a_node_has_no_keys_of_others():
    node = KEY.for_node(3)
    assert node.authority_over(7) is None
    assert node.pair(7, 8) is None


def test_all_keys_of_a_mesh_differ():
    keys = {KEY.network, *(KEY.authority_over(node) for node in range(254))}
    keys |= {KEY.pair(one, other) for one in range(254) for other in range(one + 1)}
    assert len(keys) == 1 + 254 + 254 * 255 // 2


@pytest.mark.parametrize("keys", [KEY, KEY.for_node(7)])
def test_a_key_file_brings_back_what_was_written(tmp_path, keys):
    write_key_file(tmp_path / "key", keys)
    read = read_key_file(tmp_path / "key")
    assert type(read) is type(keys)
    assert read.to_text() == keys.to_text()


def test_a_new_key_file_is_for_its_owner_only(tmp_path):
    write_key_file(tmp_path / "key", KEY)
    assert os.stat(tmp_path / "key").st_mode & 0o777 == 0o600


def test_a_key_file_that_others_can_access_is_refused(tmp_path):
    write_key_file(tmp_path / "key", KEY)
    (tmp_path / "key").chmod(0o640)
    with pytest.raises(ConfigurationError, match="other users can access it"):
        read_key_file(tmp_path / "key")


def test_a_key_is_never_overwritten(tmp_path):
    write_key_file(tmp_path / "key", KEY)
    with pytest.raises(ConfigurationError, match="exists already and is not overwritten"):
        write_key_file(tmp_path / "key", MeshKey(bytes(16)))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "drone_mesh mesh key\n",
        "drone_mesh mesh key\n000102030405060708090a0b0c0d0e\n",
        "drone_mesh mesh key\n000102030405060708090a0b0c0d0e0x\n",
        "drone_mesh keys of node 3\n000102030405060708090a0b0c0d0e0f\n",
        KEY.for_node(3).to_text().replace("node 3", "node 254"),
    ],
)
def test_a_file_without_keys_is_refused_without_quoting_it(text):
    with pytest.raises(
        ConfigurationError, match="not a key file: make one with raspberry_key"
    ) as e:
        keys_from_text(text)
    assert "0001" not in str(e.value)


def test_no_key_appears_in_a_log_line():
    for keys in (KEY, KEY.for_node(3)):
        assert "00010203" not in repr(keys)  # an address of an object may contain less
        assert KEY.network.hex() not in repr(keys)


def test_the_command_makes_a_mesh_key_and_the_keys_of_a_node(tmp_path, capsys):
    mesh, node = tmp_path / "mesh.key", tmp_path / "node3.key"
    assert main(["new", str(mesh)]) == 0
    assert main(["node", str(mesh), "3", str(node)]) == 0
    key = read_key_file(mesh)
    assert read_key_file(node).to_text() == key.for_node(3).to_text()
    said = capsys.readouterr()
    assert not any(line in said.out + said.err for line in key.to_text().split("\n")[1:2])


def test_two_new_keys_differ(tmp_path):
    for name in ("one", "other"):
        assert main(["new", str(tmp_path / name)]) == 0
    assert (tmp_path / "one").read_text() != (tmp_path / "other").read_text()


def test_the_keys_of_a_node_cannot_make_keys_for_others(tmp_path, capsys):
    write_key_file(tmp_path / "node", KEY.for_node(3))
    assert main(["node", str(tmp_path / "node"), "4", str(tmp_path / "other")]) == 1
    assert "not a mesh key" in capsys.readouterr().err


def test_a_mesh_key_that_cannot_be_read_is_named_by_its_argument(tmp_path, capsys):
    assert main(["node", str(tmp_path), "4", str(tmp_path / "other")]) == 1
    assert capsys.readouterr().err == f"raspberry_key: mesh_key {tmp_path}: Is a directory\n"


def test_a_missing_key_file_gives_one_line(tmp_path, capsys):
    with pytest.raises(ConfigurationError) as error:
        read_key_file(tmp_path / "none")
    assert str(error.value) == f"{tmp_path}/none: No such file or directory"
    assert main(["new", str(tmp_path / "none" / "key")]) == 1
    assert capsys.readouterr().err == (
        f"raspberry_key: key file {tmp_path}/none/key: No such file or directory\n"
    )


def test_a_file_of_other_bytes_is_refused(tmp_path):
    path = tmp_path / "key"
    path.write_bytes(b"\xff\xfe")
    path.chmod(0o600)
    with pytest.raises(ConfigurationError, match="not a text file"):
        read_key_file(path)
