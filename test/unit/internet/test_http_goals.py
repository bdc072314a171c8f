"""Goals in a JSON body, in metres and in degrees."""

from __future__ import annotations

import re

import pytest

from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location

ORIGIN = Origin(52.0907, 5.1214, 3.0)


def test_a_goal_in_metres_is_sent(make_mesh):
    mesh = make_mesh()
    goal = {"latitude": 2.5, "longitude": -1.0, "height": 4}
    answer = mesh.client.post("/drones/3/goal", json=goal)
    assert answer.status_code == 200
    assert answer.json() == {"drone": 3, **goal, "earth": None}


def test_a_goal_in_degrees_arrives_in_metres_and_the_answer_has_both(make_mesh):
    mesh = make_mesh(origin=ORIGIN)
    place = ORIGIN.to_earth(Location(20.0, -15.0, 12.0))
    answer = mesh.client.post("/drones/2/goal", json=place._asdict())
    assert answer.status_code == 200
    sent = answer.json()
    assert sent["latitude"] == pytest.approx(20.0, abs=1e-4)
    assert sent["longitude"] == pytest.approx(-15.0, abs=1e-4)
    assert sent["height"] == 12
    assert sent["earth"]["latitude_deg"] == pytest.approx(place.latitude_deg, abs=1e-9)
    mesh.run_for(1.0)
    goal = mesh.network.nodes[2].drone.path.goal
    assert goal == pytest.approx((-15.0, 20.0, 12.0), abs=1e-4)


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        ({"latitude": 5001, "longitude": 0, "height": 1}, "less than or equal to 5000"),
        ({"latitude": 1, "longitude": 0}, "Field required|required"),
        ({"latitude": 1, "longitude": 0, "height": 1.5}, "integer"),
        ({"latitude": 1, "longitude": 0, "height": 1, "speed": 9}, "Extra|extra"),
    ],
)
def test_an_invalid_goal_is_refused_with_a_reason(mesh, goal, why):
    answer = mesh.client.post("/drones/1/goal", json=goal)
    assert answer.status_code == 422
    assert re.search(why, answer.json()["detail"])


def test_a_goal_in_degrees_outside_the_frame_is_refused(make_mesh):
    mesh = make_mesh(origin=ORIGIN)
    goal = {"latitude_deg": 51.9, "longitude_deg": 4.5, "altitude_m": 10.0}
    answer = mesh.client.post("/drones/1/goal", json=goal)
    assert answer.status_code == 422
    assert "outside -5000..5000 m" in answer.json()["detail"]


def test_degrees_need_an_origin(mesh):
    goal = {"latitude_deg": 52.0, "longitude_deg": 5.0, "altitude_m": 10.0}
    answer = mesh.client.post("/drones/1/goal", json=goal)
    assert answer.status_code == 409
    assert "no origin" in answer.json()["detail"]


@pytest.mark.parametrize(
    ("goal", "detail"),
    [
        ({"latitude": 1, "longitude": 0}, "height: Field required"),
        ({}, "latitude: Field required; longitude: Field required; height: Field required"),
        ({"latitude_deg": 52.0, "longitude_deg": 5.0}, "altitude_m: Field required"),
        ({"latitude": 1, "longitude": 0, "height": 701}, "height: Input should be less than or "),
    ],
)
def test_what_is_wrong_with_a_goal_is_named_once_in_the_form_that_was_begun(mesh, goal, detail):
    named = mesh.client.post("/drones/1/goal", json=goal).json()["detail"]
    assert named.startswith(detail)
    assert ";" not in named[len(detail) :]
