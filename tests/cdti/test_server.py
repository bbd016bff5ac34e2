"""A flood of connections costs a line in the terminal, and the display stays."""

import asyncio
import errno
import resource
import socket

import pytest

from components.cdti import server as server_module
from components.cdti.page import Admission
from components.cdti.server import MOST_CONNECTIONS, ConnectionLimit, DisplayServer
from tests.support.waiting import WAIT_S, wait_for


class NoControl:
    def on_operators(self, count):
        pass


@pytest.fixture
def served(monkeypatch):
    said = []
    monkeypatch.setattr(server_module, "say", lambda text, err=False: said.append(text))
    admission = Admission()
    server = DisplayServer("127.0.0.1", 0, admission, NoControl())
    server.start()
    yield server, admission, said
    server.close({"type": "over"})


def page_of(server, admission):
    """What a browser is answered, or nothing while there is no room."""
    host, port = server.host_and_port.split(":")
    with socket.create_connection((host, int(port)), timeout=WAIT_S) as browser:
        browser.sendall(f"GET /?token={admission.token} HTTP/1.1\r\nHost: {host}:{port}\r\n"
                        "Connection: keep-alive\r\n\r\n".encode())  # fmt: skip
        try:
            return browser.recv(15)
        except ConnectionError:
            return b""


def flood(server, count):
    host, port = server.host_and_port.split(":")
    return [socket.create_connection((host, int(port)), timeout=WAIT_S) for _ in range(count)]


def test_connections_beyond_the_limit_are_dropped_and_places_come_back(served, capfd):
    server, admission, said = served
    some = flood(server, MOST_CONNECTIONS + 20)
    wait_for(lambda: said)
    assert page_of(server, admission) == b"" and len(said) == 1
    assert f"more than {MOST_CONNECTIONS} connections" in said[0]
    for one in some:
        one.close()
    assert wait_for(lambda: page_of(server, admission)) == b"HTTP/1.1 200 OK"
    assert len(said) == 1 and capfd.readouterr().err == ""


def test_a_flood_beyond_the_limit_of_open_files_is_one_line(served, capfd):
    """The limit counts the clients of this process too: they are opened before it is lowered."""
    server, admission, said = served
    host, port = server.host_and_port.split(":")
    clients = [socket.socket() for _ in range(40)]
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (clients[-1].fileno() + 5, hard))
    try:
        for client in clients:
            client.connect((host, int(port)))
        wait_for(lambda: said)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    for client in clients:
        client.close()
    assert len(said) == 1 and "files may be open" in said[0]
    assert "Traceback" not in capfd.readouterr().err
    assert wait_for(lambda: page_of(server, admission)) == b"HTTP/1.1 200 OK"


@pytest.mark.parametrize("flooded", [True, False])
def test_listening_again_after_the_end_of_a_flood_is_silent(flooded, caplog):
    """Loops do a second after files ran out, also to a socket that has been closed meanwhile."""
    said = []
    closed = socket.socket()
    closed.close()
    loop = asyncio.new_event_loop()
    loop.set_exception_handler(ConnectionLimit(said.append).on_error)
    if flooded:
        loop.call_exception_handler({"message": "", "exception": OSError(errno.EMFILE, "")})
    loop.call_soon(loop.add_reader, closed, print)
    loop.run_until_complete(asyncio.sleep(0.01))
    loop.close()
    assert len(said) == flooded
    assert ("Invalid file descriptor" in caplog.text) is not flooded
