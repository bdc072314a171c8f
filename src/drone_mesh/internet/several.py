"""SeveralInternets: several connections of one gateway."""

from __future__ import annotations

from drone_mesh.communication.interfaces import IGatewayCommands, IInternetConnection


class SeveralInternets(IInternetConnection):
    """Connects and disconnects all its connections."""

    def __init__(self, *connections: IInternetConnection) -> None:
        self._connections = connections

    def connect(self, commands: IGatewayCommands) -> None:
        """Connect all, in order."""
        for connection in self._connections:
            connection.connect(commands)

    def disconnect(self) -> None:
        """Disconnect all."""
        for connection in self._connections:
            connection.disconnect()
