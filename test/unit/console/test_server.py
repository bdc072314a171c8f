"""The server with pages that misbehave, driven as ASGI without a network."""

from __future__ import annotations

import asyncio
import json
import threading
from typing import Any, Awaitable, Callable

import pytest

from drone_mesh.console import server as server_module
from drone_mesh.console.controls import OrderRefused
from drone_mesh.console.dots import Dot
from drone_mesh.console.frame_store import FrameStore
from drone_mesh.console.orders import LayoutOffer
from drone_mesh.console.server import MOST_PAGES, ConsoleServer
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.formations.preview import FormationPreview
from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus
from drone_mesh.web import access
from drone_mesh.web.access import Access

LIMIT_S = 5.0
A, B = Location(2.0, 1.0, 3.0), Location(0.0, 0.0, 0.0)
OFFER = LayoutOffer(0, "0: field case", [(1, 2.0, 3.0, 0.0)])


class Request:
    """A GET request for the page."""

    def __init__(self, server: ConsoleServer, query: bytes) -> None:
        self._app = server.app
        self._query = query
        self.status = 0

    async def answer(self) -> int:
        scope = {
            "type": "http",
            "method": "GET",
            "path": "/palette.css",
            "query_string": self._query,
            "headers": [(b"host", b"10.0.0.9:1")],
            "client": ("10.0.0.1", 5),
        }
        await self._app(scope, asyncio.Queue().get, self._send)
        return self.status

    async def _send(self, message: dict[str, Any]) -> None:
        self.status = message.get("status", self.status)


class PromptControls:
    """Everything is done at once; layout 9 is refused."""

    def power(self, node: int, on: bool) -> str:
        return f"{node} {on}"

    def fly(self, node: int, x: float, y: float, z: float, allow_shared_place: bool = False) -> str:
        return "flies"

    def layout(self, case: int) -> str:
        if case == 9:
            raise OrderRefused("no case 9")
        return "ordered"

    def preview(self, case: int) -> FormationPreview:
        return FormationPreview(9.0, [14], [], {3: "drone 5 is in the way"}, 0.82)

    def speed(self, paused: bool, factor: float) -> str:
        return "done"


class FakePage:
    """The other end of a WebSocket; one that is stuck takes nothing after the handshake."""

    def __init__(self, server: ConsoleServer, stuck: bool = False, **headers: str) -> None:
        self._server = server
        self._stuck = stuck
        self._headers = {"host": "127.0.0.1:1", "origin": "http://127.0.0.1:1", **headers}
        self._to_server: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self.received: list[dict[str, Any]] = []
        self.closed_with: int | None = None
        self.task: asyncio.Task[None] | None = None

    def open(self) -> FakePage:
        self._to_server.put_nowait({"type": "websocket.connect"})
        scope = {
            "type": "websocket",
            "path": "/ws",
            "query_string": b"",
            "headers": [(k.encode(), v.encode()) for k, v in self._headers.items()],
            "client": ("127.0.0.1", 5),
            "subprotocols": [],
        }
        app = self._server.app
        self.task = asyncio.ensure_future(app(scope, self._to_server.get, self._send))
        return self

    def say(self, **request: object) -> None:
        self._to_server.put_nowait({"type": "websocket.receive", "text": json.dumps(request)})

    def say_bytes(self, message: bytes) -> None:
        self._to_server.put_nowait({"type": "websocket.receive", "bytes": message})

    @property
    def heard_everything(self) -> bool:
        return self._to_server.empty()

    def vanish(self) -> None:
        self._to_server.put_nowait({"type": "websocket.disconnect", "code": 1006})

    def of_type(self, kind: str) -> list[dict[str, Any]]:
        return [message for message in self.received if message["type"] == kind]

    async def _send(self, message: Any) -> None:
        if message["type"] == "websocket.send":
            if self._stuck:
                await asyncio.Event().wait()
            self.received.append(json.loads(message["text"]))
        elif message["type"] == "websocket.close":
            self.closed_with = message["code"]


async def until(what: str, condition: Callable[[], object]) -> None:
    deadline_s = asyncio.get_running_loop().time() + LIMIT_S
    while not condition():
        assert asyncio.get_running_loop().time() < deadline_s, f"timed out: {what}"
        await asyncio.sleep(0.01)


