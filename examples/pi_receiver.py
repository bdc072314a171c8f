"""Prints what the Pis measure. Needs raspberry_gateway, on this Pi."""

import time

from drone_mesh.users import Mesh

for message in Mesh().read(type=1):
    print(f"{time.strftime('%H:%M:%S')} node {message.node}: {message.data.decode()}", flush=True)
