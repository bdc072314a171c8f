"""A gateway and a real broker, which is stopped, killed and started again."""

from __future__ import annotations

import json
import queue
import shutil
import signal
import socket
import ssl
import subprocess
import threading
import time

import paho.mqtt.client as mqtt
import pytest
from paho.mqtt.enums import CallbackAPIVersion
from patience import PATIENCE_S, free_port, wait_for

from drone_mesh.communication.data.outgoing import LIFETIME_S
from drone_mesh.communication.events.observer import MeshEvent, MeshEventKind
from drone_mesh.communication.node.gateway import MeshnetworkGateway
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError
from drone_mesh.execution import MeshExecutor
from drone_mesh.inprocess import Network
from drone_mesh.internet.mqtt_internet import MOST_EVENTS, MOST_WAITING, MqttInternet
from drone_mesh.internet.mqtt_topics import Broker
from drone_mesh.users.desk import UsersDesk

MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(MOSQUITTO is None, reason="needs a broker: apt install mosquitto"),
]
PASSWORD = "correct horse"


class Mosquitto:
    """A broker that writes each change of its messages to disk."""

    def __init__(self, folder, access="allow_anonymous true\n"):
        self.port = free_port()
        self._file = folder / "mosquitto.conf"
        self._file.write_text(
            f"listener {self.port} 127.0.0.1\n{access}persistence true\n"
            f"persistence_location {folder}/\nautosave_on_changes true\nautosave_interval 1\n"
            "user root\nmax_queued_messages 0\n"
        )
        self._process = None

    def start(self):
        command = [MOSQUITTO, "-c", str(self._file)]
        self._process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        deadline_s = time.monotonic() + PATIENCE_S
        while True:
            try:
                socket.create_connection(("127.0.0.1", self.port), 1.0).close()
                return
            except OSError:
                assert time.monotonic() < deadline_s, "the broker did not start"
                time.sleep(0.05)

    def stop(self):
        self._end(signal.SIGTERM)

    def kill(self):
        """As when its machine loses power."""
        self._end(signal.SIGKILL)

    def freeze(self):
        """It takes bytes, and acknowledges nothing."""
        self._process.send_signal(signal.SIGSTOP)

    def _end(self, how):
        if self._process is not None:
            self._process.send_signal(how)
            self._process.send_signal(signal.SIGCONT)  # if it is frozen
            self._process.wait(PATIENCE_S)
            self._process = None


class Client:
    """Another program that uses the broker; its session outlives the connection."""

    def __init__(self, port, topic, secure=lambda client: None):
        self.messages = queue.Queue()
        self._client = mqtt.Client(
            CallbackAPIVersion.VERSION2, client_id="test", clean_session=False
        )
        secure(self._client)
        self._client.reconnect_delay_set(1, 1)
        self._client.on_connect = lambda client, *_: client.subscribe(topic, 1)
        self._client.on_subscribe = lambda *_: self.messages.put(None)
        self._client.on_message = lambda _client, _data, message: self.messages.put(message)
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()
        assert self.messages.get(timeout=PATIENCE_S) is None

    def publish(self, topic, payload, retain=False):
        return self._client.publish(topic, payload, 1, retain)

    def next(self, wanted=lambda message: True):
        deadline_s = time.monotonic() + PATIENCE_S
        while True:
            message = self.messages.get(timeout=max(0.01, deadline_s - time.monotonic()))
            if message is not None and wanted(message):
                return message

    def close(self):
        self._client.disconnect()
        self._client.loop_stop()


class Gateway:
    """Gateway 0 and router 1; what is handed in is followed by a second of the mesh."""

    def __init__(self, broker, ca_file=None, is_internet=False):
        self.network = Network(seed=1)
        self.network.add_gateway(0, 0.0, 0.0)
        self.network.add_router(1, 6.0, 0.0)
        assert self.network.run_until(self.network.all_connected, 15.0)
        gateway = self.network.nodes[0].component
        assert isinstance(gateway, MeshnetworkGateway)
        self.executor = MeshExecutor(lambda: self.network.clock.now_s, clock_notifies=True)
        self.users = UsersDesk(0, self.submit)
        self.users.open(gateway.data)
        self.internet = MqttInternet(
            self.submit, self.users, broker, ca_file, is_internet=is_internet
        )
        self.subscribed = threading.Event()  # what is published before that is not for it
        self.internet._client.on_subscribe = lambda *_: self.subscribed.set()
        self.executor.start()
        self.internet.connect(gateway)

    def submit(self, work):
        def then_run(now_s):
            work(now_s)
            self.network.nodes[0].plan()
            self.network.run_for(1.0)

        self.executor.submit(then_run)

    def from_node_1(self, payload, port=0):
        self.submit(lambda _now_s: self.network.send(1, 0, payload, port))

    def wait_for_all_at_node_1(self, wanted):
        def missing():
            return wanted - {message.payload for message in self.network.received.get(1, [])}

        wait_for("all messages", lambda: not missing())

    def close(self):
        self.internet.disconnect()
        self.executor.stop()


