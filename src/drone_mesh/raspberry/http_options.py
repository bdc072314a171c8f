"""The HTTP options of a node."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Mapping

from drone_mesh.arguments import whole
from drone_mesh.errors import ConfigurationError, naming_argument
from drone_mesh.internet import DEFAULT_PORT
from drone_mesh.internet.http_settings import HttpSettings
from drone_mesh.secret_file import read_secret
from drone_mesh.web import LOOPBACK
from drone_mesh.web.access import access_for
from drone_mesh.web.listening import MAX_PORT
from drone_mesh.web.tls import Certificate

TOKEN_VARIABLE = "DRONE_MESH_TOKEN"


def add_http_options(http: argparse._ArgumentGroup) -> None:
    """Add the group to a parser."""
    http.add_argument(
        "--bind",
        metavar="ADDRESS",
        default=LOOPBACK,
        help="address to listen on; an address that other machines can reach needs a token "
        "(default: %(default)s)",
    )
    http.add_argument(
        "--port",
        type=whole(1, MAX_PORT),
        default=DEFAULT_PORT,
        help="TCP port (default: %(default)s)",
    )
    http.add_argument(
        "--token-file",
        metavar="FILE",
        type=Path,
        help="file with the token that requests must carry, at least 16 characters; without this "
        f"option the environment variable {TOKEN_VARIABLE} is used",
    )
    http.add_argument(
        "--name",
        action="append",
        default=[],
        help="another name by which clients address this machine; may be given several times",
    )
    http.add_argument("--cert", metavar="FILE", type=Path, help="certificate (PEM), for HTTPS")
    http.add_argument(
        "--key", metavar="FILE", type=Path, help="private key of the certificate (PEM)"
    )


def http_options(parsed: argparse.Namespace, environment: Mapping[str, str]) -> HttpSettings:
    """The parsed options. Raises ConfigurationError."""
    token = environment.get(TOKEN_VARIABLE, "")
    if parsed.token_file is not None:
        with naming_argument("--token-file ", parsed.token_file):
            token = read_secret(parsed.token_file, "token")
    try:
        access_for(parsed.bind, token)
    except ConfigurationError as error:
        raise ConfigurationError(f"{error} (--token-file, or {TOKEN_VARIABLE})") from error
    if (parsed.cert is None) != (parsed.key is None):
        raise ConfigurationError("--cert and --key are needed together")
    certificate = None if parsed.cert is None else Certificate(parsed.cert, parsed.key)
    return HttpSettings(parsed.bind, parsed.port, token, tuple(parsed.name), certificate)
