"""Messages to an autopilot: heartbeats, commands until they are acknowledged, targets."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.geodesy import EarthPlace
from drone_mesh.drone.mavlink.telemetry import ESTIMATE_HZ, STREAMS_HZ, Message, Telemetry

HEARTBEAT_PERIOD_S = 1.0  # required by MAVLink
ASK_STREAMS_PERIOD_S = 5.0
CARRIED_OUT_WITHIN_S = 8.0  # reports come every second, and some get lost
MOST_SERIOUS = mavlink.MAV_SEVERITY_WARNING  # of texts that are reasons; greater is less serious

POSITION_ONLY = (
    mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VZ_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
)


PERIOD_S = 1.0  # an autopilot acknowledges within tens of milliseconds
REFUSED_AFTER_S = 1.5  # the words, or the effect of a try before, may come later
MOST_WORDS = 50  # of a STATUSTEXT

TAKEN = (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS)
FAILED = (mavlink.MAV_RESULT_FAILED, 6)  # MAV_RESULT_CANCELLED; ArduPilot's dialect lacks it
LATER = mavlink.MAV_RESULT_TEMPORARILY_REJECTED


@dataclass
class PendingCommand:
    """One command, from its first try to its effect or its refusal.

    It knows what was sent and what came back; the caller sends, and sees the effect.
    """

    number: int  # of MAV_CMD
    parameters: tuple[float, ...]
    begun_s: float
    within_s: float  # the time for its effect
    once: bool  # see `is_due`
    tries: int = 0
    words: str = ""  # the autopilot's own
    sent_s: float = -math.inf
    result: int | None = None  # of the latest acknowledgement
    refused_s: float = math.inf

    @property
    def _until_s(self) -> float:
        return self.begun_s + self.within_s

    def is_due(self, now_s: float) -> bool:
        """Whether to send it now: at first, while no answer comes, and when it was put off.

        With `once` silence is no reason: the autopilot may have carried it out.
        """
        if now_s < self.sent_s + PERIOD_S or self.tries and now_s >= self._until_s:
            return False
        if self.result is None:
            return self.tries == 0 or not self.once
        return bool(self.result == LATER)

    def sent_at(self, now_s: float) -> None:
        self.tries += 1
        self.sent_s = now_s

    def acknowledged(self, result: int, now_s: float) -> None:
        """COMMAND_ACK with this MAV_RESULT."""
        ends = result in (mavlink.MAV_RESULT_ACCEPTED, *FAILED)
        if self.result in TAKEN and not (ends and self.result == mavlink.MAV_RESULT_IN_PROGRESS):
            return  # a repetition may be refused because the first try is being carried out
        self.result = result
        if result not in TAKEN and result != LATER and self.refused_s == math.inf:
            self.refused_s = now_s + REFUSED_AFTER_S

    def refusal(self, now_s: float) -> str:
        """Why the command failed: refused, or its time is over. Empty while it may succeed."""
        if now_s < min(self._until_s, self.refused_s):
            return ""
        if self.words:
            return self.words[:MOST_WORDS]
        if self.result is None:
            return f"the autopilot did not answer within {self.within_s:g} s"
        if self.result in TAKEN:
            return f"the autopilot accepted it, nothing happened for {self.within_s:g} s"
        return f"the autopilot refused: {result_name(self.result)}"


def result_name(result: int) -> str:
    entry: Any = mavlink.enums["MAV_RESULT"].get(result)
    return str(entry.name)[len("MAV_RESULT_") :].lower() if entry else f"result {result}"


class Commander:
    """Sends to the autopilot that `telemetry` listens to."""

    def __init__(self, telemetry: Telemetry, send: Callable[[Message], None]) -> None:
        """`send` passes a message to the link, which may lose it."""
        self._telemetry = telemetry
        self._send = send
        self._heartbeat_due_s = -math.inf
        self._streams_due_s = -math.inf
        self._current: PendingCommand | None = None

    def tick(self, now_s: float) -> None:
        """Send whatever is periodically due."""
        if now_s >= self._heartbeat_due_s:
            self._heartbeat_due_s = now_s + HEARTBEAT_PERIOD_S
            self._send(
                mavlink.MAVLink_heartbeat_message(
                    mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
                    mavlink.MAV_AUTOPILOT_INVALID,
                    0,
                    0,
                    mavlink.MAV_STATE_ACTIVE,
                    3,
                )
            )
        telemetry = self._telemetry
        if (
            telemetry.autopilot is not None
            and now_s >= self._streams_due_s
            and telemetry.streams_missing(now_s)
        ):
            self._streams_due_s = now_s + ASK_STREAMS_PERIOD_S
            estimate = {telemetry.autopilot.estimate_message: ESTIMATE_HZ}
            for message_id, rate_hz in {**STREAMS_HZ, **estimate}.items():
                self._send_command(
                    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (message_id, 1e6 / rate_hz)
                )

    def command(
        self,
        command: int,
        parameters: tuple[float, ...],
        now_s: float,
        within_s: float = CARRIED_OUT_WITHIN_S,
        once: bool = False,
    ) -> str:
        """Send this command until it is acknowledged; the caller stops calling at its effect.

        Returns why it is not carried out, as soon as that is known, otherwise an empty string.
        `within_s` is the time for its effect; `once`: it is repeated only if the autopilot says
        that it has not carried it out. A different command starts over.
        """
        current = self._current
        if current is None or (current.number, current.parameters) != (command, parameters):
            self._current = current = PendingCommand(command, parameters, now_s, within_s, once)
        if current.is_due(now_s):
            current.sent_at(now_s)
            self._send_command(command, parameters, confirmation=current.tries - 1)
        return current.refusal(now_s)

    def no_command(self) -> None:
        self._current = None

    def words(self) -> str:
        """The autopilot's text about the current command; empty: it sent none."""
        return "" if self._current is None else self._current.words

    def on_ack(self, message: Message, now_s: float) -> None:
        current = self._current
        if current is not None and message.command == current.number:
            current.acknowledged(message.result, now_s)

    def on_text(self, message: Message) -> None:
        """STATUSTEXT: perhaps why the autopilot refuses the current command."""
        if self._current is not None and message.severity <= MOST_SERIOUS:
            self._current.words = str(message.text)

    def target(self, place: EarthPlace) -> None:
        """Send the position to fly to now."""
        self._send(
            mavlink.MAVLink_set_position_target_global_int_message(
                0,
                *self._telemetry.sender,
                mavlink.MAV_FRAME_GLOBAL_INT,
                POSITION_ONLY,
                round(place.latitude_deg * 1e7),
                round(place.longitude_deg * 1e7),
                place.altitude_m,
                *(0.0,) * 8,
            )
        )

    def read_parameter(self, name: str) -> None:
        """Request one parameter; the answer is a PARAM_VALUE."""
        sender = self._telemetry.sender
        self._send(mavlink.MAVLink_param_request_read_message(*sender, name.encode(), -1))

    def _send_command(
        self, command: int, parameters: tuple[float, ...], confirmation: int = 0
    ) -> None:
        sender, padded = self._telemetry.sender, (*parameters, *(0.0,) * (7 - len(parameters)))
        self._send(mavlink.MAVLink_command_long_message(*sender, command, confirmation, *padded))
