"""The benchmark's cases: number of drones, spacing, speed of simulated time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drone_mesh.drone.fleet import plan_fleet
from drone_mesh.errors import ConfigurationError

FLY = "fly"  # suffix of a size on the command line


@dataclass(frozen=True)
class Case:
    """One fleet: a gateway and routers on a square grid."""

    drones: int  # the gateway included
    spacing_m: float
    real_time_factor: float = 1.0  # 0: as fast as possible
    flying: bool = False  # all drones fly during the measurement, moved by physics

    def __post_init__(self) -> None:
        """Raise ConfigurationError for a fleet that the factory would refuse."""
        plan_fleet(1, self.routers, self.gridsize, self.spacing_m)
        if not (math.isfinite(self.real_time_factor) and self.real_time_factor >= 0):
            raise ConfigurationError(
                f"invalid real-time factor {self.real_time_factor}: must be 0 or more"
            )

    @classmethod
    def parse(cls, text: str) -> Case:
        """Read DRONES/SPACING[@FACTOR][+fly], such as 100/6, 17/6@0 or 100/6+fly.

        Raises ConfigurationError for anything else.
        """
        standing, plus, word = text.partition("+")
        size, at, factor = standing.partition("@")
        drones, slash, spacing = size.partition("/")
        try:
            if not slash:
                raise ValueError("no spacing")
            if plus and word != FLY:
                raise ValueError("not a word")
            return cls(int(drones), float(spacing), float(factor) if at else 1.0, bool(plus))
        except ValueError:
            raise ConfigurationError(
                f"invalid size {text!r}: write DRONES/SPACING, such as 100/6 for 100 drones 6 m "
                "apart, or DRONES/SPACING@FACTOR, such as 17/6@0 for 17 as fast as possible; +fly "
                "after it: physics moves the drones, and all of them fly"
            ) from None

    @property
    def routers(self) -> int:
        """All drones except the gateway."""
        return self.drones - 1

    @property
    def gridsize(self) -> int:
        """Routers in a row of a square grid."""
        return max(1, math.ceil(math.sqrt(self.routers)))

    def launch_args(self) -> list[str]:
        """The arguments of factory.launch for this fleet."""
        return [
            "gateways:=1",
            f"routers:={self.routers}",
            f"gridsize:={self.gridsize}",
            f"spacing:={self.spacing_m:g}",
            f"real_time_factor:={self.real_time_factor:g}",
            *(["flight:=dynamic"] if self.flying else []),
        ]

    def __str__(self) -> str:
        speed = f", real-time factor {self.real_time_factor:g}"
        return (
            f"{self.drones} drones, {self.spacing_m:g} m"
            + (speed if self.real_time_factor != 1 else "")
            + (", all flying" if self.flying else "")
        )


FULL = tuple(map(Case.parse, ("17/6", "100/6", "100/1", "254/6", "254/1", "17/6@0", "100/6+fly")))
QUICK = tuple(map(Case.parse, ("17/6", "100/6", "17/6@0")))
SOAK = Case.parse("100/6@0")
OVERLOAD = Case.parse("254/6")
