"""What a packet says of the train that it belongs to."""

from __future__ import annotations

import pytest

from drone_mesh.channel.trains import InTrain, place_in_train

RELAY, GATEWAY = 3, 0


def packet(kind, addressee):
    """From node 5 through node 4."""
    return bytes((5, 4, kind, RELAY, addressee)).ljust(32, b"\0")


@pytest.mark.parametrize(
    ("kind", "addressee", "place"),
    [
        (4, GATEWAY, InTrain.NO),  # a heartbeat
        (129, 254, InTrain.NO),  # to all
        (128, GATEWAY, InTrain.PERHAPS),  # the first fragment, perhaps the only one
        (129, GATEWAY, InTrain.MORE),
        (191, GATEWAY, InTrain.MORE),
        (192, GATEWAY, InTrain.LAST),  # ACK
        (193, GATEWAY, InTrain.LAST),  # POLL
        (194, GATEWAY, InTrain.LAST),  # ECHO
        (129, RELAY, InTrain.PERHAPS),  # it sends nothing on
        (193, RELAY, InTrain.PERHAPS),
    ],
)
def test_what_a_relay_learns_from_a_packet(kind, addressee, place):
    assert place_in_train(packet(kind, addressee), RELAY) is place
