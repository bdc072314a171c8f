"""Runs a ConsoleServer until its process is told to stop."""

from __future__ import annotations

import asyncio
import signal

from aiohttp import web

from drone_mesh.console.server import FRAME_PERIOD_S, ConsoleServer
from drone_mesh.errors import ConfigurationError

LOOK_PERIOD_S = FRAME_PERIOD_S  # looking at a mesh more often than pages are told is of no use
SHUTDOWN_S = 1.0  # for requests that are still being answered


async def run_console(server: ConsoleServer, address: str, port: int) -> None:
    """Serve until SIGINT or SIGTERM. Raises ConfigurationError when the port cannot be had."""
    stopped = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stopped.set)
    runner = web.AppRunner(server.app, access_log=None, shutdown_timeout=SHUTDOWN_S)
    await runner.setup()
    try:
        try:
            await web.TCPSite(runner, address, port).start()
        except OSError as error:
            raise ConfigurationError(
                f"cannot listen on {address} port {port}: {error.strerror}; choose another port"
            ) from error
        await stopped.wait()
    finally:
        await runner.cleanup()
