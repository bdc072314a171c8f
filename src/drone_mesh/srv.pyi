"""Written by scripts/message_stubs from the files in srv/."""

from typing import Final, Sequence

from genpy import Message

from drone_mesh.msg import NRF24, Location

class AddDroneRequest(Message):
    LOWEST_FREE: Final = 255
    id: int
    gateway: bool
    latitude: float
    longitude: float
    def __init__(
        self,
        id: int = ...,
        gateway: bool = ...,
        latitude: float = ...,
        longitude: float = ...,
    ) -> None: ...

class AddDroneResponse(Message):
    success: bool
    id: int
    message: str
    def __init__(self, success: bool = ..., id: int = ..., message: str = ...) -> None: ...

class AddDrone:
    _request_class = AddDroneRequest
    _response_class = AddDroneResponse
    _md5sum = ""

class AreaScanRequest(Message):
    id: int
    def __init__(self, id: int = ...) -> None: ...

class AreaScanResponse(Message):
    near: bytes
    def __init__(self, near: bytes | Sequence[int] = ...) -> None: ...

class AreaScan:
    _request_class = AreaScanRequest
    _response_class = AreaScanResponse
    _md5sum = ""

class BroadcastRequest(Message):
    from_: int
    message: NRF24
    def __init__(self, from_: int = ..., message: NRF24 = ...) -> None: ...

class BroadcastResponse(Message):
    reached: bytes
    def __init__(self, reached: bytes | Sequence[int] = ...) -> None: ...

class Broadcast:
    _request_class = BroadcastRequest
    _response_class = BroadcastResponse
    _md5sum = ""

class CasusRequest(Message):
    caseID: int
    def __init__(self, caseID: int = ...) -> None: ...

class CasusResponse(Message): ...

class Casus:
    _request_class = CasusRequest
    _response_class = CasusResponse
    _md5sum = ""

class FlyMissionRequest(Message):
    FLY: Final = 0
    PAUSE: Final = 1
    RESUME: Final = 2
    STOP: Final = 3
    action: int
    waypoints: list[Location]
    speed: float
    loop: bool
    def __init__(
        self,
        action: int = ...,
        waypoints: Sequence[Location] = ...,
        speed: float = ...,
        loop: bool = ...,
    ) -> None: ...

class FlyMissionResponse(Message):
    success: bool
    message: str
    def __init__(self, success: bool = ..., message: str = ...) -> None: ...

class FlyMission:
    _request_class = FlyMissionRequest
    _response_class = FlyMissionResponse
    _md5sum = ""

class OrderFlightRequest(Message):
    id: int
    latitude: float
    longitude: float
    height: int
    allow_shared_place: bool
    def __init__(
        self,
        id: int = ...,
        latitude: float = ...,
        longitude: float = ...,
        height: int = ...,
        allow_shared_place: bool = ...,
    ) -> None: ...

class OrderFlightResponse(Message):
    success: bool
    message: str
    def __init__(self, success: bool = ..., message: str = ...) -> None: ...

class OrderFlight:
    _request_class = OrderFlightRequest
    _response_class = OrderFlightResponse
    _md5sum = ""

class OrderFormationRequest(Message):
    name: str
    drones: bytes
    places: list[Location]
    at_once: bool
    gateways: bytes
    def __init__(
        self,
        name: str = ...,
        drones: bytes | Sequence[int] = ...,
        places: Sequence[Location] = ...,
        at_once: bool = ...,
        gateways: bytes | Sequence[int] = ...,
    ) -> None: ...

class OrderFormationResponse(Message):
    id: int
    sent: bytes
    later: bytes
    there: bytes
    no_route: bytes
    not_in_fleet: bytes
    message: str
    def __init__(
        self,
        id: int = ...,
        sent: bytes | Sequence[int] = ...,
        later: bytes | Sequence[int] = ...,
        there: bytes | Sequence[int] = ...,
        no_route: bytes | Sequence[int] = ...,
        not_in_fleet: bytes | Sequence[int] = ...,
        message: str = ...,
    ) -> None: ...

class OrderFormation:
    _request_class = OrderFormationRequest
    _response_class = OrderFormationResponse
    _md5sum = ""

class OrderLayoutRequest(Message):
    caseID: int
    at_once: bool
    def __init__(self, caseID: int = ..., at_once: bool = ...) -> None: ...

class OrderLayoutResponse(Message):
    id: int
    sent: bytes
    later: bytes
    there: bytes
    no_route: bytes
    not_in_fleet: bytes
    message: str
    def __init__(
        self,
        id: int = ...,
        sent: bytes | Sequence[int] = ...,
        later: bytes | Sequence[int] = ...,
        there: bytes | Sequence[int] = ...,
        no_route: bytes | Sequence[int] = ...,
        not_in_fleet: bytes | Sequence[int] = ...,
        message: str = ...,
    ) -> None: ...

class OrderLayout:
    _request_class = OrderLayoutRequest
    _response_class = OrderLayoutResponse
    _md5sum = ""

