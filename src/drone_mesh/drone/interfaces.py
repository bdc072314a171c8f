"""IDroneEngine: the mesh's view of a drone (docs/protocol.md, "Interfaces")."""

from __future__ import annotations

import abc

from drone_mesh.drone.battery import LAND_AT_PERCENT
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.flight_path import FlightPath, Vector
from drone_mesh.drone.location import Location

ON_GROUND_M = 0.3


class IDroneEngine(abc.ABC):
    """The drone's position and its flights. Any thread may call every function at any time.

    A custom engine needs `set_goal` and `get_location`; the other functions have defaults that suit
    a drone that can always fly.
    """

    fence = Fence()  # of the whole mesh; whoever creates the engine sets it
    """The mesh gives it no goal outside. That its way does not lead outside is up to the engine."""

    def fences(self) -> Fence:
        """All that this drone keeps: `fence`, and what its autopilot keeps by itself."""
        return self.fence

    @abc.abstractmethod
    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        """Fly to this position (metres, world frame). Returns at once; replaces the last goal."""

    @abc.abstractmethod
    def get_location(self) -> Location:
        """The drone's position now. Raises LocationUnknown if it cannot be determined."""

    def why_not_fly(self) -> str:
        """Why the drone cannot fly to a goal now; empty if it can."""
        return ""

    def can_fly(self) -> bool:
        """Whether the drone can fly to a goal now. Override `why_not_fly` instead."""
        return not self.why_not_fly()

    def why_not_repair(self) -> str:
        """Why the drone cannot fly for a repair now, with `step_back_to`; empty if it can.

        An engine overrides this if somebody may forbid repairs and still allow ordered flights.
        """
        return self.why_not_fly()

    def why_ended(self) -> str:
        """Why the last flight ended before its goal; empty if it did not, or if not known."""
        return ""

    def is_flying(self) -> bool | None:
        """Whether a flight to a goal is under way; None: derive it from the reported positions."""
        return None

    def battery_percent(self) -> float | None:
        """The charge of its battery, 0..100; None: unknown."""
        return None

    least_percent = LAND_AT_PERCENT
    """Of its battery; with less it flies to no goal."""

    def home(self) -> Location | None:
        """Where it belongs on the ground; None: where its node has seen it first."""
        return None

    def seconds_between(self, start: Location, goal: Location) -> float:
        """How long a flight takes, about; if there is no way, how long a straight one would."""
        ends = start.to_vector(), goal.to_vector(), 0.0
        return (self.plan(*ends) or FlightPath(*ends)).duration_s

    def on_ground(self, here: Location) -> bool:
        """Whether it stands on the ground, if it is here."""
        return here.height <= ON_GROUND_M

    def step_back_to(self, latitude: float, longitude: float, height: float) -> None:
        """Fly to the position of another node, to repair the mesh; otherwise like `set_goal`.

        An engine overrides this if its repairs end differently from ordered flights, for example
        hovering instead of landing.
        """
        self.set_goal(latitude, longitude, height)

    def land_at(self, latitude: float, longitude: float, height: float) -> None:
        """Fly there and land, because the mesh is lost. Who may forbid repairs forbids this."""
        self.set_goal(latitude, longitude, height)

    def plan(self, start: Vector, goal: Vector, now_s: float) -> FlightPath | None:
        """How it would fly there, as far as known; None: not at all."""
        return FlightPath(start, goal, now_s)

    def frame_digest(self) -> int:
        """A number 1..65535 for the origin of its positions; 0: it has none.

        Nodes accept positions only from nodes with the same number.
        """
        return 0

    def close(self) -> None:  # noqa: B027 - most engines have no resources
        """Release the engine's resources. Called once, after the last other call."""
