"""The registers of an emulated chip, and the radio settings derived from them."""

from __future__ import annotations

from drone_mesh.nrf24.emulator.frames import FrameFormat
from drone_mesh.nrf24.registers import (
    ARC,
    ARD,
    ARD_STEP_NS,
    AW,
    CRCO,
    DPL,
    EN_ACK_PAY,
    EN_CRC,
    EN_DPL,
    EN_DYN_ACK,
    ENAA,
    ERX,
    PIPES,
    PRIM_RX,
    PWR_UP,
    RESET_VALUES,
    RF_DR_HIGH,
    RF_DR_LOW,
    RF_PWR,
    STATUS_FLAGS,
    Register,
)

_WRITABLE: dict[int, int] = {
    Register.CONFIG: 0x7F,
    Register.EN_AA: 0x7F,  # bit 6 has no meaning, but silicon stores it
    Register.EN_RXADDR: 0x3F,
    Register.SETUP_AW: 0x03,
    Register.SETUP_RETR: 0xFF,
    Register.RF_CH: 0x7F,
    Register.RF_SETUP: 0xBF,
    Register.DYNPD: 0x3F,
    Register.FEATURE: 0x07,
    **{Register(Register.RX_PW_P0 + pipe): 0x3F for pipe in range(PIPES)},
}
_ADDRESSES = 0x20
_WRITABLE_BITS = [_WRITABLE.get(address, 0xFF) for address in range(_ADDRESSES)]
_WRITABLE_WITHOUT_PLUS = list(_WRITABLE_BITS)
_WRITABLE_WITHOUT_PLUS[Register.RF_SETUP] = 0x1F  # no RF_DR_LOW and no CONT_WAVE
_OF_THE_AIR = (Register.RF_CH, Register.RF_SETUP, Register.SETUP_RETR)
_TX_POWERS_DBM = (-18, -12, -6, 0)  # RF_PWR [DS Table 17]


