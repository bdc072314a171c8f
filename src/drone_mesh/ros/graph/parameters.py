"""The private parameters of our nodes: launch arguments override the file in ~config."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Callable, TypeVar

import rospkg
import rospy
from std_msgs.msg import String

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError, naming_argument
from drone_mesh.fence_file import areas_json, fence_in, rows_of_file
from drone_mesh.formations.layouts import Layouts
from drone_mesh.formations.missions import Mission, read_missions
from drone_mesh.ros.graph import names

if TYPE_CHECKING:  # it loads all routing techniques
    from drone_mesh.configuration import FactoryConfiguration

PACKAGE = "drone_mesh"

Result = TypeVar("Result")


def or_exit(read: Callable[[], Result]) -> Result:
    """The result of `read`; on a ConfigurationError, print its one line and exit with code 1."""
    try:
        return read()
    except ConfigurationError as error:
        sys.exit(f"{rospy.get_name()}: {error}")


def factory_configuration(*keys: str) -> FactoryConfiguration:
    """The configuration file, overridden by those private parameters in `keys` that are set.

    Raises ConfigurationError.
    """
    from drone_mesh.configuration import load_configuration

    private = rospy.get_param("~", {})  # one call of the master instead of fifty
    given = {key: private.get(key, "") for key in keys}
    return _read("~config", "factory.yaml", lambda path: load_configuration(path, given))


def configured_obstacles(configuration: FactoryConfiguration) -> Obstacles | None:
    """The boxes and the fence that the configuration names; None without any of both.

    A fence in degrees needs the origin of the simulation. Raises ConfigurationError.
    """
    blocks = configuration.obstacle_radio == "block"

    def read_boxes(path: Path) -> Obstacles:
        from drone_mesh.air.obstacle_file import read_obstacles  # a library that nothing else needs

        return read_obstacles(path, blocks)

    boxes = _read_named_file("obstacles", configuration.obstacles, read_boxes)
    fence = fence_in(fence_areas(configuration))
    if not fence:
        return boxes
    cruise_m = configuration.cruise_height
    return replace(boxes or Obstacles(()), fence=fence, cruise_m=cruise_m)


def fence_areas(configuration: FactoryConfiguration) -> str:
    """The areas of the fence as JSON: those of the configuration, or what they were changed to.

    Raises ConfigurationError.
    """
    changed = str(rospy.get_param(names.FENCE_PARAM, ""))
    read = _read_named_file(
        "fence",
        "" if changed else configuration.fence,
        lambda path: rows_of_file(path, earth_origin("")),
    )
    return changed or areas_json(read or ())


def told_fence(told: String) -> Fence | None:
    """The fence that the drone manager tells; None: it tells what held in an earlier world."""
    return fence_in(told.data) if told.data == rospy.get_param(names.FENCE_PARAM, "") else None


def configured_missions(configuration: FactoryConfiguration) -> dict[int, Mission]:
    """The missions that the configuration names, by drone. Raises ConfigurationError."""
    return (
        _read_named_file(
            "missions",
            configuration.missions,
            lambda path: read_missions(path, earth_origin("")),
        )
        or {}
    )


def _read_named_file(key: str, given: str, read: Callable[[Path], Result]) -> Result | None:
    """Read the file that this key names; None if it names none. Raises ConfigurationError."""
    if not given:
        return None
    path = Path(given).expanduser()
    if not path.is_absolute():  # roslaunch starts nodes in another folder
        raise ConfigurationError(
            f"invalid {key} {given!r}: expected an absolute path, such as $PWD/{given}"
        )
    with naming_argument(f"{key}: ", path):
        return read(path)


def manager_layouts(parameter: str = names.LAYOUTS_PARAM) -> Layouts:
    """The layouts of the DroneManager, from the file in this parameter.

    Raises ConfigurationError.
    """
    return _read(parameter, "casus.yaml", Layouts.load)


def earth_origin(given: str, is_live: bool = True) -> Origin | None:
    """Where x 0, y 0 is on the earth: as given, or as the running simulation says (`is_live`).

    None: nowhere. Raises ConfigurationError.
    """
    text = given or (str(rospy.get_param(names.ORIGIN_PARAM, "")) if is_live else "")
    if not text:
        return None
    with naming_argument("origin:=", "origin"):
        origin = Origin.parse(text)
    try:
        origin.to_earth(Location(0.0, 0.0, 0.0))
    except ImportError as error:
        raise ConfigurationError(
            f"an origin needs the Python package {error.name}: pip install {error.name}"
        ) from error
    return origin


def _read(parameter: str, default: str, read: Callable[[Path], Result]) -> Result:
    """Read the file in this parameter, by default `default` in the package's config folder.

    Raises ConfigurationError, which names the argument if there is one.
    """
    argument = f"{parameter.lstrip('~').rpartition('/')[2]}:="
    given = str(rospy.get_param(parameter, ""))
    if not given:
        return read(_in_package(default, argument))
    path = Path(given).expanduser()
    if not path.is_absolute() and not path.exists():
        raise ConfigurationError(
            f"{argument}{given}: no such file in {Path.cwd()}, where this program runs; "
            f"give an absolute path, such as $PWD/{given}"
        )
    with naming_argument(argument, path):
        return read(path)


def _in_package(file: str, argument: str) -> Path:
    try:
        return Path(rospkg.RosPack().get_path(PACKAGE)) / "config" / file
    except rospkg.ResourceNotFound:
        raise ConfigurationError(
            f"package {PACKAGE} is not on ROS_PACKAGE_PATH; source its setup.bash, or set "
            f"{argument}"
        ) from None
