"""Sends the temperature of this Pi to the gateway, every ten seconds. Needs raspberry_router."""

import time
from pathlib import Path

from drone_mesh.users import GATEWAY, Mesh

mesh = Mesh()
while True:
    millidegrees = int(Path("/sys/class/thermal/thermal_zone0/temp").read_text())
    if not mesh.write(GATEWAY, 1, b"%.1f" % (millidegrees / 1000)):
        print("not yet at the gateway; the node keeps trying")
    time.sleep(10)
