"""The states of the chip [DS 6.1, Fig. 4] and of its protocol engine [DS 7.5, Fig. 10, 11]."""

from __future__ import annotations

import enum


class State(enum.Enum):
    """The current activity of the chip."""

    POWER_DOWN = "power down"
    STARTING = "starting"  # Tpd2stby
    STANDBY_I = "standby-I"
    STANDBY_II = "standby-II"
    RX_SETTLING = "RX settling"
    RX = "RX"
    TX_SETTLING = "TX settling"
    TX = "TX"
    ACK_TURN = "turning to RX for the acknowledgement"
    ACK_WAIT = "waiting for the acknowledgement"
    RETRY_WAIT = "waiting to send again"
    ANSWER_SETTLING = "turning to TX for the acknowledgement"
    ANSWER = "sending the acknowledgement"


IDLE = frozenset((State.STANDBY_I, State.STANDBY_II, State.RX_SETTLING, State.RX))
SENDING = frozenset((State.TX_SETTLING, State.TX, State.ACK_TURN, State.ACK_WAIT, State.RETRY_WAIT))
ANSWERING = frozenset((State.ANSWER_SETTLING, State.ANSWER))