class RegisterBank:
    """Plain registers and values derived from them; STATUS and the counters belong to the chip.

    Each write updates the derived attributes, so that the radio need not compute anything.
    """

    def __init__(self, plus: bool = True) -> None:
        self._writable = _WRITABLE_BITS if plus else _WRITABLE_WITHOUT_PLUS
        self.reset()

    def reset(self) -> None:
        # By address; unimplemented registers read as 0.
        self._values = [bytearray(1) for _ in range(_ADDRESSES)]
        for register, value in RESET_VALUES.items():
            self._values[register] = bytearray(value)
        self._derive()

    def read(self, register: int) -> bytes:
        """Its bytes, LSByte first."""
        return bytes(self._values[register])

    def write(self, register: Register, data: bytes) -> None:
        """Write the low bytes; the remaining bytes do not change."""
        value = self._values[register]
        data = data[: len(value)]
        if len(value) == 1:
            data = bytes((data[0] & self._writable[register],))
        if value[: len(data)] == data:
            return
        value[: len(data)] = data
        if register is Register.CONFIG:
            before = self.crc_bytes
            self._derive_config()
            if self.crc_bytes != before:
                self._derive_formats()
        elif register is Register.TX_ADDR:
            self._derive_tx_address()
        elif register is Register.EN_RXADDR:
            self._derive_open_pipes()
        elif register is Register.RX_ADDR_P0:
            self._derive_pipes()
        elif register in _OF_THE_AIR:
            self._derive_air()
        else:
            self._derive()

    def _byte(self, register: Register) -> int:
        return self._values[register][0]

    def _derive(self) -> None:
        self._derive_config()
        self._derive_air()
        feature = self._byte(Register.FEATURE)
        self.dynamic_lengths = bool(feature & EN_DPL.mask)
        self.ack_payloads = bool(feature & EN_ACK_PAY.mask)
        self.dynamic_ack = bool(feature & EN_DYN_ACK.mask)
        # The datasheet calls SETUP_AW 0 illegal; silicon then uses 2 bytes.
        self.address_bytes = AW.get(self._byte(Register.SETUP_AW)) + 2
        self._derive_formats()
        self._derive_pipes()
        self._derive_tx_address()

    def _derive_config(self) -> None:
        config, auto_ack = self._byte(Register.CONFIG), self._byte(Register.EN_AA) & 0x3F
        self.powered = bool(config & PWR_UP.mask)
        self.receiver = bool(config & PRIM_RX.mask)
        self.irq_sources = ~config & STATUS_FLAGS
        self.crc_bytes = 0
        if config & EN_CRC.mask or auto_ack:
            self.crc_bytes = 2 if config & CRCO.mask else 1

    def _derive_air(self) -> None:
        self.channel = self._byte(Register.RF_CH)
        setup = self._byte(Register.RF_SETUP)
        low, high = RF_DR_LOW.get(setup), RF_DR_HIGH.get(setup)
        self.rate_reserved = bool(low and high)
        self.bits_per_s = 250_000 if low else 2_000_000 if high else 1_000_000
        self.tx_dbm = _TX_POWERS_DBM[RF_PWR.get(setup)]
        retries = self._byte(Register.SETUP_RETR)
        self.ard_ns = (ARD.get(retries) + 1) * ARD_STEP_NS
        self.arc = ARC.get(retries)

    def _derive_formats(self) -> None:
        auto_ack = self._byte(Register.EN_AA)
        self.auto_ack = [bool(auto_ack & ENAA[pipe].mask) for pipe in range(PIPES)]
        dynamic = self._byte(Register.DYNPD) if self.dynamic_lengths else 0
        # [DS] asks for ENAA_Pn, too; silicon does not (docs/radio.md, "Frames on the air").
        self.dynamic = [bool(dynamic & DPL[pipe].mask) for pipe in range(PIPES)]
        self.formats: list[FrameFormat] = []  # of frames that a pipe receives
        self.ack_formats: list[FrameFormat] = []  # of its acknowledgements, which carry nothing
        for pipe in range(PIPES):  # in static mode, whatever RX_PW_Pn says
            static = self._byte(Register(Register.RX_PW_P0 + pipe))
            dynamic_length = self.dynamic[pipe]
            enhanced = self.auto_ack[pipe] or dynamic_length
            form = FrameFormat(self.address_bytes, self.crc_bytes, enhanced, None)
            self.formats.append(form if dynamic_length else form._replace(payload_bytes=static))
            self.ack_formats.append(form if dynamic_length else form._replace(payload_bytes=0))

    def _derive_tx_address(self) -> None:
        self.tx_address = bytes(self._values[Register.TX_ADDR][self.address_bytes - 1 :: -1])

    def _derive_pipes(self) -> None:
        width = self.address_bytes
        base = self._values[Register.RX_ADDR_P1]
        self.pipe_addresses: list[bytes] = []  # MSByte first
        for pipe in range(PIPES):
            value = self._values[Register.RX_ADDR_P0 + pipe]
            if pipe > 1:
                value = value + base[1:]
            self.pipe_addresses.append(bytes(value[width - 1 :: -1]))
        self._derive_open_pipes()

    def _derive_open_pipes(self) -> None:
        enabled = self._byte(Register.EN_RXADDR)
        self.pipe_of_address: dict[int, int] = {}  # of enabled pipes; the lowest pipe wins
        for pipe in reversed(range(PIPES)):
            if enabled & ERX[pipe].mask:
                self.pipe_of_address[int.from_bytes(self.pipe_addresses[pipe], "big")] = pipe

    def tx_format(self, payload_bytes: int) -> FrameFormat:
        """The format of frames that this chip transmits: pipe 0 decides [DS 7.4.2, 7.6]."""
        if self.dynamic[0]:
            return self.formats[0]
        return FrameFormat(self.address_bytes, self.crc_bytes, self.auto_ack[0], payload_bytes)