def run(scenario: Callable[[ConsoleServer, FrameStore], Awaitable[None]]) -> None:
    async def main() -> None:
        store = FrameStore()
        store.update_mesh(MeshStatus(1.0, [NodeStatus(1, connected=True)]), 0.0)
        server = ConsoleServer(store, PromptControls(), Access(), [OFFER])
        try:
            await scenario(server, store)
        finally:
            server.close()

    asyncio.run(main())


ACTIONS = [
    "fly", "power", "layout", "formation", "speed", "add", "remove", "mission", "fence",
    "demonstrate", "packets",
]  # fmt: skip
KINDS = ["heartbeat", "introduction", "position", "repair", "order", "report", "data", "other"]


def test_who_guesses_tokens_is_slowed_down_and_logged_once(monkeypatch, caplog):
    monkeypatch.setattr(access, "GUESS_PERIOD_S", 1000.0)
    server = ConsoleServer(FrameStore(), PromptControls(), Access("0123456789abcdef"))

    async def guess() -> list[int]:
        return [await Request(server, b"token=wrong").answer() for _ in range(600)]

    statuses = asyncio.run(guess())
    assert statuses == [403] * 10 + [429] * 590
    lines = [line for line in caplog.messages if "refused" in line]
    assert len(lines) == 1
    assert lines[0].startswith("console: refused 10.0.0.1: token missing or invalid")


def test_a_page_is_greeted_and_then_gets_everything():
    async def scenario(server: ConsoleServer, _store: FrameStore) -> None:
        page = FakePage(server).open()
        await until("a frame", lambda: page.of_type("frame"))
        assert page.received[0] == {
            "type": "hello",
            "layouts": [[0, "0: field case", [[1, 2.0, 3.0, 0.0]]]],
            "limits": {
                "coordinate": 5000.0,
                "height": 500.0,
                "id": 253,
                "characters": 1_500_000,
                "events": 1000,
                "samples": 600,
            },
            "actions": ACTIONS,
            "packet_kinds": KINDS,
            "recording": "",
            "demo": "repair",
            "map": None,
        }
        assert page.received[1]["full"]

    run(scenario)


