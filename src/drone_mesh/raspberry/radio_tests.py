"""The field tools: check a radio, scan the band, listen. Each yields lines of output."""

from __future__ import annotations

import contextlib
from typing import Callable, Iterator

from drone_mesh.communication.interfaces import BROADCAST, MAX_NODE_ID
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.nrf24.errors import RadioError
from drone_mesh.nrf24.pins import IrqPin
from drone_mesh.nrf24.registers import Register
from drone_mesh.raspberry.field_radio import TEST_TYPE, FieldRadio

Lines = Iterator[str]

SPI_ROUNDS = 500  # each writes and reads an address of five bytes
BURST = 100  # packets at full power, to make the supply dip
CHANNELS = 126
BAR = 40  # columns of a bar
SUGGESTED = 3  # channels
BAND_END = 83  # the licence-free band ends at 2483.5 MHz
WIFI = ((1, 12), (6, 37), (11, 62))  # Wi-Fi channel and its middle, as a channel of the radio
MOST_NODES = ((50, "250k"), (101, "1M"), (254, "2M"))  # docs/performance.md, "The shared channel"
_RATES_IN_WORDS = ", ".join(f"{rate} for up to {most}" for most, rate in MOST_NODES)
PATTERNS = (bytes(5), b"\xff" * 5, b"\x55" * 5, b"\xaa\x55\xaa\x55\xaa")


def check(radio: FieldRadio, irq: IrqPin | None) -> Lines:
    """Test wiring, SPI, registers, CE, supply, IRQ. Raises RadioError if the radio is unusable."""
    radio.set_up()
    yield "ok   registers: written and read back"
    radio.stand_by()  # addresses may be written in no other state
    wrong = sum(not _holds(radio, PATTERNS[n % len(PATTERNS)]) for n in range(SPI_ROUNDS))
    if wrong:
        raise RadioError(
            f"SPI: {wrong} of {SPI_ROUNDS} addresses read back wrong: use shorter wires or a lower "
            "--spi-hz"
        )
    yield f"ok   SPI: {SPI_ROUNDS} addresses written and read back"
    radio.set_up()
    radio.broadcast(_probe())
    yield "ok   CE: a packet was sent"
    for _ in range(BURST):
        radio.broadcast(_probe())
    changed = radio.changed_register()
    if changed:
        raise RadioError(
            f"supply: {changed} lost its setting while {BURST} packets were sent: solder a "
            "capacitor across the radio's supply, or use another 3.3 V supply"
        )
    yield f"ok   supply: the settings survived {BURST} packets at {radio.settings.power.value} dBm"
    if irq is None:
        yield "--   IRQ: not checked (--irq)"
    else:
        yield _check_irq(radio, irq)


def _holds(radio: FieldRadio, pattern: bytes) -> bool:
    radio.link.write(Register.TX_ADDR, pattern)
    return radio.link.read(Register.TX_ADDR, len(pattern)) == pattern


def _check_irq(radio: FieldRadio, irq: IrqPin) -> str:
    if irq.wait_low(0.0):
        return "FAIL IRQ: low although no flag is set: check its wiring"
    radio.raise_flag()
    fell = irq.wait_low(0.1)
    return (
        "ok   IRQ: falls after a packet was sent"
        if fell
        else "FAIL IRQ: never falls: check the wiring"
    )


def scan(radio: FieldRadio, rounds: int, nodes: int) -> Lines:
    """How often each channel carried a signal of more than -64 dBm, and the quietest channels.

    The last line gives the options for a mesh of this many nodes.
    """
    radio.set_up()
    heard = [0] * CHANNELS
    for _ in range(rounds):
        for channel in range(CHANNELS):
            heard[channel] += radio.hears_carrier(channel)
    radio.back_to_channel()
    for channel, count in enumerate(heard):
        bar = "#" * round(BAR * count / rounds)
        wifi = [f"Wi-Fi {number}" for number, middle in WIFI if abs(channel - middle) <= 10]
        note = f"  {wifi[0]}" if wifi and channel % 10 == 2 else ""
        yield f"{channel:3d} {2400 + channel} MHz {count / rounds:5.0%} {bar}{note}"
    quiet = quietest(heard, SUGGESTED)
    yield f"quietest in the licence-free band: {' '.join(map(str, quiet))}"
    yield f"data rate by number of nodes (a lower rate reaches further): {_RATES_IN_WORDS}"
    yield f"options for all nodes: --channel {quiet[0]} --rate {rate_for(nodes)}"


def rate_for(nodes: int) -> str:
    """The slowest rate (the longest range) at which this many nodes connect within 20 s."""
    return next(rate for most, rate in MOST_NODES if nodes <= most)


def quietest(heard: list[int], count: int) -> list[int]:
    """The channels with the least traffic around them; of equal ones, those farthest from Wi-Fi."""

    def traffic(channel: int) -> tuple[int, int]:
        near = heard[max(0, channel - 2) : channel + 3]
        from_wifi = min(abs(channel - middle) for _, middle in WIFI)
        return sum(near), -min(from_wifi, 15)

    chosen: list[int] = []
    for channel in sorted(range(1, BAND_END), key=traffic):
        if all(abs(channel - other) >= 5 for other in chosen):
            chosen.append(channel)
    return chosen[:count]


def listen(
    radio: FieldRadio,
    ended: Callable[[], bool],
    keep: Callable[[bytes], None] = lambda _payload: None,
) -> Lines:
    """Decode the packets that arrive at the broadcast address and at this node's own address.

    `keep` also gets each of them, as bytes.
    """
    radio.set_up()
    started_s = radio.runtime.now_s()
    while not ended():
        payload = radio.receive()
        if payload is None:
            radio.runtime.sleep(1e-3)
        else:
            keep(payload)
            yield f"{radio.runtime.now_s() - started_s:9.3f}  {decoded(payload)}"


_CLASSES = (
    messages.LocationMessage,
    messages.IntroduceMessage,
    messages.HeartbeatMessage,
    messages.MissingMessage,
    messages.GoToLocationMessage,
    messages.MovementNegotiationMessage,
)
_CLASS_OF = {int(kind.TYPE): kind for kind in _CLASSES}


def decoded(payload: bytes) -> str:
    creator, from_, kind, to, forward = messages.header(payload)
    with contextlib.suppress(ValueError):
        name = MessageType(kind).name
        head = f"{name} made by {creator}, from {from_} to {to}, for {forward}"
        form = _CLASS_OF.get(kind)
        if form is None:
            return head
        body = vars(form.from_payload(payload))
        fields = [f"{key} {body[key]}" for key in body if key not in _HEADER]
        return f"{head}: {', '.join(fields)}"
    return f"type {kind} made by {creator}, from {from_} to {to}, for {forward}: {payload.hex()}"


_HEADER = ("creator", "from_", "to", "forward")


def _probe() -> bytes:
    return messages.packet(TEST_TYPE, MAX_NODE_ID, MAX_NODE_ID, BROADCAST, BROADCAST)
