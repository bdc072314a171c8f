"""Inquiries: requests of a ground station that do not move the vehicle."""

from __future__ import annotations

import math
from typing import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.mavlink.telemetry import Message
from drone_mesh.drone.mavlink_vehicle.parameters import Parameters
from drone_mesh.drone.mavlink_vehicle.reports import Reports


class Inquiries:
    """Answers these requests through `send`."""

    def __init__(
        self,
        reports: Reports,
        parameters: Parameters,
        send: Callable[[Message], None],
        now_s: Callable[[], float],
    ) -> None:
        self._reports = reports
        self._parameters = parameters
        self._send = send
        self._now_s = now_s

    def set_interval(self, message: Message) -> int:
        """Handle MAV_CMD_SET_MESSAGE_INTERVAL; returns a MAV_RESULT, as all commands do."""
        if not math.isfinite(message.param1):
            return int(mavlink.MAV_RESULT_DENIED)
        known = self._reports.set_interval(int(message.param1), message.param2)
        return int(mavlink.MAV_RESULT_ACCEPTED if known else mavlink.MAV_RESULT_UNSUPPORTED)

    def request_message(self, message: Message) -> int:
        """MAV_CMD_REQUEST_MESSAGE."""
        if not math.isfinite(message.param1):
            return int(mavlink.MAV_RESULT_DENIED)
        if message.param1 == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            return self.report_capabilities(message)
        answer = self._reports.make(int(message.param1))
        if answer is None:
            return int(mavlink.MAV_RESULT_UNSUPPORTED)
        self._send(answer)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def report_capabilities(self, _message: Message) -> int:
        """MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES."""
        capabilities = (
            mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
            | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
        )
        self._send(
            mavlink.MAVLink_autopilot_version_message(
                capabilities, 0x01000000, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0
            )
        )
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def take_parameter_request(self, message: Message) -> None:
        """PARAM_REQUEST_READ."""
        names = self._parameters.names()
        if 0 <= message.param_index < len(names):
            self._send(self._parameters.message(names[message.param_index]))
        elif message.param_id in self._parameters:
            self._send(self._parameters.message(message.param_id))

    def take_parameter_list_request(self, _message: Message) -> None:
        """PARAM_REQUEST_LIST."""
        for name in self._parameters.names():
            self._send(self._parameters.message(name))

    def take_parameter(self, message: Message) -> None:
        """PARAM_SET."""
        if message.param_id in self._parameters and math.isfinite(message.param_value):
            self._parameters.take(message.param_id, message.param_value)
            self._send(self._parameters.message(message.param_id))

    def take_timesync(self, message: Message) -> None:
        """TIMESYNC."""
        if message.tc1 == 0:
            self._send(mavlink.MAVLink_timesync_message(int(self._now_s() * 1e9), message.ts1))
