"""The settings of the radios of a mesh, equal for all of them."""

from __future__ import annotations

import enum
import functools
from dataclasses import dataclass
from typing import ClassVar

from drone_mesh.channel.access_rules import AccessRules
from drone_mesh.communication.interfaces import BROADCAST, MAX_NODE_ID, PAYLOAD_BYTES
from drone_mesh.communication.timing import Medium
from drone_mesh.errors import ConfigurationError
from drone_mesh.nrf24.registers import (
    ADDRESS_BYTES,
    ARC,
    ARD,
    AW,
    CRCO,
    EN_CRC,
    EN_DYN_ACK,
    NS_PER_S,
    PIPES,
    PRIM_RX,
    PWR_UP,
    RF_DR_HIGH,
    RF_DR_LOW,
    RF_PWR,
    SETTLING_NS,
    Register,
    frame_bits,
)

BROADCAST_PIPE = 1
OWN_PIPE = 2
_ALL_PIPES = (1 << PIPES) - 1


class DataRate(enum.Enum):
    """Bits per second on the air; lower rates have a longer range."""

    KBPS_250 = 250_000
    MBPS_1 = 1_000_000
    MBPS_2 = 2_000_000


DATA_RATES = {
    "250k": DataRate.KBPS_250,
    "1M": DataRate.MBPS_1,
    "2M": DataRate.MBPS_2,
}
DEFAULT_RATE = "250k"  # the longest range
CYCLE_S = {DataRate.KBPS_250: 2.6e-3, DataRate.MBPS_1: 1.1e-3, DataRate.MBPS_2: 0.9e-3}


def data_rate(name: str) -> DataRate:
    """The rate with this name. Raises ConfigurationError for an unknown name."""
    try:
        return DATA_RATES[name]
    except KeyError:
        known = ", ".join(DATA_RATES)
        raise ConfigurationError(f"invalid data rate {name!r}: use one of {known}") from None


class TxPower(enum.Enum):
    """Output power in dBm [DS Table 17]."""

    DBM_MINUS_18 = -18
    DBM_MINUS_12 = -12
    DBM_MINUS_6 = -6
    DBM_0 = 0


class BroadcastMode(enum.Enum):
    """How a broadcast is sent."""

    NO_ACK = "no_ack"  # an ordinary frame that requests no acknowledgement
    SHOCKBURST = "shockburst"  # a plain frame, which clones and chips without "+" understand