class PowerSwitchRequest(Message):
    power: bool
    def __init__(self, power: bool = ...) -> None: ...

class PowerSwitchResponse(Message): ...

class PowerSwitch:
    _request_class = PowerSwitchRequest
    _response_class = PowerSwitchResponse
    _md5sum = ""

class PreviewLayoutRequest(Message):
    caseID: int
    at_once: bool
    def __init__(self, caseID: int = ..., at_once: bool = ...) -> None: ...

class PreviewLayoutResponse(Message):
    duration: float
    least_connected: float
    out_of_reach: bytes
    cut_off: bytes
    stay: bytes
    reasons: Sequence[str]
    not_in_fleet: bytes
    message: str
    def __init__(
        self,
        duration: float = ...,
        least_connected: float = ...,
        out_of_reach: bytes | Sequence[int] = ...,
        cut_off: bytes | Sequence[int] = ...,
        stay: bytes | Sequence[int] = ...,
        reasons: Sequence[str] = ...,
        not_in_fleet: bytes | Sequence[int] = ...,
        message: str = ...,
    ) -> None: ...

class PreviewLayout:
    _request_class = PreviewLayoutRequest
    _response_class = PreviewLayoutResponse
    _md5sum = ""

class RemoveDroneRequest(Message):
    id: int
    def __init__(self, id: int = ...) -> None: ...

class RemoveDroneResponse(Message):
    success: bool
    message: str
    def __init__(self, success: bool = ..., message: str = ...) -> None: ...

class RemoveDrone:
    _request_class = RemoveDroneRequest
    _response_class = RemoveDroneResponse
    _md5sum = ""

class RequestDroneFlightRequest(Message):
    ID: int
    latitude: float
    longitude: float
    height: int
    def __init__(
        self,
        ID: int = ...,
        latitude: float = ...,
        longitude: float = ...,
        height: int = ...,
    ) -> None: ...

class RequestDroneFlightResponse(Message):
    status: int
    def __init__(self, status: int = ...) -> None: ...

class RequestDroneFlight:
    _request_class = RequestDroneFlightRequest
    _response_class = RequestDroneFlightResponse
    _md5sum = ""

class RequestGPSRequest(Message): ...

class RequestGPSResponse(Message):
    latitude: float
    longitude: float
    height: int
    def __init__(
        self,
        latitude: float = ...,
        longitude: float = ...,
        height: int = ...,
    ) -> None: ...

class RequestGPS:
    _request_class = RequestGPSRequest
    _response_class = RequestGPSResponse
    _md5sum = ""

class SendDataRequest(Message):
    to: int
    port: int
    reliable: bool
    payload: bytes
    wait: float
    def __init__(
        self,
        to: int = ...,
        port: int = ...,
        reliable: bool = ...,
        payload: bytes | Sequence[int] = ...,
        wait: float = ...,
    ) -> None: ...

class SendDataResponse(Message):
    success: bool
    message: str
    ticket: int
    def __init__(self, success: bool = ..., message: str = ..., ticket: int = ...) -> None: ...

class SendData:
    _request_class = SendDataRequest
    _response_class = SendDataResponse
    _md5sum = ""

class SetSpeedRequest(Message):
    paused: bool
    real_time_factor: float
    def __init__(self, paused: bool = ..., real_time_factor: float = ...) -> None: ...

class SetSpeedResponse(Message):
    success: bool
    message: str
    def __init__(self, success: bool = ..., message: str = ...) -> None: ...

class SetSpeed:
    _request_class = SetSpeedRequest
    _response_class = SetSpeedResponse
    _md5sum = ""

class WirelessMessageRequest(Message):
    from_: int
    to: int
    message: NRF24
    def __init__(self, from_: int = ..., to: int = ..., message: NRF24 = ...) -> None: ...

class WirelessMessageResponse(Message):
    succes: bool
    def __init__(self, succes: bool = ...) -> None: ...

class WirelessMessage:
    _request_class = WirelessMessageRequest
    _response_class = WirelessMessageResponse
    _md5sum = ""

class WirelessMessagesRequest(Message):
    from_: int
    packets: bytes
    def __init__(self, from_: int = ..., packets: bytes | Sequence[int] = ...) -> None: ...

class WirelessMessagesResponse(Message):
    succes: Sequence[bool]
    def __init__(self, succes: Sequence[bool] = ...) -> None: ...

class WirelessMessages:
    _request_class = WirelessMessagesRequest
    _response_class = WirelessMessagesResponse
    _md5sum = ""

class WithdrawLayoutRequest(Message):
    id: int
    def __init__(self, id: int = ...) -> None: ...

class WithdrawLayoutResponse(Message):
    success: bool
    message: str
    def __init__(self, success: bool = ..., message: str = ...) -> None: ...

class WithdrawLayout:
    _request_class = WithdrawLayoutRequest
    _response_class = WithdrawLayoutResponse
    _md5sum = ""
