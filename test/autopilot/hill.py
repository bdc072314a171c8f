"""A hill in the simulator: the ground station serves it as terrain data."""

from __future__ import annotations

from typing import Final

from copter_rig import ORIGIN
from pilot_side import PilotSide
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.geodesy import EarthPlace
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.telemetry import Message

SPACING_M = 10  # of the heights
SQUARES_EAST = 8  # of a request, each of 4 x 4 heights; seven from south to north
SQUARES = 56
SLOPE_M = (20.0, 40.0)  # where it begins and ends, north of the origin
TOP: Final = Location(60.0, 0.0, 30.0)


def ground_m(north_m: float) -> float:
    """Height above the origin: flat, then a slope across the way north."""
    low_m, high_m = SLOPE_M
    return TOP.height * min(1.0, max(0.0, (north_m - low_m) / (high_m - low_m)))


class Hill:
    """From now on the ground rises 20 m north of the origin, for the simulator of this pilot."""

    def __init__(self, pilot: PilotSide, system_id: int) -> None:
        self._pilot = pilot
        self._ground_m: dict[tuple[int, int], float] = {}
        self._wanted = {(round(p[0] * 1e7), round(p[1] * 1e7)) for p in (ORIGIN_PLACE, TOP_PLACE)}
        pilot.set("TERRAIN_SPACING", SPACING_M)
        pilot.answer = self._answer
        often = mavlink.MAVLink_command_long_message(
            *(system_id, 1, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0),
            *(float(mavlink.MAVLINK_MSG_ID_TERRAIN_REQUEST), 1e5, 0.0, 0.0, 0.0, 0.0, 0.0),
        )
        pilot.send(often)
        pilot.until("told of the hill", self._is_known, 60.0, self._check)

    def _check(self) -> None:
        for place in self._wanted:
            self._pilot.send(mavlink.MAVLink_terrain_check_message(*place))

    def _is_known(self) -> bool:
        top = self._ground_m.get((round(TOP_PLACE[0] * 1e7), round(TOP_PLACE[1] * 1e7)), 0.0)
        return self._wanted <= set(self._ground_m) and top > ORIGIN.altitude_m + 0.9 * TOP.height

    def _answer(self, message: Message) -> None:
        if message.get_type() == "TERRAIN_REPORT" and message.spacing:
            self._ground_m[message.lat, message.lon] = message.terrain_height
        elif message.get_type() == "TERRAIN_REQUEST":
            place = EarthPlace(message.lat / 1e7, message.lon / 1e7, 0.0)
            south_m = ORIGIN.to_frame(place).latitude
            for square in range(SQUARES):
                if message.mask >> square & 1:
                    first_m = south_m + square // SQUARES_EAST * 4 * SPACING_M
                    heights = [
                        round(ORIGIN.altitude_m + ground_m(first_m + row * SPACING_M))
                        for row in range(4)
                        for _column in range(4)
                    ]
                    self._pilot.send(
                        mavlink.MAVLink_terrain_data_message(
                            message.lat, message.lon, message.grid_spacing, square, heights
                        )
                    )


ORIGIN_PLACE = ORIGIN.to_earth(Location(0.0, 0.0, 0.0))
TOP_PLACE = ORIGIN.to_earth(TOP)