def test_a_page_that_reads_nothing_is_disconnected_while_another_continues(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(server_module, "SEND_TIMEOUT_S", 0.3)

    async def scenario(server: ConsoleServer, store: FrameStore) -> None:
        stuck, well = FakePage(server, stuck=True).open(), FakePage(server).open()
        for tick in range(200):
            store.update_mesh(MeshStatus(2.0 + tick, [NodeStatus(1, hops=tick % 9)]), float(tick))
            await asyncio.sleep(0.005)
            if stuck.task is not None and stuck.task.done():
                break
        assert stuck.task is not None
        await until("the stuck page is cut off", stuck.task.done)
        frames = len(well.of_type("frame"))
        store.update_mesh(MeshStatus(500.0, [NodeStatus(1)]), 500.0)
        await until("the other goes on", lambda: len(well.of_type("frame")) > frames)
        assert well.of_type("frame")[-1]["clock"]["t"] == 500.0

    run(scenario)


def test_frames_come_at_most_at_the_frame_rate():
    async def scenario(server: ConsoleServer, store: FrameStore) -> None:
        page = FakePage(server).open()
        await until("the first frame", lambda: page.of_type("frame"))
        started_s = asyncio.get_running_loop().time()
        before = len(page.of_type("frame"))
        for tick in range(100):
            store.update_mesh(MeshStatus(2.0 + tick, [NodeStatus(1, hops=tick % 9)]), 0.0)
            await asyncio.sleep(0.005)
        passed_s = asyncio.get_running_loop().time() - started_s  # more on a busy machine
        frames = len(page.of_type("frame")) - before
        assert 1 <= frames <= passed_s / server_module.FRAME_PERIOD_S + 1

    run(scenario)


def test_orders_are_answered_by_their_numbers():
    async def scenario(server: ConsoleServer, _store: FrameStore) -> None:
        page = FakePage(server).open()
        page.say(do="power", number=4, node=3, on=False)
        page.say(do="layout", number=5, case=9)
        page.say(do="layout", number=6, case="x")
        await until("three answers", lambda: len(page.of_type("answer")) == 3)
        answers = {answer["number"]: answer for answer in page.of_type("answer")}
        assert (answers[4]["done"], answers[4]["text"]) == (True, "3 False")
        assert (answers[5]["done"], answers[5]["text"]) == (False, "no case 9")
        assert not answers[6]["done"]

    run(scenario)


def test_an_order_is_not_late_because_the_console_computed_an_answer_before_it(monkeypatch):
    ordered = threading.Event()

    def preview(_controls: PromptControls, _case: int) -> FormationPreview:
        assert ordered.wait(LIMIT_S)
        return FormationPreview(9.0, [14], [], {}, 0.82)

    monkeypatch.setattr(PromptControls, "preview", preview)

    async def scenario(server: ConsoleServer, _store: FrameStore) -> None:
        page = FakePage(server).open()
        page.say(do="preview", number=1, case=0)
        page.say(do="power", number=2, node=3, on=False)
        await until("the order's answer", lambda: page.of_type("answer"))
        ordered.set()
        await until("both answers", lambda: len(page.of_type("answer")) == 2)
        assert [answer["number"] for answer in page.of_type("answer")] == [2, 1]

    run(scenario)


def test_a_new_order_of_a_page_hides_the_progress_of_the_one_before():
    async def scenario(server: ConsoleServer, store: FrameStore) -> None:
        def order() -> str:
            return json.loads(store.frame_since(0))["nodes"]["1"]["order"]

        store.add_events([EventRecord(1.0, 0, "order arrived", (1,), "", 7, A)])
        store.update_mesh(MeshStatus(1.0, [NodeStatus(1)]), 0.0)
        page = FakePage(server).open()
        page.say(do="power", number=1, node=1, on=False)
        await until("an answer", lambda: page.of_type("answer"))
        assert order() == f"order 7 to {A.in_words()}: arrived"
        for number, request in enumerate(
            ({"do": "fly", "node": 1, "x": 2.0, "y": 3.0, "z": 0.0}, {"do": "layout", "case": 0}), 2
        ):
            page.say(number=number, **request)
            await until("an answer", lambda number=number: len(page.of_type("answer")) == number)
            assert order() == "being sent"
            store.add_events([EventRecord(2.0, 0, "order sent", (1,), "", number + 6, B)])
            store.update_mesh(MeshStatus(2.0, [NodeStatus(1)]), 0.0)
            assert order() == f"order {number + 6} to {B.in_words()}: sent"

    run(scenario)


def test_a_binary_message_is_answered_and_the_page_stays_connected():
    async def scenario(server: ConsoleServer, _store: FrameStore) -> None:
        page = FakePage(server).open()
        page.say_bytes(b"\x00\xff")
        page.say(do="power", number=4, node=3, on=False)
        await until("two answers", lambda: len(page.of_type("answer")) == 2)
        refusal, answer = page.of_type("answer")
        assert (refusal["done"], refusal["text"]) == (
            False, "invalid binary message: a request is JSON text",
        )  # fmt: skip
        assert answer["done"]

    run(scenario)


@pytest.mark.parametrize("steps", range(8))
def test_a_server_that_is_cancelled_as_an_answer_goes_out_ends(steps: int):
    """Before Python 3.12, asyncio.wait_for swallows a cancellation that comes just then."""

    async def scenario(server: ConsoleServer, _store: FrameStore) -> None:
        page = FakePage(server).open()
        await until("a frame", lambda: page.of_type("frame"))
        page.say(do="watch", node=1)
        for _ in range(steps):
            await asyncio.sleep(0)
        for task in asyncio.all_tasks() - {asyncio.current_task()}:
            task.cancel()
        await until("the end", lambda: page.task is not None and page.task.done())
        left = asyncio.all_tasks() - {asyncio.current_task()}
        for task in left:
            task.cancel()
        assert not left

    run(scenario)


def test_a_watched_node_comes_with_its_neighbours():
    async def scenario(server: ConsoleServer, store: FrameStore) -> None:
        page = FakePage(server).open()
        page.say(do="watch", node=1)
        node = NodeStatus(1, neighbours=b"\x00\x07", neighbour_ages=b"\x01\x09", fallback_age=12.0)
        wanted = {
            "type": "detail",
            "node": 1,
            "neighbours": [[0, 1], [7, 9]],
            "fallback_age": 12,
        }
        store.update_mesh(MeshStatus(2.0, [node]), 1.0)
        await until("the request is heard", lambda: page.heard_everything)
        store.update_mesh(MeshStatus(3.0, [node]), 2.0)
        await until("details", lambda: wanted in page.received)

    run(scenario)


@pytest.mark.parametrize(
    "headers", [{"origin": "http://evil.example"}, {"host": "evil.example"}, {"origin": ""}]
)
def test_a_stranger_is_disconnected_before_any_message(headers):
    async def scenario(server: ConsoleServer, _store: FrameStore) -> None:
        page = FakePage(server, **headers).open()
        await until("closed", lambda: page.closed_with)
        assert page.closed_with == 1008
        assert page.received == []

    run(scenario)


def test_pages_above_the_limit_are_refused_and_a_vanished_page_frees_its_place():
    async def scenario(server: ConsoleServer, _store: FrameStore) -> None:
        pages = [FakePage(server).open() for _ in range(MOST_PAGES)]
        await until("all are greeted", lambda: all(page.received for page in pages))
        late = FakePage(server).open()
        await until("closed", lambda: late.closed_with)
        assert late.closed_with == 1013
        pages[0].vanish()
        assert pages[0].task is not None
        await until("it is forgotten", pages[0].task.done)
        later = FakePage(server).open()
        await until("greeted", lambda: later.received)

    run(scenario)


def test_packets_are_shown_only_to_pages_that_want_them_and_look_at_the_present():
    async def scenario(server: ConsoleServer, store: FrameStore) -> None:
        page, other = FakePage(server).open(), FakePage(server).open()
        await until("both pages", lambda: page.of_type("frame") and other.of_type("frame"))
        assert not server.packets_wanted
        page.say(do="packets", on=True)
        await until("the wish", lambda: server.packets_wanted)
        server.show_packets(7, [Dot(1, 0, 4, 0.1234)])
        await until("the packets", lambda: page.of_type("packets"))
        assert page.of_type("packets") == [
            {"type": "packets", "carried": 7, "dots": [[1, 0, "heartbeat", 0.123]]}
        ]
        page.say(do="packets", on=False)
        await until("no wish", lambda: not server.packets_wanted)
        server.show_packets(7, [Dot(1, 0, 4, 0.1234)])
        store.set_link("a sign")
        await until("the sign", lambda: page.of_type("frame")[-1]["link"] == "a sign")
        assert len(page.of_type("packets")) == 1
        assert other.of_type("packets") == []
        page.say(do="packets", on=True)
        await until("the wish", lambda: server.packets_wanted)
        page.vanish()
        await until("no page wants any", lambda: not server.packets_wanted)

    run(scenario)


def test_a_preview_of_a_layout_names_who_would_be_out_of_reach_and_who_would_stay():
    async def scenario(server: ConsoleServer, _store: FrameStore) -> None:
        page = FakePage(server).open()
        page.say(do="preview", number=1, case=0)
        await until("the answer", lambda: page.of_type("answer"))
        (answer,) = page.of_type("answer")
        assert answer["text"].startswith("1 drone would be out of reach: 14; drone 3 would stay: ")
        assert answer["preview"]["out_of_reach"] == answer["lost"] == [14]
        assert answer["preview"]["stays"] == {"3": "drone 5 is in the way"}

    run(scenario)


def test_a_flight_out_of_reach_is_foreseen():
    async def scenario(server: ConsoleServer, store: FrameStore) -> None:
        gateway = NodeStatus(0, role=Role.GATEWAY, position=(0.0, 0.0, 0.0))
        drones = [NodeStatus(n, position=(6.0 * n, 0.0, 0.0)) for n in (1, 2)]
        store.update_mesh(MeshStatus(1.0, [gateway, *drones]), 1.0)
        page = FakePage(server).open()
        page.say(do="foresee", number=1, places=[[1, 77.0, 0.0, 0]])
        page.say(do="foresee", number=2, places=[[2, 13.0, 0.0, 0]])
        await until("the answers", lambda: len(page.of_type("answer")) == 2)
        far, near = sorted(page.of_type("answer"), key=lambda answer: answer["number"])
        assert far["text"] == "drone 1 would have no route there; drone 2 would lose its route"
        assert far["lost"] == [1, 2]
        assert (near["text"], near["lost"]) == ("", [])

    run(scenario)


def test_a_layout_file_is_answered_with_its_places_or_with_what_is_wrong():
    async def scenario(server: ConsoleServer, _store: FrameStore) -> None:
        page = FakePage(server).open()
        page.say(do="places", number=1, text="cases: {5: {1: [1, 2, 3]}}")
        page.say(do="places", number=2, text="cases: {5: {1: [1, far, 3]}}")
        await until("both answers", lambda: len(page.of_type("answer")) == 2)
        good, bad = sorted(page.of_type("answer"), key=lambda answer: answer["number"])
        assert good["done"]
        assert good["places"] == [[1, 1.0, 2.0, 3.0]]
        assert not bad["done"]
        assert "line 1" in bad["text"]

    run(scenario)
