"""Requests JSON from an HTTP server; each failure is described in one line."""

from __future__ import annotations

import http.client
import json
import urllib.error
import urllib.request
from typing import Any

from drone_mesh.errors import MeshError


class NoAnswer(MeshError):
    """The server does not answer, refuses, or sends no JSON; the text gives details."""


# An answer that ends too early, or that is not HTTP, is an HTTPException.
_FAILURES = (OSError, ValueError, http.client.HTTPException)


def ask_json(
    url: str, within_s: float, token: str = "", method: str = "GET", body: bytes | None = None
) -> Any:
    """The decoded answer to one request. `body` is JSON. Raises NoAnswer.

    For a refusal the text is the server's own reason (the field `detail`), if it gives one.
    """
    try:
        request = urllib.request.Request(url, body, method=method)
        if body is not None:
            request.add_header("Content-Type", "application/json")
        if token:
            request.add_header("Authorization", f"Bearer {token}")
        with urllib.request.urlopen(request, timeout=within_s) as answer:
            return json.load(answer)
    except urllib.error.HTTPError as error:
        raise NoAnswer(_reason(error, url)) from error
    except json.JSONDecodeError as error:
        raise NoAnswer(f"the answer from {url} is not JSON: {error}") from error
    except _FAILURES as error:
        cause = getattr(
            error, "reason", error
        )  # of a URLError, whose text is "<urlopen error ...>"
        reason = " ".join(str(getattr(cause, "strerror", None) or cause).split())
        raise NoAnswer(f"no answer from {url}: {reason}") from error


def _reason(error: urllib.error.HTTPError, url: str) -> str:
    try:
        with error:
            return str(json.load(error)["detail"])
    except (*_FAILURES, KeyError, TypeError):
        return f"{url}: {error}"