@pytest.fixture
def broker(tmp_path):
    broker = Mosquitto(tmp_path)
    broker.start()
    yield broker
    broker.stop()


@pytest.fixture
def gateway(broker):
    gateway = Gateway(Broker("127.0.0.1", broker.port, False, "field"))
    yield gateway
    gateway.close()


@pytest.fixture
def client(broker, gateway):
    assert gateway.subscribed.wait(PATIENCE_S)
    client = Client(broker.port, "drone_mesh/field/#")
    yield client
    client.close()


@pytest.fixture
def secure_broker(tmp_path):
    """Takes only TLS, and only node `field` with its password. Certificate: server.pem."""
    if shutil.which("openssl") is None or shutil.which("mosquitto_passwd") is None:
        pytest.skip("needs openssl and mosquitto_passwd")
    certificate, key, passwords = (tmp_path / name for name in ("server.pem", "key.pem", "users"))
    command = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256"]
    command += ["-nodes", "-days", "2", "-subj", "/CN=broker", "-keyout", key, "-out", certificate]
    command += ["-addext", "subjectAltName=IP:127.0.0.1"]
    subprocess.run(command, check=True, capture_output=True)
    passwords.touch(mode=0o600)
    command = ["mosquitto_passwd", "-b", passwords, "field", PASSWORD]
    subprocess.run(command, check=True, capture_output=True)
    access = f"allow_anonymous false\npassword_file {passwords}\n"
    broker = Mosquitto(tmp_path, f"{access}certfile {certificate}\nkeyfile {key}\n")
    broker.start()
    yield broker
    broker.stop()


def is_topic(topic):
    return lambda message: message.topic == f"drone_mesh/field/{topic}"


def test_what_a_node_sends_to_the_gateway_is_published(gateway, client):
    gateway.from_node_1(b"21.5", port=3)
    assert client.next(is_topic("1/rx/3")).payload == b"21.5"


def test_what_is_published_arrives_at_the_node_and_an_event_says_so(gateway, client):
    client.publish("drone_mesh/field/1/tx", b"blink")
    event = json.loads(client.next(is_topic("1/event")).payload)
    assert event == {"state": "delivered", "reason": "", "bytes": 5}
    assert [message.payload for message in gateway.network.received[1]] == [b"blink"]


@pytest.mark.parametrize(
    ("topic", "payload", "reason"),
    [("1", bytes(1025), "too large"), ("999", b"", "no such node or port")],
)
def test_what_cannot_be_sent_is_refused_in_an_event(client, topic, payload, reason):
    client.publish(f"drone_mesh/field/{topic}/tx", payload)
    event = json.loads(client.next(is_topic(f"{topic}/event")).payload)
    assert event["state"] == "refused"
    assert reason in event["reason"]


def test_the_state_of_a_node_is_retained_and_the_end_of_the_gateway_shows(broker, gateway, client):
    known = json.loads(client.next(is_topic("1/state")).payload)
    assert (known["online"], known["node"], known["next_hop"]) == (True, 1, 1)
    assert json.loads(client.next(is_topic("0/state")).payload)["online"] is True
    gateway.internet._client._sock.shutdown(socket.SHUT_RDWR)  # as if its host lost power
    gone = client.next(is_topic("0/state"))
    assert json.loads(gone.payload) == {"online": False, "node": 0, "gateway": True}


def retained(broker, node, **more):
    """What an earlier run left behind: it says that this node is online."""
    client = mqtt.Client(CallbackAPIVersion.VERSION2, client_id="earlier")
    client.connect("127.0.0.1", broker.port)
    client.loop_start()
    state = json.dumps({"online": True, "node": node, "gateway": False, **more})
    client.publish(f"drone_mesh/field/{node}/state", state, 1, True).wait_for_publish(PATIENCE_S)
    client.disconnect()
    client.loop_stop()


