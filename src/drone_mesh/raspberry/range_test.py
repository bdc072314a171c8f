"""The range measurement: loss at each rate and power. The far end changes to the announced rate.

A node never changes its rate because of a packet. Only `answer` does, which a person starts. It
returns to its own rate when the measuring end requests it, and after `hold_s` without a packet. The
announcement and its confirmation use the rate with which both ends were started, at full power.
"""

from __future__ import annotations

import dataclasses
import struct
from typing import Callable, Iterator, NamedTuple, Sequence

from drone_mesh.communication.interfaces import PAYLOAD_BYTES
from drone_mesh.communication.wire import messages
from drone_mesh.nrf24.emulator.links import measured_losses
from drone_mesh.nrf24.errors import RadioError
from drone_mesh.nrf24.settings import DataRate, RadioSettings, TxPower
from drone_mesh.raspberry.field_radio import SWITCH_S, TEST_TYPE, FieldRadio

Lines = Iterator[str]

RETRANSMITS = 15
CONFIRM_WITHIN_S = 0.3  # a confirmation takes at most 0.09 s on the air
CHANGE_WITHIN_S = 0.5  # writing the registers takes 6 ms, on a busy machine longer
JOIN_WITHIN_S = 3.0  # seven announcements
FAILED_PACKET_S = 0.06  # 16 frames at 250 kbit/s take 48 ms
LONGEST_HOLD_S = 600

_BODY = struct.Struct("<5sBH")  # kind of request, index of the rate, hold_s
_FOLLOW, _FOLLOWING, _RETURN = b"RANGE", b"MOVED", b"ENDED"
_RATES = tuple(DataRate)


class _RateRequest(NamedTuple):
    from_: int
    what: bytes
    rate: DataRate
    hold_s: int


def measure_range(
    radio: FieldRadio,
    to: int,
    packets: int,
    distance_m: float | None = None,
    rates: Sequence[DataRate] = (),
) -> Lines:
    """CSV: packets, losses and retransmissions at each rate and power, to a node that is running.

    Rates other than that of `radio` need `answer` at the far end; raises RadioError without it.
    """
    radio.set_up()
    base = radio.settings
    partner = _Partner(radio, to, LONGEST_HOLD_S if packets > 10_000 else _hold_s(packets))
    yield "rate_kbit_s,power_dbm,packets,lost,retransmissions,loss"
    for rate in rates or (base.data_rate,):
        for power in reversed(TxPower):
            settings = dataclasses.replace(base, data_rate=rate, power=power)
            with_partner = rate is not base.data_rate
            if with_partner:
                partner.bring_to(rate)
            radio.use(settings)
            if with_partner:
                _wait_for_partner(radio, to)
            yield _measured(radio, to, packets)
            if with_partner:
                partner.send_back(rate)
    if distance_m is not None:
        losses = measured_losses()
        nearest = min(losses, key=lambda point: abs(point[0] - distance_m))
        yield (
            "# measured in 2019 (amplified modules, line of sight, 250 kbit/s) "
            f"at {nearest[0]:g} m: {nearest[1]:.4f}"
        )


def _wait_for_partner(radio: FieldRadio, to: int) -> None:
    """Send until a packet is acknowledged, for a limited time: `to` may be changing its rate."""
    until_s = radio.runtime.now_s() + CHANGE_WITHIN_S
    address, payload = radio.settings.node_address(to), _payload(radio.node_id, to)
    while radio.runtime.now_s() < until_s:
        if radio.send(address, payload, RETRANSMITS).acknowledged:
            return


def _hold_s(packets: int) -> int:
    return 2 + round(packets * FAILED_PACKET_S)


def _measured(radio: FieldRadio, to: int, packets: int) -> str:
    settings = radio.settings
    address = settings.node_address(to)
    payload = _payload(radio.node_id, to)
    sent = [radio.send(address, payload, RETRANSMITS) for _ in range(packets)]
    lost = sum(not one.acknowledged for one in sent)
    again = sum(one.frames - 1 for one in sent)
    rate = settings.data_rate.value // 1000
    return f"{rate},{settings.power.value},{packets},{lost},{again},{lost / packets:.4f}"