@dataclass(frozen=True)
class RadioSettings:
    """docs/radio.md, "Wiring and settings". All nodes of a mesh use the same values.

    `crc_bytes` is 1 for nodes of 2019 (docs/radio.md, "CRC length").

    Raises ConfigurationError for values that the chip does not support.
    """

    channel: int = 1  # 2400 + n MHz
    data_rate: DataRate = DATA_RATES[DEFAULT_RATE]
    power: TxPower = TxPower.DBM_0
    crc_bytes: int = 2
    retransmit_delay: int = 5  # ARD = (n + 1) * 250 us, while it listens; see AccessRules
    retransmits: int = 15  # ARC, while it listens
    broadcast_mode: BroadcastMode = BroadcastMode.NO_ACK
    base_address: int = 0x544D526800  # the address of a node is this plus its id
    broadcast_id: int = BROADCAST
    listening_pipes: ClassVar[int] = 1 << BROADCAST_PIPE | 1 << OWN_PIPE  # EN_RXADDR, at rest

    def __post_init__(self) -> None:
        for name, low, high in (
            ("channel", 0, 125),
            ("crc_bytes", 1, 2),
            ("retransmit_delay", 0, 15),
            ("retransmits", 0, 15),
            ("base_address", 0, (1 << 8 * ADDRESS_BYTES) - 256),
            ("broadcast_id", MAX_NODE_ID + 1, 255),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ConfigurationError(f"radio: invalid {name} {value}: must be {low}..{high}")
        if self.base_address & 0xFF:
            raise ConfigurationError(
                f"radio: invalid base_address 0x{self.base_address:X}: must end in 00"
            )
        if self.data_rate is DataRate.KBPS_250 and self.retransmit_delay < 1:
            raise ConfigurationError(
                "radio: retransmit_delay must be at least 1 (500 us) at 250 kbit/s"
            )

    def node_address(self, node_id: int) -> bytes:
        """Five bytes, LSByte first, as the chip expects them."""
        return (self.base_address + node_id).to_bytes(ADDRESS_BYTES, "little")

    @property
    def broadcast_address(self) -> bytes:
        """The address on which all nodes listen; LSByte first."""
        return self.node_address(self.broadcast_id)

    @property
    def config_listening(self) -> int:
        """CONFIG of a powered receiver."""
        return PRIM_RX.put(1, self.config_sending)

    @property
    def config_sending(self) -> int:
        """CONFIG of a powered transmitter."""
        return PWR_UP.put(1, self.config_power_down)

    @property
    def config_power_down(self) -> int:
        """CONFIG in power down; all interrupts reach the pin."""
        return EN_CRC.put(1) | CRCO.put(self.crc_bytes - 1)

    @property
    def auto_ack_pipes(self) -> int:
        """EN_AA. Sender and receiver must agree on it for each pipe, or nothing is received."""
        if self.broadcast_mode is BroadcastMode.SHOCKBURST:
            return _ALL_PIPES & ~(1 << BROADCAST_PIPE)
        return _ALL_PIPES

    @property
    def access_rules(self) -> AccessRules:
        return AccessRules.for_cycle(CYCLE_S[self.data_rate])

    @property
    def medium(self) -> Medium:
        """The properties of a channel with these settings, for the mesh."""
        return Medium.for_hop(CYCLE_S[self.data_rate])

    def registers(self, node_id: int) -> dict[Register, bytes]:
        """Every register that the driver depends on, except CONFIG: the chip has no reset.

        Pipe 0 is opened for acknowledgements while sending; pipes 3 to 5 are never opened.
        """
        rate = RF_PWR.put(sorted(p.value for p in TxPower).index(self.power.value))
        rate |= RF_DR_LOW.put(int(self.data_rate is DataRate.KBPS_250))
        rate |= RF_DR_HIGH.put(int(self.data_rate is DataRate.MBPS_2))
        plain = {
            Register.EN_AA: self.auto_ack_pipes,
            Register.EN_RXADDR: self.listening_pipes,
            Register.SETUP_AW: AW.put(ADDRESS_BYTES - 2),
            Register.SETUP_RETR: ARD.put(self.retransmit_delay) | ARC.put(self.retransmits),
            Register.RF_CH: self.channel,
            Register.RF_SETUP: rate,
            Register.RX_PW_P0: PAYLOAD_BYTES,
            Register.RX_PW_P1: PAYLOAD_BYTES,
            Register.RX_PW_P2: PAYLOAD_BYTES,
            Register.RX_PW_P3: 0,
            Register.RX_PW_P4: 0,
            Register.RX_PW_P5: 0,
            Register.DYNPD: 0,
            # A chip without "+" has no FEATURE, and plain frames need none.
            Register.FEATURE: EN_DYN_ACK.put(int(self.broadcast_mode is BroadcastMode.NO_ACK)),
        }
        return {
            **{register: bytes((value,)) for register, value in plain.items()},
            Register.RX_ADDR_P1: self.broadcast_address,
            Register.RX_ADDR_P2: self.node_address(node_id)[:1],
        }

    @functools.cached_property
    def frame_s(self) -> float:
        return frame_bits(ADDRESS_BYTES, PAYLOAD_BYTES, self.crc_bytes) / self.data_rate.value

    @functools.cached_property
    def answer_frame_s(self) -> float:
        return frame_bits(ADDRESS_BYTES, 0, self.crc_bytes) / self.data_rate.value

    @functools.cached_property
    def broadcast_s(self) -> float:
        """From the rise of CE until a broadcast has been sent."""
        return SETTLING_NS / NS_PER_S + self.frame_s

    @functools.cached_property
    def acknowledged_s(self) -> float:
        """From the rise of CE until a packet is acknowledged, without losses."""
        return 2 * SETTLING_NS / NS_PER_S + self.frame_s + self.answer_frame_s