def test_a_node_that_died_while_its_gateway_was_away_is_not_online_for_ever(broker):
    retained(broker, 5, by=0)
    retained(broker, 6)  # by a program that named no gateway
    retained(broker, 7, by=9)  # another gateway answers for it
    retained(broker, 1, by=0)  # it lives
    client = Client(broker.port, "drone_mesh/field/#")
    gateway = Gateway(Broker("127.0.0.1", broker.port, False, "field"))
    states = {}

    def are_true(message):
        if message.topic.endswith("/state"):
            states[message.topic.split("/")[2]] = json.loads(message.payload)
        online = {node: state["online"] for node, state in states.items()}
        return online == {"0": True, "1": True, "5": False, "6": False, "7": True}

    try:
        client.next(are_true)
        assert states["5"] == {
            "online": False, "node": 5, "gateway": False, "by": 0, "hops": None, "next_hop": None,
            "heard_minutes_ago": None,
        }  # fmt: skip
        assert states["1"]["by"] == 0
    finally:
        client.close()
        gateway.close()


@pytest.mark.parametrize("state", [b"", b"\xff", b"[]", b"[" * 100_000, b'{"online": 1}'])
def test_a_retained_state_of_somebody_else_harms_nothing(broker, state):
    client = Client(broker.port, "drone_mesh/field/#")
    client.publish("drone_mesh/field/5/state", state, retain=True).wait_for_publish(PATIENCE_S)
    gateway = Gateway(Broker("127.0.0.1", broker.port, False, "field"))
    try:
        client.next(is_topic("0/state"))
        assert gateway.internet._left_online == set()
    finally:
        client.close()
        gateway.close()


def test_a_retained_message_is_sent_by_no_new_connection_and_an_event_says_why(
    broker, gateway, client
):
    client.publish("drone_mesh/field/1/tx", b"blink", retain=True)
    assert json.loads(client.next(is_topic("1/event")).payload)["state"] == "delivered"
    for _ in range(2):
        gateway.internet._client._sock.shutdown(socket.SHUT_RDWR)
        event = json.loads(client.next(is_topic("1/event")).payload)
        assert event["state"] == "refused"
        assert "retained messages are not sent" in event["reason"]
    assert [message.payload for message in gateway.network.received[1]] == [b"blink"]


def test_two_gateways_with_one_client_id_do_not_throw_each_other_out_for_ever(
    broker, gateway, caplog
):
    def throws_it_out():
        other = mqtt.Client(CallbackAPIVersion.VERSION2, "drone_mesh-field-0")
        other.connect("127.0.0.1", broker.port)
        other.loop_start()
        wait_for("it is out", lambda: not gateway.internet._client.is_connected())
        other.disconnect()
        other.loop_stop()

    for _ in range(3):
        wait_for("a connection", gateway.internet._client.is_connected)
        throws_it_out()
    time.sleep(4.0)
    assert not gateway.internet._client.is_connected()
    lines = [record.getMessage() for record in caplog.records if "the broker" in record.message]
    assert len(lines) == 3
    assert "does another program use the client id drone_mesh-field-0?" in lines[-1]
    assert not any("client id" in line for line in lines[:-1])


class BrokenBroker:
    """It answers CONNECT and SUBSCRIBE; then it sends `broken`, once, and each time `good`."""

    def __init__(self, broken, good):
        self._broken, self._good = broken, good
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        while True:
            connection, _address = self._listener.accept()
            with connection:
                connection.settimeout(PATIENCE_S)
                while True:
                    try:
                        request = connection.recv(65536)
                        if not request:
                            break
                        if request[0] == 0x10:
                            connection.sendall(bytes.fromhex("20 02 00 00"))
                        elif request[0] == 0x82:
                            connection.sendall(b"\x90\x04" + request[2:4] + b"\x01\x01")
                            broken, self._broken = self._broken, b""
                            connection.sendall(broken + self._good)
                    except OSError:
                        break


def publish_packet(topic, payload, mid):
    body = len(topic).to_bytes(2, "big") + topic + mid.to_bytes(2, "big") + payload
    return bytes((0x32, len(body))) + body


@pytest.mark.parametrize(
    "broken",
    [
        publish_packet(b"drone_mesh/field/+/tx", b"x", 1),
        publish_packet(b"drone_mesh/field/#/tx", b"x", 1),
        publish_packet(b"drone_mesh/field/\xff/tx", b"x", 1),
        publish_packet(b"", b"x", 1),
        bytes.fromhex("32 01 00"),
        bytes.fromhex("32 03 00 09 41"),
        bytes.fromhex("20 01 00"),
        bytes.fromhex("90 01 00"),
        bytes.fromhex("F0 00"),
    ],
)
def test_nothing_that_a_broken_broker_sends_ends_the_connection_for_good(broken):
    good = publish_packet(b"drone_mesh/field/1/tx", b"blink", 2)
    broker = BrokenBroker(broken, good)
    gateway = Gateway(Broker("127.0.0.1", broker.port, False, "field"))
    try:
        gateway.wait_for_all_at_node_1({b"blink"})
        assert all(thread.is_alive() for thread in gateway.internet._threads)
    finally:
        gateway.close()
    assert not [thread for thread in threading.enumerate() if "MQTT" in thread.name]


