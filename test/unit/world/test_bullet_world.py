"""BulletWorld: time, bodies, several worlds."""

from __future__ import annotations

import pybullet
import pytest

from drone_mesh.world.bullet_world import BulletWorld


@pytest.fixture
def world():
    with BulletWorld() as world:
        yield world


class Countdown:
    """Wants so many turns."""

    def __init__(self, turns):
        self.left, self.times = turns, []

    def step(self, now_s):
        self.left -= 1
        self.times.append(now_s)
        return self.left > 0


def place_of(world, body):
    return pybullet.getBasePositionAndOrientation(body, physicsClientId=world.client)[0]


def test_a_step_is_ten_milliseconds_and_time_does_not_drift(world):
    assert world.step() == 0.01
    for _ in range(29_999):
        now_s = world.step()
    assert now_s == 300.0 == world.now_s


def test_a_woken_engine_gets_one_turn_in_each_step_until_it_rests(world):
    mover = Countdown(3)
    world.wake(mover)
    world.wake(mover)
    for _ in range(10):
        world.step()
    assert mover.times == [0.01, 0.02, 0.03]


def test_movers_take_their_turns_in_the_order_of_waking(world):
    turns = []

    class Named:
        def __init__(self, name):
            self.name = name

        def step(self, now_s):
            turns.append(self.name)
            return True

    for name in "cab":
        world.wake(Named(name))
    world.step()
    world.step()
    assert turns == list("cabcab")


def test_a_box_stays_where_it_is_put_however_long_gravity_pulls(world):
    box = world.add_box((0.2, 0.2, 0.1), (1.0, 2.0, 3.0))
    for _ in range(200):
        world.step()
    assert place_of(world, box) == (1.0, 2.0, 3.0)
    world.move_box(box, (4.0, 5.0, 6.0))
    world.step()
    assert place_of(world, box) == (4.0, 5.0, 6.0)


def test_a_loose_body_falls_and_comes_to_rest_on_the_ground(world):
    body = world.add_body((0.2, 0.2, 0.2), (0.0, 0.0, 5.0), 1.0)
    for _ in range(50):
        world.step()
    fallen_m = 9.81 / 2 * 0.5**2
    assert place_of(world, body)[2] == pytest.approx(5 - fallen_m, abs=0.05)
    for _ in range(350):
        world.step()
    assert place_of(world, body)[2] == pytest.approx(0.1, abs=0.01)


def test_two_worlds_are_independent_of_each_other(world):
    with BulletWorld() as other:
        here = world.add_box((1.0, 1.0, 1.0), (1.0, 1.0, 1.0))
        there = other.add_box((1.0, 1.0, 1.0), (2.0, 2.0, 2.0))
        world.step()
        assert (world.now_s, other.now_s) == (0.01, 0.0)
        assert place_of(world, here) == (1.0, 1.0, 1.0)
        assert place_of(other, there) == (2.0, 2.0, 2.0)


def test_closing_twice_changes_nothing(world):
    world.close()
    world.close()


def test_physics_computes_only_while_there_is_a_body_that_it_moves(world, monkeypatch):
    computed, step = [], pybullet.stepSimulation
    monkeypatch.setattr(
        pybullet, "stepSimulation", lambda **how: (computed.append(world.now_s), step(**how))
    )
    box = world.add_box((0.2, 0.2, 0.1), (0.0, 0.0, 0.05))
    world.step()
    body = world.add_body((0.2, 0.2, 0.1), (5.0, 0.0, 5.0), 1.0)
    world.step()
    world.step()
    world.move_box(box, (0.0, 0.0, 1.0))
    assert place_of(world, box) == (0.0, 0.0, 1.0)
    assert place_of(world, body)[2] < 5.0
    world.remove_box(body)
    world.step()
    assert computed == [0.02, 0.03]
