"""The rotors of a drone in flight, as the window turns them; without a screen."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Iterator

import pybullet
import pytest

from drone_mesh.drone.roles import Role
from drone_mesh.view import window_items
from drone_mesh.view.bodies import Bodies
from drone_mesh.view.quadrocopter import MOTORS, turned_rad
from drone_mesh.view.scene import DronePicture, Shape
from drone_mesh.view.window_items import WindowItems

FLYING = DronePicture(1, Role.ROUTER, (0.0, 0.0, 5.0), path=((9.0, 0.0, 0.0),))
STANDING = DronePicture(2, Role.ROUTER, (3.0, 0.0, 0.0))


@pytest.fixture
def client() -> Iterator[int]:
    client = pybullet.connect(pybullet.DIRECT)
    yield client
    pybullet.disconnect(physicsClientId=client)


def rotors_of(client: int, body: int) -> list[tuple[tuple[float, ...], float]]:
    """Place, and angle about the vertical, of each part that turns."""
    rotors = []
    for joint in range(pybullet.getNumJoints(body, physicsClientId=client)):
        if pybullet.getJointInfo(body, joint, physicsClientId=client)[2] == pybullet.JOINT_REVOLUTE:
            place, turned = pybullet.getLinkState(body, joint, physicsClientId=client)[4:6]
            rotors.append((place, pybullet.getEulerFromQuaternion(turned)[2]))
    return rotors


def test_the_rotors_of_a_flying_drone_sit_on_its_motors_and_turn(client: int) -> None:
    bodies = Bodies(client, Shape.QUADROCOPTER)
    body = bodies.add_drone(FLYING, 2.0)
    before = rotors_of(client, body)
    bodies.turn_rotors(body, FLYING, 0.1)
    after = rotors_of(client, body)
    for (x, y), (place, _) in zip(MOTORS, after):
        assert place == pytest.approx((2 * x, 2 * y, 5.0), abs=1e-6)
    turned = [round(now - was, 3) for (_, was), (_, now) in zip(before, after)]
    assert turned == [0.9, -0.9, 0.9, -0.9]


def test_a_drone_on_the_ground_and_a_box_have_no_rotors_to_turn(client: int) -> None:
    for shape, drone in ((Shape.QUADROCOPTER, STANDING), (Shape.BOX, FLYING)):
        bodies = Bodies(client, shape)
        body = bodies.add_drone(drone, 1.0)
        bodies.turn_rotors(body, drone, 0.1)
        assert rotors_of(client, body) == []


def test_the_window_turns_them_with_each_scene(client: int, monkeypatch) -> None:
    now_s = 100.0
    monkeypatch.setattr(window_items.time, "monotonic", lambda: now_s)
    items = WindowItems(client)
    items.show([FLYING, STANDING], set(), 1.0, False, False)
    before = rotors_of(client, 0)
    now_s = 100.1
    items.show([FLYING, STANDING], set(), 1.0, False, False)
    assert len(before) == len(MOTORS)
    assert rotors_of(client, 0) != before


def test_of_many_drones_a_few_turn_with_each_scene_and_each_has_its_turn(
    client: int, monkeypatch
) -> None:
    now_s = 100.0
    monkeypatch.setattr(window_items.time, "monotonic", lambda: now_s)
    items = WindowItems(client)
    fleet = [replace(FLYING, node_id=number) for number in range(20)]
    items.show(fleet, set(), 1.0, False, False)
    still = [rotors_of(client, body) for body in range(20)]
    turned: set[int] = set()
    for scene in range(1, 4):
        now_s = 100.0 + 0.05 * scene
        before = [rotors_of(client, body) for body in range(20)]
        items.show(fleet, set(), 1.0, False, False)
        moved = {body for body in range(20) if rotors_of(client, body) != before[body]}
        assert len(moved) == window_items.TURNED_AT_ONCE
        turned |= moved
    assert turned == set(range(20))
    assert all(rotors_of(client, body) != still[body] for body in range(20))


def test_neighbouring_rotors_turn_against_each_other_and_angles_stay_small() -> None:
    angles = [turned_rad(1e6, motor) for motor in range(4)]
    assert all(abs(angle) <= 2 * math.pi for angle in angles)
    assert angles[0] == -angles[1] == angles[2] == -angles[3]
