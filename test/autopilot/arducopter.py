"""ArduCopter: ArduPilot's own flight software with a simulated airframe, a process for each drone.

Neither its source nor its binary is part of this project. docs/flying.md says how to build it.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from types import MappingProxyType
from typing import Mapping

from drone_mesh.drone.geodesy import Origin
from drone_mesh.errors import ConfigurationError

PROGRAM_VARIABLE = "ARDUCOPTER"
PARAMETERS_VARIABLE = "ARDUCOPTER_PARAMETERS"
PARAMETERS_OF_SOURCE = "Tools/autotest/default_params/copter.parm"
BASE_PORT = 5760  # of instance 0; each has ten
PILOT_PORT = 2  # SERIAL1, counted from an instance's first port
LOOPBACK = "127.0.0.1"
GCS_TIMEOUT_S = 5.0  # ArduPilot's default

SAFE: Mapping[str, float] = MappingProxyType(
    {
        "FS_GCS_ENABLE": 1.0,  # return home without the node
        "FS_THR_ENABLE": 1.0,
        "FS_EKF_ACTION": 1.0,
        "BATT_FS_LOW_ACT": 2.0,  # return home
        "BATT_CAPACITY": 20000.0,  # mAh: an hour in the air
        "FENCE_ENABLE": 1.0,
        "FENCE_ACTION": 1.0,
        "FENCE_TYPE": 3.0,  # a ceiling and a circle
        "FENCE_ALT_MAX": 100.0,
        "FENCE_RADIUS": 700.0,
        "LOG_BACKEND_TYPE": 0.0,  # no logs on this disk
    }
)
"""What docs/flying.md requires, and what a simulation on a desk needs besides."""


def program_from_environment() -> tuple[Path, Path]:
    """The binary and its parameter file. Raises ConfigurationError, which says what to set."""
    named = os.environ.get(PROGRAM_VARIABLE)
    if not named:
        raise ConfigurationError(f"{PROGRAM_VARIABLE}=/path/to/arducopter is not set")
    program = Path(named).resolve()
    if not os.access(program, os.X_OK):
        raise ConfigurationError(f"{PROGRAM_VARIABLE}={named} is not a program")
    given = os.environ.get(PARAMETERS_VARIABLE)
    of_source = [folder / PARAMETERS_OF_SOURCE for folder in program.parents]
    candidates = [Path(given).resolve()] if given else of_source
    for file in candidates:
        if file.is_file():
            return program, file
    raise ConfigurationError(
        f"{PARAMETERS_VARIABLE}=/path/to/copter.parm is needed: {PARAMETERS_OF_SOURCE} of ArduPilot"
    )


class ArduCopter:
    """One simulated copter, from its start to `close`."""

    def __init__(
        self,
        program: tuple[Path, Path],
        folder: Path,
        instance: int,
        home: Origin,
        speedup: float = 1.0,
        parameters: Mapping[str, float] = SAFE,
    ) -> None:
        """`folder` must exist; `parameters` come on top of those of ArduPilot's own tests."""
        binary, defaults = program
        self.instance = instance
        self.system_id = instance + 1
        self.home = home
        own = folder / "own.parm"
        own.write_text("".join(f"{name} {value:g}\n" for name, value in parameters.items()))
        place = f"{home.latitude_deg:.7f},{home.longitude_deg:.7f},{home.altitude_m:g},0"
        with (folder / "output.txt").open("wb") as output:
            self._process = subprocess.Popen(
                [
                    *(str(binary), "--model", "+", "--home", place, "--speedup", f"{speedup:g}"),
                    *("--wipe", "--instance", str(instance), "--sysid", str(self.system_id)),
                    *("--serial0", "tcp:0", "--defaults", f"{defaults},{own}"),
                ],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
            )

    @property
    def address(self) -> str:
        """Where the node's engine reaches it."""
        return self._address(0)

    @property
    def pilot_address(self) -> str:
        """Where its pilot's ground station reaches it."""
        return self._address(PILOT_PORT)

    @property
    def is_running(self) -> bool:
        """Whether the process lives."""
        return self._process.poll() is None

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()

    def _address(self, port: int) -> str:
        return f"tcp:{LOOPBACK}:{BASE_PORT + 10 * self.instance + port}"
