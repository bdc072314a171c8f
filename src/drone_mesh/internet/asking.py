"""Asking the thread that owns a gateway, from the event loop of the HTTP server."""

from __future__ import annotations

import asyncio
import contextlib
from concurrent.futures import Future
from typing import Any, Callable, TypeVar

from drone_mesh.communication.interfaces import IGatewayCommands
from drone_mesh.errors import MeshError

Submit = Callable[[Callable[[float], None]], None]
"""Runs a function, with the time, on the thread that owns the gateway. Any thread may call it."""

Answer = TypeVar("Answer")


class NotCarriedOut(MeshError):
    """The gateway did not come to it in time, and will not do it any more. Ask again later."""


class AnswerLate(MeshError):
    """The gateway has begun with it and is not done: nobody knows how it ends."""


class GatewayDesk:
    """Where questions wait for the gateway, and their askers for its answers.

    `open` and `close` may be called by any thread. All else belongs to the server's event loop,
    except the questions themselves: those run where `submit` brings them.
    """

    def __init__(self, submit: Submit, answer_within_s: float) -> None:
        self._submit = submit
        self._answer_within_s = answer_within_s
        self._gateway: IGatewayCommands | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._waiting: set[Future[Any]] = set()

    def open(self, gateway: IGatewayCommands) -> None:
        """Take questions for this gateway."""
        self._gateway = gateway

    def close(self) -> None:
        """Take no more questions, and give up those that the gateway has not come to."""
        self._gateway = None
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # the loop has ended, and all waiting with it
                self._loop.call_soon_threadsafe(self._give_up)

    async def ask(self, question: Callable[[IGatewayCommands, float], Answer]) -> Answer:
        """Have `question(gateway, now_s)` answered by the gateway's thread.

        Raises NotCarriedOut, AnswerLate, and whatever the question raises.
        """
        gateway = self._gateway
        if gateway is None:
            raise NotCarriedOut("the gateway is not running")
        self._loop = asyncio.get_running_loop()
        future: Future[Answer] = Future()

        def answer(now_s: float) -> None:
            if not future.set_running_or_notify_cancel():
                return  # nobody waits for it any more
            try:
                future.set_result(question(gateway, now_s))
            except Exception as error:  # it is the asker's to handle
                future.set_exception(error)

        self._waiting.add(future)
        arrival = asyncio.wrap_future(future)
        try:
            self._submit(answer)
            await asyncio.wait({arrival}, timeout=self._answer_within_s)
            if future.cancel():
                raise NotCarriedOut("the gateway is busy or stopping: nothing was done")
            if not future.done():
                raise AnswerLate("the gateway has begun with this and is not done yet")
            return future.result()
        finally:
            self._waiting.discard(future)
            arrival.cancel()

    def _give_up(self) -> None:
        for future in self._waiting:
            future.cancel()
