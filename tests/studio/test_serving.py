"""The page's host: who may speak to it, and what it does with what it is told."""

import json
import struct
import urllib.error
import urllib.request

import pytest
from served import serving

from jaxclay.clay.clay import Clay


@pytest.fixture(scope="module")
def host(ready):
    with serving(ready, Clay.cylinder(0.36)) as found:
        yield found


def fetched(host, path, **headers):
    request = urllib.request.Request(host.address.rstrip("/") + path, headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=10) as answer:
            return answer.status, answer.headers, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.headers, error.read()


def packed(data, *buffers):
    text = json.dumps(data | {"sizes": [len(b) for b in buffers]}).encode()
    return struct.pack("<I", len(text)) + text + b"".join(buffers)


def unpacked(frame):
    (length,) = struct.unpack_from("<I", frame)
    return json.loads(frame[4 : 4 + length])


def connected(host, **more):
    from websockets.sync.client import connect

    address = host.address.replace("http", "ws") + "socket"
    return connect(
        address, origin=more.pop("origin", host.address.rstrip("/")), max_size=None, **more
    )


def asked(socket, data, *buffers):
    """The first answer of a custom message."""
    socket.send(packed(data, *buffers))
    while (answer := unpacked(socket.recv(timeout=20)))["method"] != "custom":
        pass
    return answer["content"]


def test_it_serves_its_page_from_this_machine_alone(host):
    assert host.address.startswith("http://127.0.0.1:")
    status, headers, body = fetched(host, "/")
    assert status == 200
    assert b"<title>jaxclay studio</title>" in body
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    for path in ("/studio.js", "/page.js"):
        status, headers, body = fetched(host, path)
        assert (status, headers["Content-Type"].split(";")[0]) == (200, "text/javascript")
        assert b"http://" not in body.replace(b"http://www.w3.org", b"")
        assert b"https://" not in body


@pytest.mark.parametrize(
    "path", ["/nothing", "/../pyproject.toml", "/static/studio.js", "/host.py"]
)
def test_unknown_paths_are_refused(host, path):
    assert fetched(host, path)[0] == 404


def test_another_name_in_host_is_refused(host):
    assert fetched(host, "/", Host="evil.example")[0] == 403


@pytest.mark.parametrize("origin", [None, "http://evil.example", "null", "http://127.0.0.1:1"])
def test_a_foreign_origin_opens_no_socket(host, origin):
    from websockets.exceptions import InvalidStatus

    with pytest.raises(InvalidStatus, match="403"), connected(host, origin=origin):
        pass


def test_a_tab_is_told_the_settings_and_shapes_the_piece(host):
    with connected(host) as socket:
        opened = unpacked(socket.recv(timeout=20))
        assert opened["method"] == "open"
        assert {"k", "mu", "alpha", "beta", "prepared"} <= set(opened["state"])
        told = asked(
            socket, {"method": "custom", "content": {"type": "undo", "view": "t", "id": 1}}
        )
        assert (told["type"], told["view"], told["id"]) == ("shape", "t", 1)


GARBAGE = [
    b"", b"\0", b"\xff\xff\xff\xff{}", "text", packed({}), packed({"method": "custom"}),
    packed({"method": "destroy", "content": {}}), packed({"method": "custom", "content": [1]}),
    packed({"method": "custom", "content": {"type": 3}}),
    struct.pack("<I", 60_000) + b"[" * 60_000,
    packed({"method": "update", "state": {"_esm": "alert(1)"}}),
    packed({"method": "update", "state": {"k": -1}}),
    packed({"method": "update", "state": {"k": "soft"}}),
    packed({"method": "update", "state": {"mu": 10**400}}),
    packed({"method": "update", "state": {"alpha": float("nan")}}),
    packed({"method": "update", "state": {"slices": 7}, "buffer_paths": [["slices"]]}),
]  # fmt: skip


@pytest.mark.parametrize("frame", GARBAGE, ids=range(len(GARBAGE)))
def test_garbage_is_refused_and_costs_nothing(host, frame):
    clay, before = host.studio.clay, host.studio.modeller.material
    with connected(host) as socket:
        socket.recv(timeout=20)
        socket.send(frame)
        while (answer := unpacked(socket.recv(timeout=20)))["method"] != "custom":
            pass
        assert answer["content"]["type"] == "refused"
        again = {"method": "custom", "content": {"type": "hello", "view": "g", "id": 1}}
        assert asked(socket, again)["type"] == "state"
    assert host.studio.clay is clay
    assert host.studio.modeller.material == before
    assert "class Studio" in str(host.studio._esm)


def test_a_huge_message_ends_its_socket_alone(host):
    from websockets.exceptions import ConnectionClosed

    clay = host.studio.clay
    with connected(host) as socket:
        socket.recv(timeout=20)
        socket.send(b"x" * (17 * 2**20))
        with pytest.raises(ConnectionClosed):
            socket.recv(timeout=20)
    with connected(host) as socket:
        assert unpacked(socket.recv(timeout=20))["method"] == "open"
    assert host.studio.clay is clay


def test_settings_reach_python_and_come_back(host):
    with connected(host) as socket, connected(host) as other:
        for tab in (socket, other):
            tab.recv(timeout=20)
        socket.send(packed({"method": "update", "state": {"mu": 0.5}}))
        asked(socket, {"method": "custom", "content": {"type": "hello", "view": "s", "id": 1}})
        assert float(host.studio.modeller.material.mu) == 0.5
        host.studio.mu = 2.0
        while (told := unpacked(other.recv(timeout=20))).get("state", {}).get("mu") != 2.0:
            assert told["method"] in ("update", "echo_update", "custom")
