import socket

class Transport:
    socket: socket.socket | None
    name: str
    def close(self) -> None: ...
