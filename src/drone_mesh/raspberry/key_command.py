"""The program raspberry_key: creates the key files of a mesh (docs/security.md, "Keys")."""

from __future__ import annotations

import argparse
import secrets
from pathlib import Path
from typing import Sequence

from drone_mesh.arguments import whole
from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.communication.seals.keys import KEY_BYTES, MeshKey, read_key_file, write_key_file
from drone_mesh.errors import ConfigurationError, naming_argument
from drone_mesh.stopping import ends_as


@ends_as("raspberry_key")
def main(arguments: Sequence[str] | None = None) -> int:
    """Create a key file; the exit status is 1 if that is not possible."""
    parser = argparse.ArgumentParser(
        "raspberry_key",
        description="Makes the key files of a mesh. A key is never printed.",
        epilog="Start each node with --key-file FILE. Copy key files over an encrypted connection "
        "only, such as scp.",
    )
    commands = parser.add_subparsers(dest="command", required=True)
    about = "make a new mesh key, for gateways and for routers that cannot be captured"
    new = commands.add_parser("new", help=about, description=about)
    new.add_argument("file", type=Path, help="file to make; it must not exist")
    about = "make the keys of one router, which do not allow it to give orders to others"
    node = commands.add_parser("node", help=about, description=about)
    node.add_argument("mesh_key", type=Path, help="file with the mesh key")
    node.add_argument(
        "id", type=whole(0, MAX_NODE_ID), help=f"node id of the router, 0..{MAX_NODE_ID}"
    )
    node.add_argument("file", type=Path, help="file to make; it must not exist")
    parsed = parser.parse_args(arguments)
    if parsed.command == "new":
        write_key_file(parsed.file, MeshKey(secrets.token_bytes(KEY_BYTES)))
        print(f"raspberry_key: new mesh key in {parsed.file}")
    else:
        with naming_argument("mesh_key ", parsed.mesh_key):
            keys = read_key_file(parsed.mesh_key)
            if not isinstance(keys, MeshKey):
                raise ConfigurationError(
                    f"{parsed.mesh_key}: not a mesh key but the keys of node {keys.node}; "
                    "use the file that 'raspberry_key new' made"
                )
        write_key_file(parsed.file, keys.for_node(parsed.id))
        print(f"raspberry_key: keys of node {parsed.id} in {parsed.file}")
    return 0
