"""Users' messages over HTTP: `POST /nodes/{id}/data` and `GET /data`.

No `from __future__ import annotations` here: FastAPI reads the annotations at run time, also on
Python 3.8.
"""

import asyncio
import json
import time
from typing import AsyncIterator, Optional

from fastapi import APIRouter, Path, Query, Request, Response
from fastapi.responses import StreamingResponse
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from typing_extensions import Annotated

from drone_mesh.communication.data.outgoing import TO_ALL, TicketState
from drone_mesh.communication.data.packets import MAX_DATA_PORT
from drone_mesh.communication.data.transport import ReceivedMessage
from drone_mesh.errors import MessageRefused, QueueFull
from drone_mesh.internet.guarded_app import UNDONE, DecimalDigits, Refusal, WholeDigits
from drone_mesh.users.desk import HANDOVER_S, Sending, UsersDesk, in_json

LONGEST_WAIT_S = 60.0
SIGN_OF_LIFE_S = 15.0  # a comment line for a client without messages
MOST_UNREAD = 256  # messages waiting for a slow client; with more, its connection ends
_POLL_S = 0.02

Destination = Annotated[
    int,
    Path(ge=0, le=TO_ALL, description=f"Node id; {TO_ALL}: all nodes, best effort."),
    WholeDigits,
]
Port = Annotated[int, Query(ge=0, le=MAX_DATA_PORT), WholeDigits]


class DataSent(BaseModel):
    """A message accepted by the gateway's node."""

    ticket: int = Field(description="Sequence number of the message at the gateway's node.")
    state: TicketState


def data_requests(users: UsersDesk) -> APIRouter:
    """Both requests; `users` is the desk of the gateway's own node."""
    invalid = {"model": Refusal, "description": "Invalid node, port or message"}
    router = APIRouter(responses={**UNDONE, 422: invalid})

    @router.post(
        "/nodes/{id}/data",
        openapi_extra={
            "requestBody": {
                "content": {
                    "application/octet-stream": {"schema": {"type": "string", "format": "binary"}}
                }
            }
        },
    )
    async def send_data(
        id: Destination,
        request: Request,
        port: Port = 0,
        reliable: bool = True,
        wait: Annotated[
            float,
            Query(ge=0, le=LONGEST_WAIT_S, description="Seconds to wait for the delivery."),
            DecimalDigits,
        ] = 0.0,
    ) -> DataSent:
        """Send the body, up to 1024 bytes, to a node. 504: it did not arrive within `wait`."""
        try:
            sending = users.send(id, await request.body(), port, reliable)
            await _over(sending, wait)
            ticket = sending.ticket(0.0)  # a longer wait would stop the server's event loop
        except QueueFull as error:
            raise HTTPException(503, str(error)) from error
        except MessageRefused as error:
            raise HTTPException(422, str(error)) from error
        except ClientDisconnect as error:
            raise HTTPException(400, "the body is not complete") from error
        if ticket.state is TicketState.GIVEN_UP:
            raise HTTPException(503, str(ticket))
        if wait > 0 and not ticket.final:
            raise HTTPException(504, sending.in_words(wait))
        return DataSent(ticket=ticket.number, state=ticket.state)

    @router.get(
        "/data",
        responses={200: {"content": {"text/event-stream": {}}}},
        response_class=Response,
    )
    async def data(
        port: Annotated[
            Optional[int],
            Query(ge=0, le=MAX_DATA_PORT, description="Only messages for this port."),
            WholeDigits,
        ] = None,
    ) -> Response:
        """The messages that the gateway receives from now on, as server-sent events.

        Each event is a JSON object: sender, port, to_all, reliable, payload (base64).
        """
        return StreamingResponse(_events(users, port), media_type="text/event-stream")

    return router


async def _over(sending: Sending, wait_s: float) -> None:
    """Wait until the node has accepted the message, then for its final state."""
    until_s = time.monotonic() + wait_s
    give_up_s = time.monotonic() + HANDOVER_S  # then `ticket` raises
    while not sending.over.done():
        now_s = time.monotonic()
        if now_s >= (until_s if sending.taken.done() else give_up_s):
            return
        await asyncio.sleep(_POLL_S)


async def _events(users: UsersDesk, port: Optional[int]) -> AsyncIterator[str]:
    loop = asyncio.get_running_loop()
    messages: asyncio.Queue[ReceivedMessage] = asyncio.Queue(MOST_UNREAD)
    is_slow = False

    def put(message: ReceivedMessage) -> None:
        nonlocal is_slow
        if messages.full():
            is_slow = True
            end()  # the client has stopped reading: while it does, nothing else runs here
        else:
            messages.put_nowait(message)

    def receive(message: ReceivedMessage) -> None:
        if port in (None, message.port):
            loop.call_soon_threadsafe(put, message)

    end = users.subscribe(receive)
    try:
        yield ": messages of users\n\n"
        while not (is_slow or messages.full()):
            try:
                message = await asyncio.wait_for(messages.get(), SIGN_OF_LIFE_S)
            except asyncio.TimeoutError:
                yield ": nothing came\n\n"
            else:
                yield f"data: {json.dumps(in_json(message))}\n\n"
    finally:
        end()
