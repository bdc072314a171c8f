"""Messages of users through a gateway, over HTTP."""

from __future__ import annotations

import asyncio
import base64
import json
import socket

import httpx
import pytest
from conftest import TOKEN, MeshWithHttp

from drone_mesh.communication.data.transport import ReceivedMessage
from drone_mesh.internet import data
from drone_mesh.users import desk
from drone_mesh.users.desk import UsersDesk


class MeshWithUsers(MeshWithHttp):
    """What is handed to the gateway is followed by a second of the mesh."""

    def __init__(self, token=""):
        self.desk = UsersDesk(0, self._submit)
        super().__init__(token=token, users=self.desk)
        self.desk.open(self.gateway.data)

    def _submit(self, work):
        def then_run(now_s):
            work(now_s)
            self.network.nodes[0].plan()
            self.network.run_for(1.0)

        self.executor.submit(then_run)

    def from_node(self, node, payload, port=0):
        """Have a node send a message to the gateway."""
        self.executor.submit(lambda _now_s: self.network.send(node, 0, payload, port))
        self.executor.submit(lambda _now_s: self.network.run_for(1.0))


@pytest.fixture(scope="module")
def users_mesh():
    mesh = MeshWithUsers()
    yield mesh
    mesh.close()


def test_the_body_of_a_post_arrives_at_the_node(users_mesh):
    payload = bytes(range(256)) * 4
    answer = users_mesh.client.post("/nodes/3/data?port=7&wait=10", content=payload)
    assert answer.status_code == 200
    assert answer.json()["state"] == "delivered"
    message = users_mesh.network.received[3][-1]
    assert (message.port, message.payload) == (7, payload)


def test_without_waiting_the_state_is_that_of_the_moment(users_mesh):
    answer = users_mesh.client.post("/nodes/3/data", content=b"soon")
    assert answer.status_code == 200
    assert answer.json()["state"] in ("queued", "sent", "delivered")


@pytest.mark.parametrize(
    ("path", "payload", "status", "reason"),
    [
        ("/nodes/255/data", b"", 422, "less than or equal to 254"),
        ("/nodes/3/data?port=256", b"", 422, "less than or equal to 255"),
        ("/nodes/3/data?wait=61", b"", 422, "less than or equal to 60"),
        ("/nodes/3/data", bytes(1025), 413, "larger than 1024 bytes"),
        ("/nodes/99/data?reliable=false", b"x", 503, "no route to node 99"),
        ("/nodes/99/data?wait=0.1", b"x", 504, "not delivered within 0.1 s"),
    ],
)
def test_what_cannot_be_sent_is_refused_with_the_reason(users_mesh, path, payload, status, reason):
    answer = users_mesh.client.post(path, content=payload)
    assert (answer.status_code, reason in answer.json()["detail"]) == (status, True)


def test_a_node_that_takes_no_message_in_time_does_not_stop_the_server(users_mesh, monkeypatch):
    monkeypatch.setattr(data, "HANDOVER_S", 0.1)
    monkeypatch.setattr(desk, "HANDOVER_S", 3600.0)  # what a wait in the event loop would take
    late = []
    submit, received = users_mesh.desk._submit, users_mesh.network.received[3]
    received.clear()
    monkeypatch.setattr(users_mesh.desk, "_submit", late.append)
    answer = users_mesh.client.post("/nodes/3/data", content=b"lost", timeout=30.0)
    assert answer.status_code == 503
    assert "the node is too busy to take a message" in answer.text
    monkeypatch.undo()
    submit(late[0])  # the node has time again
    users_mesh.client.post("/nodes/3/data?wait=30", content=b"next").raise_for_status()
    assert [message.payload for message in received] == [b"next"]


def test_a_body_that_ends_halfway_is_no_message(users_mesh):
    received = users_mesh.network.received[3]
    received.clear()
    address = httpx.URL(users_mesh.client.base_url)
    with socket.create_connection((address.host, address.port)) as client:
        client.sendall(b"POST /nodes/3/data HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\nhalf")
    users_mesh.client.post("/nodes/3/data?wait=30", content=b"next").raise_for_status()
    assert [message.payload for message in received] == [b"next"]


def test_a_client_that_stops_reading_is_no_longer_listened_for():
    mesh_desk = desk.UsersDesk(0, lambda work: work(0.0))

    async def read_one_then_stop() -> int:
        events = data._events(mesh_desk, None)
        await events.__anext__()
        for number in range(3 * data.MOST_UNREAD):
            message = ReceivedMessage(2, 0, bytes((number & 0xFF,)), False, True, 0.0)
            for receiver in list(mesh_desk._receivers):
                receiver(message)
            await asyncio.sleep(0)
        assert mesh_desk._receivers == []
        return len([event async for event in events])

    assert asyncio.run(read_one_then_stop()) == 0


def test_a_client_that_waits_while_too_many_messages_come_at_once_is_disconnected():
    mesh_desk = desk.UsersDesk(0, lambda work: work(0.0))

    async def read_while_they_come() -> int:
        events = data._events(mesh_desk, None)
        await events.__anext__()
        waiting = asyncio.ensure_future(events.__anext__())
        await asyncio.sleep(0)
        for _ in range(data.MOST_UNREAD + 1):
            for receiver in list(mesh_desk._receivers):
                receiver(ReceivedMessage(2, 0, b"", False, True, 0.0))
        assert (await waiting).startswith("data: ")
        return len([event async for event in events])

    assert asyncio.run(asyncio.wait_for(read_while_they_come(), 10.0)) == 0


def test_messages_for_the_gateway_come_as_events(users_mesh):
    with users_mesh.client.stream("GET", "/data?port=5") as stream:
        lines = (line for line in stream.iter_lines() if line)
        assert next(lines) == ": messages of users"
        users_mesh.from_node(2, b"other port", port=4)
        users_mesh.from_node(2, b"21.5", port=5)
        line = next(lines)
    event = json.loads(line[len("data: ") :])
    assert line.startswith("data: ")
    assert base64.b64decode(event.pop("payload")) == b"21.5"
    assert event == {"sender": 2, "port": 5, "to_all": False, "reliable": True}


def test_without_the_token_nothing_is_sent_or_shown():
    mesh = MeshWithUsers(token=TOKEN)
    try:
        for operation in (("POST", "/nodes/3/data"), ("GET", "/data")):
            answer = mesh.client.request(*operation, headers={"Authorization": "Bearer wrong"})
            assert answer.status_code == 401
    finally:
        mesh.close()
