"""MqttInternet: users' messages between a gateway and an MQTT broker (paho-mqtt).

Delivery is "at least once" on both sides. Received messages wait in memory until the broker has
acknowledged them, even while there is no connection. A message from the broker is acknowledged only
when the node has delivered it or given it up, so the broker keeps it if the gateway restarts.
"""

from __future__ import annotations

import json
import logging
import math
import ssl
import sys
import threading
import time
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Callable

import paho.mqtt.client as mqtt
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from drone_mesh.communication.data.outgoing import Ticket
from drone_mesh.communication.data.transport import ReceivedMessage
from drone_mesh.communication.events.observer import MeshEvent
from drone_mesh.communication.interfaces import (
    MAX_NODE_ID,
    NO_ROUTE,
    IGatewayCommands,
    IInternetConnection,
    KnownNode,
)
from drone_mesh.errors import ConfigurationError, MessageRefused, QueueFull
from drone_mesh.execution import Submit
from drone_mesh.internet.mqtt_topics import Broker, Topics
from drone_mesh.users.desk import UsersDesk

QOS = 1  # at least once
KEEP_ALIVE_S = 15  # time until a broken connection is noticed and the last will is sent
MOST_WAITING = 10_000  # messages for an absent broker; then new ones are dropped
MOST_EVENTS = 1000  # likewise, besides the messages
STATE_PERIOD_S = 5.0
RETRY_S = 0.5  # pause after the mesh's queue was full
RETAINED = "retained messages are not sent: each new connection would send them again"
_DELAYS_S = (1, 30)  # shortest and longest pause between attempts to connect
SHORT_S, SHORT_ONES = 60.0, 3  # after so many short connections in a row the pause is the longest

_log = logging.getLogger(__name__)


class _Unacknowledged:
    """A message from the broker that is not acknowledged yet."""

    def __init__(self, message: mqtt.MQTTMessage) -> None:
        self.message = message
        self.is_over = False  # delivered in the mesh, refused or given up

    def comes_again_as(self, message: mqtt.MQTTMessage) -> bool:
        """Whether the broker repeats it. A restored one may use its packet id for another."""
        known = self.message
        is_same = known.topic == message.topic and known.payload == message.payload
        return message.dup and is_same


