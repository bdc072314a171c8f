"""How drones move that the mesh does not steer: positions as functions of time, by seed."""

from drone_mesh.mobility.models import KINDS, tracks_of
from drone_mesh.mobility.settings import Area, Mobility
from drone_mesh.mobility.track import Segment, Track

__all__ = ["KINDS", "Area", "Segment", "Mobility", "Track", "tracks_of"]
