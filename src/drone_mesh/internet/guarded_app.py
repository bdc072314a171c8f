"""The common base of all nodes' HTTP servers: guard, token, errors with a reason, and GET /status.

No `from __future__ import annotations` here: FastAPI reads the annotations at run time, also on
Python 3.8.
"""

import functools
import logging
import time
from typing import Any, Callable, Dict, Optional, Union

from fastapi import APIRouter, Depends, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from fastapi_offline import FastAPIOffline
from pydantic import BaseModel, BeforeValidator
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp
from typing_extensions import Annotated

from drone_mesh.arguments import is_decimal, is_whole
from drone_mesh.communication.timing import Throttle
from drone_mesh.errors import GoalRefused, PlaceTaken
from drone_mesh.internet.asking import AnswerLate, NotCarriedOut
from drone_mesh.internet.http_settings import HttpSettings
from drone_mesh.internet.request_guard import RequestGuard
from drone_mesh.web.access import Access, TooManyGuesses
from drone_mesh.web.server_thread import ServerThread


def _digits(is_number: Callable[[str], bool], what: str) -> BeforeValidator:
    def check(value: object) -> object:
        if isinstance(value, str) and not is_number(value):
            raise ValueError(f"must be {what} in decimal digits")
        return value

    return BeforeValidator(check)


WholeDigits = _digits(is_whole, "a whole number")
DecimalDigits = _digits(is_decimal, "a number")


REFUSAL_LOG_PERIOD_S = 10.0
MOST_CONNECTIONS = 64  # further ones get 503

_log = logging.getLogger(__name__)

Responses = Dict[Union[int, str], Dict[str, Any]]


class Refusal(BaseModel):
    """The reason for a refusal."""

    detail: str


REFUSALS: Responses = {
    400: {"model": Refusal, "description": "Invalid Content-Length"},
    401: {"model": Refusal, "description": "Token missing or invalid"},
    403: {"model": Refusal, "description": "Sent by a page of another site"},
    411: {"model": Refusal, "description": "A body of unknown length"},
    413: {"model": Refusal, "description": "Body too large; no request needs one"},
    414: {"model": Refusal, "description": "Address too long"},
    429: {"model": Refusal, "description": "Too many orders, or wrong tokens; wait 1 s"},
    431: {"model": Refusal, "description": "Headers too large"},
}
"""Possible refusals of any request."""

UNDONE: Responses = {
    503: {"model": Refusal, "description": "Not done; nothing was sent"},
    504: {"model": Refusal, "description": "Started, but not finished in time"},
}
"""Possible refusals of any request to the gateway's own thread."""


class HttpServer(ServerThread):
    """Serves the application of one node, in its own thread."""

    def __init__(self, app: ASGIApp, http: HttpSettings) -> None:
        """Open the port. Raises ConfigurationError if it is not available."""
        super().__init__(
            app,
            http.address,
            http.port,
            name="http",
            certificate=http.certificate,
            ws="none",
            limit_concurrency=MOST_CONNECTIONS,
        )


def guarded_app(title: str, description: str, access: Access, router: APIRouter) -> FastAPI:
    """The application; each operation of the router needs the token.

    Its page /docs loads nothing from the internet.
    """
    app = FastAPIOffline(
        title=title,
        description=description,
        version="1",
        redoc_url=None,
        # Each operation has exactly one URL.
        redirect_slashes=False,
    )
    app.add_middleware(RequestGuard, access=access)
    _answer_errors_with_a_reason(app)
    bearer = HTTPBearer(auto_error=False, description="Not needed if started without a token.")

    refusals = Throttle(REFUSAL_LOG_PERIOD_S)

    async def check_token(
        request: Request,
        credentials: Annotated[Optional[HTTPAuthorizationCredentials], Depends(bearer)],
    ) -> None:
        token = credentials.credentials if credentials is not None else ""
        address = request.client.host if request.client else "unknown client"
        status, headers = 401, {"WWW-Authenticate": "Bearer"}
        try:
            if access.is_right(token, address):
                return
            reason = "invalid token" if token else "token missing: send Authorization: Bearer"
        except TooManyGuesses as error:
            status, headers, reason = 429, {"Retry-After": "1"}, str(error)
        if refusals.count("refused", time.monotonic()):
            number = refusals.counts["refused"]
            _log.warning("HTTP: refused %s: %s (refusal %d)", address, reason, number)
        raise HTTPException(status, reason, headers=headers)

    app.include_router(router, dependencies=[Depends(check_token)], responses=REFUSALS)
    return app


def _answer_errors_with_a_reason(app: FastAPI) -> None:
    async def refuse(status: int, _request: Request, error: Exception) -> JSONResponse:
        return JSONResponse({"detail": str(error)}, status)

    statuses = ((GoalRefused, 422), (PlaceTaken, 409), (NotCarriedOut, 503), (AnswerLate, 504))
    for kind, status in statuses:
        app.add_exception_handler(kind, functools.partial(refuse, status))

    @app.exception_handler(RequestValidationError)
    async def bad_request(_request: Request, error: RequestValidationError) -> JSONResponse:
        detail = "; ".join(f"{e['loc'][-1]}: {e['msg']}" for e in error.errors())
        return JSONResponse({"detail": detail}, 422)


ReadStatus = Callable[[], Dict[str, Any]]
"""Returns a node's status; any thread may call it."""


def status_request(status: ReadStatus) -> APIRouter:
    """`GET /status`."""
    router = APIRouter()

    @router.get("/status")
    async def node_status() -> Dict[str, Any]:
        """The status of this node: mesh, radio, flight, version."""
        return status()

    return router


class StatusServer(HttpServer):
    """The HTTP side of a router: `GET /status`."""

    def __init__(self, status: ReadStatus, http: HttpSettings) -> None:
        """Open the port. Raises ConfigurationError as HttpInternet does."""
        about = "Reports the status of this node."
        request = status_request(status)
        super().__init__(guarded_app("drone_mesh router", about, http.access(), request), http)
