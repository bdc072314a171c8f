"""A gateway of a running mesh, with its HTTP side on a free port."""

from __future__ import annotations

from typing import Any, Callable, Iterator

import httpx
import pytest

from drone_mesh.communication.node.gateway import MeshnetworkGateway
from drone_mesh.execution import MeshExecutor
from drone_mesh.inprocess import Network
from drone_mesh.internet.http_internet import HttpInternet
from drone_mesh.internet.http_settings import HttpSettings
from drone_mesh.web.listening import Certificate

TOKEN = "0123456789abcdef0123"


class MeshWithHttp:
    """One gateway (0) and the routers 1, 2, 3 in a line behind it, 6 m apart.

    The network belongs to the executor's thread; `before` may do something to it until then.
    """

    def __init__(
        self,
        token: str = "",
        answer_within_s: float = 10.0,
        before: Callable[[Network], None] = lambda network: None,
        names: tuple[str, ...] = (),
        certificate: Certificate | None = None,
        **settings: Any,
    ) -> None:
        self.network = Network(seed=1)
        self.network.add_gateway(0, 0.0, 0.0)
        for node_id in (1, 2, 3):
            self.network.add_router(node_id, 6.0 * node_id, 0.0)
        assert self.network.run_until(self.network.all_connected, within_s=15.0)
        self.network.run_for(12.0)  # each node has sent a heartbeat since
        before(self.network)
        gateway = self.network.nodes[0].component
        assert isinstance(gateway, MeshnetworkGateway)
        self.gateway = gateway
        self.executor = MeshExecutor(lambda: self.network.clock.now_s, clock_notifies=True)
        http = HttpSettings(port=0, token=token, names=names, certificate=certificate)
        self.internet = HttpInternet(
            self.executor.submit, http, answer_within_s=answer_within_s, **settings
        )
        self.executor.start()
        self.internet.connect(gateway)
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        # Nothing is encrypted here: loading the certificates would take longer than most tests.
        self.client = httpx.Client(
            base_url=self.internet.url, headers=headers, timeout=20.0, verify=False
        )

    def close(self) -> None:
        self.client.close()
        self.internet.disconnect()
        self.executor.stop()

    def sent(self) -> int:
        """Packets that the gateway has sent."""
        return self.gateway.get_total_message_sent()

    def run_for(self, seconds: float) -> None:
        """Let simulated time pass; done when this returns."""
        self.executor.stop()
        self.network.run_for(seconds)


@pytest.fixture(scope="session")
def mesh() -> Iterator[MeshWithHttp]:
    """For tests that only read; a test that changes the mesh makes its own."""
    mesh = MeshWithHttp()
    yield mesh
    mesh.close()


@pytest.fixture(scope="session")
def guarded_mesh() -> Iterator[MeshWithHttp]:
    """Wants the token. For tests that only ask."""
    mesh = MeshWithHttp(token=TOKEN)
    yield mesh
    mesh.close()


@pytest.fixture(scope="session")
def ordered_mesh() -> Iterator[MeshWithHttp]:
    """Wants the token. For tests that send any orders and do not look at the drones."""
    mesh = MeshWithHttp(token=TOKEN)
    yield mesh
    mesh.close()


@pytest.fixture
def make_mesh() -> Iterator[Callable[..., MeshWithHttp]]:
    made = []

    def make(**arguments: object) -> MeshWithHttp:
        made.append(MeshWithHttp(**arguments))
        return made[-1]

    yield make
    for mesh in made:
        mesh.close()
