"""The certificate of an HTTPS server."""

from __future__ import annotations

import ssl
import stat
from dataclasses import dataclass
from pathlib import Path

from drone_mesh.errors import ConfigurationError


@dataclass(frozen=True)
class Certificate:
    """PEM files: the certificate with its chain, and its private key."""

    cert: Path
    key: Path

    def __post_init__(self) -> None:
        """Raise ConfigurationError unless both files can be read and match."""
        for option, path in (("--cert", self.cert), ("--key", self.key)):
            try:
                if not stat.S_ISREG(path.stat().st_mode):  # a pipe would block whoever opens it
                    raise ConfigurationError(f"{option} {path}: not a regular file")
                path.open("rb").close()
            except OSError as error:
                raise ConfigurationError(f"{option} {path}: {error.strerror}") from error
        try:
            ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(self.cert, self.key)
        except (OSError, ssl.SSLError) as error:
            raise ConfigurationError(
                f"--cert {self.cert} and --key {self.key} cannot be used: expected a certificate "
                f"and its private key, in PEM ({error})"
            ) from error
