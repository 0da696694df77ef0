"""A studio served in a thread, so that tests see the page and Python's side of it."""

import asyncio
import contextlib
import threading
from types import SimpleNamespace

import pytest


@contextlib.contextmanager
def serving(ready, *given, **more):
    """The host, at ``address``, with its widget once it is there."""
    comm = pytest.importorskip("comm")
    pytest.importorskip("anywidget")
    pytest.importorskip("websockets")
    from jaxclay.studio.host import Host
    from jaxclay.studio.widget import Studio

    found, started, made, ended = SimpleNamespace(), threading.Event(), threading.Event(), []
    before = comm.create_comm

    def make():
        ready.run()  # where another test has let go of what was compiled
        found.studio = Studio(*given, compilations=ready, **more)
        made.set()
        return found.studio

    async def run():
        found.stop = asyncio.get_running_loop().call_soon_threadsafe
        serving = asyncio.ensure_future(Host(make, found.port).run(tell))
        ended.append(serving)
        with contextlib.suppress(asyncio.CancelledError):
            await serving

    def tell(address):
        found.address = address
        found.port = int(address.rsplit(":", 1)[1].strip("/"))
        started.set()

    found.port = more.pop("port", 0)
    thread = threading.Thread(target=lambda: asyncio.run(run()))
    thread.start()
    try:
        assert started.wait(20)
        assert made.wait(60)
        yield found
    finally:
        found.stop(ended[0].cancel)
        thread.join(20)
        comm.create_comm = before
        assert not thread.is_alive()
