"""The simulated air: who is where, who hears whom (reference, section 6)."""

from drone_mesh.signal.node import Node, SignalError
from drone_mesh.signal.register import SignalRegister

__all__ = ["Node", "SignalError", "SignalRegister"]
