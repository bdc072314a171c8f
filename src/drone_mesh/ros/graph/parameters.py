"""The private parameters of our nodes: launch arguments override the file in ~config."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Callable, TypeVar

import rospkg
import rospy

from drone_mesh.air.obstacle_file import read_obstacles
from drone_mesh.air.obstacles import Obstacles
from drone_mesh.configuration import FactoryConfiguration, load_configuration
from drone_mesh.errors import ConfigurationError
from drone_mesh.layouts import Layouts

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
    given = {key: rospy.get_param(f"~{key}", "") for key in keys}
    return load_configuration(file_parameter("config", "factory.yaml"), given)


def configured_obstacles(configuration: FactoryConfiguration) -> Obstacles | None:
    """The boxes that the configuration names, or None. Raises ConfigurationError."""
    path = configuration.obstacles
    if not path:
        return None
    if not Path(path).expanduser().is_absolute():  # roslaunch starts nodes in another folder
        raise ConfigurationError(
            f"invalid obstacles {path!r}: expected an absolute path, such as $PWD/{path}"
        )
    return read_obstacles(Path(path).expanduser(), configuration.obstacle_radio == "block")


def manager_layouts() -> Layouts:
    """The layouts of the DroneManager, from the file in its parameter.

    Raises ConfigurationError.
    """
    given = str(rospy.get_param("/DroneManager/casus", ""))
    return Layouts.load(given or file_parameter("casus", "casus.yaml"))


def file_parameter(name: str, default: str) -> Path:
    """The file in parameter `name`; by default `default` in the package's config folder."""
    given = str(rospy.get_param(f"~{name}", ""))
    if given:
        return Path(given).expanduser()
    try:
        return Path(rospkg.RosPack().get_path(PACKAGE)) / "config" / default
    except rospkg.ResourceNotFound:
        raise ConfigurationError(
            f"package {PACKAGE} is not on ROS_PACKAGE_PATH; source its setup.bash, or set ~{name}"
        ) from None
