"""Wire: the packets as bytes (docs/wire.md, "Packets").

Decides which types of packets exist and where their bytes lie. The bodies that belong to one
service are declared beside that service.
"""
