"""Names in the ROS graph."""

from __future__ import annotations

import pytest

from drone_mesh.errors import ConfigurationError
from drone_mesh.ros.graph.names import check_namespace


@pytest.mark.parametrize("namespace", ["", "/", "site_a", "/site_a/", "a/01", "a//b"])
def test_a_simulation_runs_in_any_valid_namespace(namespace):
    check_namespace(namespace)


@pytest.mark.parametrize("namespace", ["site-a", "01", "site a", "/01/", "_a", "\u00fc"])
def test_a_namespace_in_which_antennas_could_not_listen_is_refused(namespace):
    with pytest.raises(ConfigurationError, match="begin with a letter"):
        check_namespace(namespace)