class ForgetfulBroker:
    """It loses its sessions with each connection, and numbers its messages from 1 again."""

    def __init__(self):
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self.acknowledged = 0

    def connect(self, payload):
        """Await the gateway, and publish this for node 1."""
        connection, _address = self._listener.accept()
        connection.settimeout(PATIENCE_S)
        while True:
            request = connection.recv(65536)
            if request[0] == 0x10:
                connection.sendall(bytes.fromhex("20 02 00 00"))
            elif request[0] == 0x82:
                connection.sendall(b"\x90\x04" + request[2:4] + b"\x01\x01")
                break
        connection.sendall(publish_packet(b"drone_mesh/field/1/tx", payload, 1))
        threading.Thread(target=self._read, args=(connection,), daemon=True).start()
        return connection

    def _read(self, connection):
        data = b""
        while True:
            try:
                more = connection.recv(65536)
            except OSError:
                return
            if not more:
                return
            data += more
            self.acknowledged = data.count(bytes.fromhex("40 02 00 01"))


@pytest.mark.parametrize("new", [b"new", b"old"])
def test_a_message_of_a_lost_session_does_not_acknowledge_the_one_that_has_its_number_now(new):
    broker = ForgetfulBroker()
    gateway = Gateway(Broker("127.0.0.1", broker.port, False, "field"))
    component, now = gateway.network.nodes[0].component, gateway.network.clock
    gateway.submit(lambda _now_s: gateway.network.power(1, False))

    def queued():
        return component.data.figures().messages_queued

    def run_until(end_s):
        while now.now_s < end_s:
            gateway.submit(lambda _now_s: None)
            time.sleep(0.001)

    try:
        first = broker.connect(b"old")
        wait_for("the old message", lambda: queued() == 1)
        ends_s = now.now_s + LIFETIME_S
        run_until(now.now_s + 60.0)
        first.shutdown(socket.SHUT_RDWR)
        second = broker.connect(new)
        wait_for("the new message", lambda: queued() == 2)
        run_until(ends_s + 5.0)
        wait_for("the end of the old one", lambda: queued() == 1)
        time.sleep(0.5)
        assert broker.acknowledged == 0
        run_until(ends_s + 80.0)
        wait_for("the end of the new one", lambda: broker.acknowledged == 1)
        second.close()
    finally:
        gateway.close()


def test_what_happens_to_a_node_is_published(gateway, client):
    lost = MeshEvent(MeshEventKind.NEIGHBOUR_LOST, 0, 1.0, peer=1)
    gateway.submit(lambda _now_s: gateway.internet.observe(lost))
    event = json.loads(client.next(is_topic("0/event")).payload)
    assert event == {
        "event": "neighbour lost",
        "peer": 1,
        "detail": None,
        "order": None,
        "place": None,
    }


def test_an_event_about_an_order_has_its_number_and_place(gateway, client):
    refused = MeshEvent(
        MeshEventKind.ORDER_REFUSED, 0, 1.0, 1, "battery at 9 %", 7, Location(2.0, 1.0, 3.0)
    )
    gateway.submit(lambda _now_s: gateway.internet.observe(refused))
    event = json.loads(client.next(is_topic("0/event")).payload)
    assert (event["detail"], event["order"], event["place"]) == (
        "battery at 9 %",
        7,
        [2.0, 1.0, 3.0],
    )


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("none", "No such file or directory"),
        (".", "Is a directory"),
        ("empty", "no certificate in PEM"),
    ],
)
def test_a_certificate_that_cannot_be_read_is_named_by_its_option(tmp_path, name, reason):
    (tmp_path / "empty").touch()
    broker = Broker("127.0.0.1", 8883, tls=True, mesh="field")
    with pytest.raises(ConfigurationError) as error:
        Gateway(broker, tmp_path / name)
    assert str(error.value) == f"--mqtt-ca {tmp_path / name}: {reason}"


