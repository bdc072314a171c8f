"""Requests JSON from an HTTP server; each failure is described in one line."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from typing import Any

from drone_mesh.errors import MeshError


class NoAnswer(MeshError):
    """The server does not answer, refuses, or sends no JSON; the text gives details."""


def ask_json(
    url: str, within_s: float, token: str = "", method: str = "GET", body: bytes | None = None
) -> Any:
    """The decoded answer to one request. `body` is JSON. Raises NoAnswer.

    For a refusal the text is the server's own reason (the field `detail`), if it gives one.
    """
    request = urllib.request.Request(url, body, method=method)
    if body is not None:
        request.add_header("Content-Type", "application/json")
    if token:
        request.add_header("Authorization", f"Bearer {token}")
    try:
        with urllib.request.urlopen(request, timeout=within_s) as answer:
            return json.load(answer)
    except urllib.error.HTTPError as error:
        raise NoAnswer(_reason(error)) from error
    except (OSError, ValueError) as error:
        # The text of a URLError wraps its reason in "<urlopen error ...>".
        raise NoAnswer(f"no answer from {url}: {getattr(error, 'reason', error)}") from error


def _reason(error: urllib.error.HTTPError) -> str:
    try:
        with error:
            return str(json.load(error)["detail"])
    except (ValueError, KeyError, TypeError):
        return str(error)
