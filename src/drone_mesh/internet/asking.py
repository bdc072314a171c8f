"""Passes requests from the HTTP server's event loop to the thread that owns a gateway."""

from __future__ import annotations

import asyncio
import contextlib
from concurrent.futures import Future
from typing import Any, Callable, TypeVar

from drone_mesh.communication.interfaces import IGatewayCommands
from drone_mesh.errors import MeshError
from drone_mesh.execution import Submit

Answer = TypeVar("Answer")


class NotCarriedOut(MeshError):
    """The gateway did not start the request in time and has dropped it. Try again later."""


class AnswerLate(MeshError):
    """The gateway started the request but did not finish in time; the outcome is unknown."""


class GatewayDesk:
    """Queues requests to the gateway and waits for its answers.

    Any thread may call `open` and `close`. Everything else belongs to the server's event loop,
    except the requests themselves, which run on the thread behind `submit`.
    """

    def __init__(self, submit: Submit, answer_within_s: float) -> None:
        self._submit = submit
        self._answer_within_s = answer_within_s
        self._gateway: IGatewayCommands | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._waiting: set[Future[Any]] = set()

    def open(self, gateway: IGatewayCommands) -> None:
        """Accept requests for this gateway."""
        self._gateway = gateway

    def close(self) -> None:
        """Refuse further requests and cancel those that the gateway has not started."""
        self._gateway = None
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # the loop has ended together with its requests
                self._loop.call_soon_threadsafe(self._give_up)

    async def ask(self, question: Callable[[IGatewayCommands, float], Answer]) -> Answer:
        """Run `question(gateway, now_s)` on the gateway's thread and return its result.

        Raises NotCarriedOut, AnswerLate, and whatever `question` raises.
        """
        gateway = self._gateway
        if gateway is None:
            raise NotCarriedOut("the gateway is not running")
        self._loop = asyncio.get_running_loop()
        future: Future[Answer] = Future()

        def answer(now_s: float) -> None:
            if not future.set_running_or_notify_cancel():
                return  # the request was cancelled
            try:
                future.set_result(question(gateway, now_s))
            except Exception as error:  # the caller of `ask` handles it
                future.set_exception(error)

        self._waiting.add(future)
        arrival = asyncio.wrap_future(future)
        try:
            self._submit(answer)
            await asyncio.wait({arrival}, timeout=self._answer_within_s)
            if future.cancel():
                raise NotCarriedOut("the gateway is busy or stopping; nothing was sent")
            if not future.done():
                raise AnswerLate("the gateway has started this request but not finished it yet")
            return future.result()
        finally:
            self._waiting.discard(future)
            arrival.cancel()

    def _give_up(self) -> None:
        for future in self._waiting:
            future.cancel()