def test_data_goes_over_tls_with_a_password(secure_broker, tmp_path):
    certificate = tmp_path / "server.pem"
    where = Broker("127.0.0.1", secure_broker.port, True, "field", "field", PASSWORD)

    def secure(client):
        client.username_pw_set("field", PASSWORD)
        client.tls_set_context(ssl.create_default_context(cafile=certificate))

    gateway = Gateway(where, certificate)
    client = Client(secure_broker.port, "drone_mesh/field/#", secure)
    try:
        assert gateway.subscribed.wait(PATIENCE_S)
        gateway.from_node_1(b"21.5")
        assert client.next(is_topic("1/rx")).payload == b"21.5"
        client.publish("drone_mesh/field/1/tx", b"blink")
        assert json.loads(client.next(is_topic("1/event")).payload)["state"] == "delivered"
    finally:
        client.close()
        gateway.close()


@pytest.mark.parametrize(
    ("password", "trusted", "reason"),
    [
        ("wrong", True, "refuses the connection: Not authorized"),
        (PASSWORD, False, "is not trusted: self"),  # "self signed" with OpenSSL 1.1
    ],
)
def test_a_broker_that_refuses_or_is_not_trusted_gives_one_line(
    secure_broker, tmp_path, caplog, password, trusted, reason
):
    where = Broker("127.0.0.1", secure_broker.port, True, "field", "field", password)
    gateway = Gateway(where, tmp_path / "server.pem" if trusted else None)
    try:
        deadline_s = time.monotonic() + PATIENCE_S
        while not any(reason in record.getMessage() for record in caplog.records):
            assert time.monotonic() < deadline_s, caplog.text
            time.sleep(0.05)
    finally:
        gateway.close()
    assert len([record for record in caplog.records if "the broker" in record.message]) == 1


def test_nothing_acknowledged_is_lost_when_the_broker_is_killed_in_mid_transfer(
    broker, gateway, client
):
    for number in range(10):
        gateway.from_node_1(b"up %d" % number)
    received = {client.next(is_topic("1/rx")).payload for _ in range(10)}
    for number in range(10):
        client.publish("drone_mesh/field/1/tx", b"down %d" % number)
    client.next(is_topic("1/event"))  # the first has arrived, others are on their way
    broker.freeze()
    for number in range(10, 20):  # the mesh acknowledges them, the broker does not
        gateway.from_node_1(b"up %d" % number)
    data = gateway.network.nodes[0].component.data
    wait_for("20 messages in the gateway", lambda: data.figures().messages_received == 20)
    broker.kill()
    broker.start()
    while len(received) < 20:
        received.add(client.next(is_topic("1/rx")).payload)
    assert received == {b"up %d" % number for number in range(20)}
    gateway.wait_for_all_at_node_1({b"down %d" % number for number in range(10)})


def test_events_take_no_room_from_messages_while_the_broker_is_away(broker, gateway, client):
    broker.stop()
    for second in range(MOST_WAITING + MOST_EVENTS):
        lost = MeshEvent(MeshEventKind.NEIGHBOUR_LOST, 1, float(second), peer=2)
        gateway.internet.observe(lost)
    gateway.from_node_1(b"21.5")
    data = gateway.network.nodes[0].component.data
    wait_for("the message", lambda: data.figures().messages_received == 1)
    broker.start()
    assert client.next(is_topic("1/event")).payload
    assert client.next(is_topic("1/rx")).payload == b"21.5"


def test_nothing_is_lost_while_the_broker_is_away(broker, gateway, client, caplog):
    for number in range(20):
        gateway.from_node_1(b"up %d" % number)
        client.publish("drone_mesh/field/1/tx", b"down %d" % number)
        if number == 5:
            broker.stop()
        if number == 12:
            broker.start()
    received = set()
    while len(received) < 20:
        received.add(client.next(is_topic("1/rx")).payload)
    assert received == {b"up %d" % number for number in range(20)}
    gateway.wait_for_all_at_node_1({b"down %d" % number for number in range(20)})
    lines = [record.message for record in caplog.records if "the broker" in record.message]
    assert len(lines) == 1, lines


def test_a_gateway_whose_internet_is_the_broker_has_none_while_it_is_away(broker):
    gateway = Gateway(Broker("127.0.0.1", broker.port, False, "field"), is_internet=True)
    component = gateway.network.nodes[0].component
    try:
        assert gateway.subscribed.wait(PATIENCE_S)
        assert component.get_connected_to_gateway()
        broker.stop()
        wait_for("no internet", lambda: not component.get_connected_to_gateway())
        broker.start()
        wait_for("internet again", component.get_connected_to_gateway)
    finally:
        gateway.close()
