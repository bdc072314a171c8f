"""Routing techniques are chosen by name."""

from __future__ import annotations

import pytest

from drone_mesh.communication.node.node_configuration import (
    ROUTING_TECHNIQUES,
    create_routing_technique,
)
from drone_mesh.communication.routing.child_table_tree import ChildTableTree
from drone_mesh.errors import ConfigurationError


def test_each_node_gets_a_technique_of_its_own():
    one, other = (create_routing_technique("child_table_tree") for _ in range(2))
    one.can_communicate_with_node(1)
    assert other.empty()


def test_a_technique_can_be_registered_under_a_name(monkeypatch):
    class Registered(ChildTableTree):
        pass

    monkeypatch.setitem(ROUTING_TECHNIQUES, "registered", Registered)
    assert type(create_routing_technique("registered")) is Registered


def test_a_class_of_any_module_can_be_named():
    technique = create_routing_technique("routing_for_tests:ForeignTree")
    assert type(technique).__name__ == "ForeignTree"


@pytest.mark.parametrize("name", ["", "child_table_three", "ChildTableTree"])
def test_an_unknown_name_is_refused_with_a_list_of_what_is_known(name):
    with pytest.raises(ConfigurationError, match=f"technique {name!r}: use one of .*child_tab"):
        create_routing_technique(name)


@pytest.mark.parametrize(
    "name",
    [
        "no_such_module_anywhere:ForeignTree",
        "routing_for_tests:",
        ".relative:ForeignTree",
        "routing_for_tests:A_NUMBER",
        "routing_for_tests:NotRouting",
        "routing_for_tests:WantsArguments",
        "drone_mesh.communication.routing.interfaces:IRoutingTechnique",
    ],
)
def test_what_cannot_be_loaded_is_refused_by_name(name):
    with pytest.raises(ConfigurationError, match=f"routing technique '?{name}'? "):
        create_routing_technique(name)