class _Partner:
    """The far end, as seen by the end that measures."""

    def __init__(self, radio: FieldRadio, node_id: int, hold_s: int) -> None:
        self._radio = radio
        self._id = node_id
        self._hold_s = hold_s
        self._base = radio.settings
        self._may_be_away = False

    def bring_to(self, rate: DataRate) -> None:
        """Wait until it has confirmed the change to this rate. Raises RadioError if it does not."""
        radio, runtime = self._radio, self._radio.runtime
        patience_s = JOIN_WITHIN_S + (self._hold_s if self._may_be_away else 0.0)
        until_s = runtime.now_s() + patience_s
        heard = False
        while True:
            radio.use(self._base)
            heard |= self._send(_FOLLOW, rate)
            if self._confirms(rate):  # also without an acknowledgement: that may have been lost
                self._may_be_away = True
                return
            self.send_back(rate)  # it may have changed its rate, and the confirmation was lost
            if runtime.now_s() >= until_s:
                break
        raise RadioError(self._complaint(heard, rate))

    def send_back(self, rate: DataRate) -> None:
        """Ask it to return to its own rate; if the request is lost, it does so after `hold_s`."""
        self._radio.use(dataclasses.replace(self._base, data_rate=rate))
        self._may_be_away = not self._send(_RETURN, rate)

    def _send(self, what: bytes, rate: DataRate) -> bool:
        radio = self._radio
        body = _BODY.pack(what, _RATES.index(rate), self._hold_s)
        payload = _payload(radio.node_id, self._id, body)
        address = self._base.node_address(self._id)
        return radio.send(address, payload, RETRANSMITS).acknowledged

    def _confirms(self, rate: DataRate) -> bool:
        runtime = self._radio.runtime
        until_s = runtime.now_s() + CONFIRM_WITHIN_S
        while runtime.now_s() < until_s:
            request = _request_in(self._radio.receive(), self._radio.node_id)
            if request and (request.from_, request.what) == (self._id, _FOLLOWING):
                return request.rate is rate
            runtime.sleep(1e-3)
        return False

    def _complaint(self, heard: bool, rate: DataRate) -> str:
        base = self._base.data_rate.value // 1000
        there = f"raspberry_radio --id {self._id} answer"
        if not heard:
            return (
                f"no answer from node {self._id} at {base} kbit/s: start '{there}' at the far end, "
                "with the same --channel and --rate, or move closer"
            )
        return (
            f"node {self._id} does not follow to {rate.value // 1000} kbit/s: at the far end, run "
            f"'{there}' in place of the node; a chip without '+' lacks 250 kbit/s"
        )


def answer(radio: FieldRadio, ended: Callable[[], bool]) -> Lines:
    """The far end of `measure_range`: acknowledge what arrives, and follow announced rates."""
    radio.set_up()
    base, runtime = radio.settings, radio.runtime
    yield f"node {radio.node_id} answers at {_kbit_s(base)}; Ctrl-C ends it"
    hold_s, silent_at_s = 0.0, float("inf")
    while not ended():
        payload = radio.receive()
        if payload is None:
            if runtime.now_s() >= silent_at_s:
                silent_at_s = float("inf")
                radio.use(base)
                yield f"nothing heard for {hold_s:g} s: back at {_kbit_s(base)}"
            runtime.sleep(1e-3)
            continue
        if radio.settings is not base:
            silent_at_s = runtime.now_s() + hold_s
        request = _request_in(payload, radio.node_id)
        if request is None:
            continue
        runtime.sleep(SWITCH_S)  # or its acknowledgement would be cut off
        if request.what == _RETURN and radio.settings is not base:
            silent_at_s = float("inf")
            radio.use(base)
        elif request.what == _FOLLOW and radio.settings is base:
            hold_s = min(request.hold_s, LONGEST_HOLD_S)
            said = _follow(radio, request)
            silent_at_s = float("inf") if radio.settings is base else runtime.now_s() + hold_s
            yield said


def _follow(radio: FieldRadio, request: _RateRequest) -> str:
    """Confirm, and change to the rate; keep the present one if the chip does not support it."""
    base = radio.settings
    there = dataclasses.replace(base, data_rate=request.rate)
    try:
        radio.use(there)
    except RadioError as error:
        radio.use(base)
        return f"node {request.from_} asked for {_kbit_s(there)}: {error}"
    radio.use(base)
    body = _BODY.pack(_FOLLOWING, _RATES.index(request.rate), request.hold_s)
    payload = _payload(radio.node_id, request.from_, body)
    radio.send(base.node_address(request.from_), payload, RETRANSMITS)
    radio.use(there)  # also without an acknowledgement: it may have been lost
    return f"node {request.from_} measures at {_kbit_s(there)}"


def _request_in(payload: bytes | None, me: int) -> _RateRequest | None:
    """The request in a packet of the measurement; None: another packet, or not for `me`."""
    if payload is None or len(payload) != PAYLOAD_BYTES:
        return None
    _, from_, kind, to, _ = messages.header(payload)
    what, rate, hold_s = _BODY.unpack_from(payload, messages.HEADER_BYTES)
    if kind != TEST_TYPE or to != me or rate >= len(_RATES):
        return None
    if what not in (_FOLLOW, _FOLLOWING, _RETURN):
        return None
    return _RateRequest(from_, what, _RATES[rate], hold_s)


def _payload(from_: int, to: int, body: bytes = b"") -> bytes:
    return messages.packet(TEST_TYPE, from_, from_, to, to, body)


def _kbit_s(settings: RadioSettings) -> str:
    return f"{settings.data_rate.value // 1000} kbit/s"