class MqttInternet(IInternetConnection):
    """The MQTT connection of a gateway.

    Three threads use it: that of paho's loop calls `_on_...`; another one publishes states, and
    resubmits messages that the full queue of the mesh refused; the node's calls `observe`,
    `_received` and message callbacks. All may use paho's client.
    """

    def __init__(
        self,
        submit: Submit,
        users: UsersDesk,
        broker: Broker,
        ca_file: Path | None = None,
        sends: bool = True,
        is_internet: bool = False,
    ) -> None:
        """`submit` runs a function on the node's thread; `sends`: send messages published on tx.

        `is_internet`: without the broker, the gateway says that it has no internet. If several
        gateways use one broker, only one of them should send these. Raises ConfigurationError for a
        file that cannot be read.
        """
        self._submit = submit
        self._users = users
        self._broker = broker
        self._topics = Topics(broker.mesh)
        self._node = users.node_id
        self._sends = sends
        self._is_internet = is_internet
        self._commands: IGatewayCommands | None = None
        self._stopped = threading.Event()
        self._end_subscription: Callable[[], None] = lambda: None
        self._states: dict[int, str] = {}  # as published; for the node's thread
        self._left_online: set[int] = set()  # by an earlier run; for the node's thread
        self._lock = threading.Lock()
        self._to_retry: list[mqtt.MQTTMessage] = []  # under the lock
        # Messages whose acknowledgement the broker has not received, by packet id. Under the lock.
        self._unacknowledged: dict[int, _Unacknowledged] = {}
        self._dropped = 0
        self._events_waiting = 0
        self._client_id = f"drone_mesh-{broker.mesh}-{self._node}"
        self._client = mqtt.Client(
            CallbackAPIVersion.VERSION2,
            client_id=self._client_id,
            clean_session=False,  # the broker keeps messages while this program is offline
            manual_ack=True,
        )
        self._client.max_queued_messages_set(MOST_WAITING + MOST_EVENTS)
        self._client.reconnect_delay_set(*_DELAYS_S)
        if broker.user:
            self._client.username_pw_set(broker.user, broker.password or None)
        if broker.tls:
            try:
                context = ssl.create_default_context(cafile=ca_file)
            except ssl.SSLError as error:
                raise ConfigurationError(f"--mqtt-ca {ca_file}: no certificate in PEM") from error
            except OSError as error:
                raise ConfigurationError(f"--mqtt-ca {ca_file}: {error.strerror}") from error
            self._client.tls_set_context(context)
        self._client.will_set(self._topics.state(self._node), _offline(self._node), QOS, True)
        self._client.on_connect = self._on_connect
        self._client.on_connect_fail = self._on_connect_fail
        self._client.on_disconnect = self._on_disconnect
        self._client.on_message = self._on_message
        self._threads: list[threading.Thread] = []
        self._complained = False
        self._connected_s = -math.inf
        self._short_ones = 0  # connections in a row

    def connect(self, commands: IGatewayCommands) -> None:
        """Connect as soon as the broker answers; returns at once."""
        self._commands = commands
        self._end_subscription = self._users.subscribe(self._received)
        self._threads = [
            threading.Thread(target=self._keep_connected, name=f"MQTT {self._node}"),
            threading.Thread(
                target=self._keep_states_published,
                args=(commands,),
                name=f"MQTT states {self._node}",
            ),
        ]
        for thread in self._threads:
            thread.start()

    def disconnect(self) -> None:
        """Disconnect from the broker and end the threads."""
        self._stopped.set()
        self._end_subscription()
        if not self._threads:
            return
        loop, states = self._threads
        self._threads = []
        states.join()
        if self._client.is_connected():
            topic = self._topics.state(self._node)
            self._client.publish(topic, _offline(self._node), QOS, True).wait_for_publish(1.0)
        while loop.is_alive():
            self._client.disconnect()
            loop.join(RETRY_S)

    # From the mesh to the broker ---------------------------------------------------------------

    def observe(self, event: MeshEvent) -> None:
        """A MeshObserver: publishes an event of a node."""
        peer = event.peer if event.peer <= MAX_NODE_ID else None
        self._say(
            str(event.node),
            {
                "event": event.kind.value,
                "peer": peer,
                "detail": event.detail or None,
                "order": event.order or None,
                "place": event.place,
            },
        )

    def _received(self, message: ReceivedMessage) -> None:
        """On the node's thread; paho keeps the message until the broker has acknowledged it."""
        topic = self._topics.rx(message.sender, message.port)
        if self._client.publish(topic, message.payload, QOS).rc == mqtt.MQTT_ERR_QUEUE_SIZE:
            self._dropped += 1
            if self._dropped == 1 or self._dropped % 1000 == 0:
                _log.error(
                    "MQTT: %d messages wait for %s; %d are lost",
                    MOST_WAITING,
                    self._broker.url,
                    self._dropped,
                )

    def _keep_states_published(self, commands: IGatewayCommands) -> None:
        due_s = 0.0
        while not self._stopped.wait(RETRY_S):
            with self._lock:
                again, self._to_retry = self._to_retry, []
            for message in again:
                self._hand_in(message)
            due_s -= RETRY_S
            if due_s <= 0.0 and self._client.is_connected():
                due_s = STATE_PERIOD_S
                self._submit(lambda now_s: self._publish_states(commands, now_s))

    def _publish_states(self, commands: IGatewayCommands, now_s: float) -> None:
        """On the node's thread: publish changed states."""
        gone = [KnownNode(node, NO_ROUTE, NO_ROUTE, -math.inf) for node in self._left_online]
        nodes = [*gone, *commands.get_known_nodes()]
        states = {node.node_id: _state(node, now_s, by=self._node) for node in nodes}
        states[self._node] = json.dumps({"online": True, "node": self._node, "gateway": True})
        for node, state in states.items():
            if self._states.get(node) != state:
                self._states[node] = state
                self._client.publish(self._topics.state(node), state, QOS, True)

    # From the broker to the mesh ---------------------------------------------------------------

    def _on_message(self, _client: mqtt.Client, _userdata: Any, message: mqtt.MQTTMessage) -> None:
        try:
            node = self._topics.node_of_state(message.topic)
            if node is None:
                self._receive(message)
            elif message.retain and _is_online(message.payload, by=self._node):
                self._submit(lambda _now_s: self._left_online.add(node))
        except Exception as error:  # a topic, for example, that no broker lets pass
            _log.warning("MQTT: dropped a message of the broker %s: %s", self._broker.url, error)
            with self._lock:
                self._unacknowledged.pop(message.mid, None)
            self._client.ack(message.mid, message.qos)

    def _receive(self, message: mqtt.MQTTMessage) -> None:
        with self._lock:
            known = self._unacknowledged.get(message.mid)
            is_new = known is None or not known.comes_again_as(message)
            if is_new:
                self._unacknowledged[message.mid] = _Unacknowledged(message)
        if is_new:
            self._hand_in(message)
        elif known is not None and known.is_over:  # the connection broke before it was acknowledged
            self._acknowledge(known.message)

    def _hand_in(self, message: mqtt.MQTTMessage) -> None:
        destination = self._topics.destination(message.topic)
        node = self._topics.node_of(message.topic)
        if destination is None or message.retain:
            reason = RETAINED if message.retain else f"no such node or port: {message.topic}"
            self._say(node, {"state": "refused", "reason": reason})
            self._acknowledge(message)
            return
        sending = self._users.send(destination.to, bytes(message.payload), destination.port)

        def ended(over: Future[Ticket]) -> None:
            try:
                ticket = over.result()
            except QueueFull:
                with self._lock:
                    self._to_retry.append(message)
                return
            except MessageRefused as error:
                event: dict[str, Any] = {"state": "refused", "reason": str(error)}
            else:
                event = {"state": ticket.state.value, "reason": ticket.reason, "bytes": ticket.size}
            self._say(node, event)
            self._acknowledge(message)

        sending.over.add_done_callback(ended)

    def _acknowledge(self, message: mqtt.MQTTMessage) -> None:
        with self._lock:
            known = self._unacknowledged.get(message.mid)
            if known is None or known.message is not message:
                return  # the broker has lost that session: its packet id is another message's now
            known.is_over = True
        if self._client.ack(message.mid, message.qos) == mqtt.MQTT_ERR_SUCCESS:
            with self._lock:
                self._unacknowledged.pop(message.mid, None)

    def _say(self, node: str, event: dict[str, Any]) -> None:
        self._events_waiting = 0 if self._client.is_connected() else self._events_waiting + 1
        if self._events_waiting > MOST_EVENTS:
            return
        self._client.publish(self._topics.event(node), json.dumps(event), QOS)

    # The connection ----------------------------------------------------------------------------

    def _keep_connected(self) -> None:
        while not self._stopped.is_set():
            self._client.connect_async(self._broker.host, self._broker.port, KEEP_ALIVE_S)
            try:
                self._client.loop_forever(retry_first_connection=True)
            except Exception as error:  # paho trusts that the packets of a broker are whole
                self._complain(f"sent what cannot be read ({error!r})")
            self._stopped.wait(_DELAYS_S[0])

    def _on_connect(
        self,
        client: mqtt.Client,
        _userdata: Any,
        _flags: mqtt.ConnectFlags,
        reason: ReasonCode,
        _properties: Properties | None,
    ) -> None:
        if reason.is_failure:
            self._complain(f"refuses the connection: {reason}")
            return
        self._complained = False
        self._connected_s = time.monotonic()
        self._internet_works(True)
        _log.info("MQTT: connected to %s, mesh %s", self._broker.url, self._broker.mesh)
        if self._sends:
            client.subscribe([(topic, QOS) for topic in self._topics.all_tx])
        client.subscribe(self._topics.all_states, 0)  # what was retained; not kept while offline
        self._submit(lambda _now_s: self._states.clear())  # the last will may have replaced them

    def _on_connect_fail(self, _client: mqtt.Client, _userdata: Any) -> None:
        error = sys.exc_info()[1]  # paho calls this from its error handler
        if isinstance(error, ssl.SSLCertVerificationError):
            self._complain(f"is not trusted: {error.verify_message}")
        else:
            self._complain("does not answer")

    def _on_disconnect(
        self,
        _client: mqtt.Client,
        _userdata: Any,
        _flags: mqtt.DisconnectFlags,
        reason: ReasonCode,
        _properties: Properties | None,
    ) -> None:
        if self._stopped.is_set() or not reason.is_failure:
            return
        is_short = time.monotonic() - self._connected_s < SHORT_S
        self._short_ones = self._short_ones + 1 if is_short else 0
        what, delay_s = "broke the connection", _DELAYS_S[0]
        if self._short_ones >= SHORT_ONES:  # as a broker does with two that have one id
            what += f" soon again (does another program use the client id {self._client_id}?)"
            delay_s = _DELAYS_S[1]
        self._client.reconnect_delay_set(delay_s, _DELAYS_S[1])
        self._complain(what)

    def _complain(self, what: str) -> None:
        """Log one line per outage."""
        if not self._complained:
            self._complained = True
            self._internet_works(False)
            _log.warning(
                "MQTT: the broker %s %s; trying again, messages wait", self._broker.url, what
            )

    def _internet_works(self, works: bool) -> None:
        commands = self._commands
        if self._is_internet and commands is not None:
            self._submit(lambda now_s: commands.set_internet(works, now_s))


def _offline(node: int) -> str:
    return json.dumps({"online": False, "node": node, "gateway": True})


def _is_online(state: bytes | bytearray, by: int) -> bool:
    """Whether a state that this gateway may have published says that a router is online."""
    try:
        said = json.loads(state)
    except (ValueError, RecursionError):
        return False
    if not isinstance(said, dict) or said.get("gateway") is not False:
        return False
    return said.get("online") is True and said.get("by", by) == by


def _state(node: KnownNode, now_s: float, by: int) -> str:
    heard = math.isfinite(node.heard_s)
    return json.dumps(
        {
            "online": node.next_hop != NO_ROUTE,
            "node": node.node_id,
            "gateway": False,
            "by": by,
            "hops": None if node.hops == NO_ROUTE else node.hops,
            "next_hop": None if node.next_hop == NO_ROUTE else node.next_hop,
            "heard_minutes_ago": int(max(0.0, now_s - node.heard_s) // 60) if heard else None,
        }
    )
