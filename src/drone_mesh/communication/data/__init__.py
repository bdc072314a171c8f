"""Users' data: messages of up to 1,024 bytes over packets of 32 (docs/wire.md, "Data").

Decides how a message is cut, sent, acknowledged, repeated and put together again. Calls the routes
and the antenna through the node's parts; the component calls its `Transport`, and hosts fill it.
"""
