"""Machines for workers, each with a link to Redis and one to the database that can be cut and restored.

Where this process may, a machine is a network namespace with a hostname of its own and its links are virtual cables: a cut is
silence. Elsewhere it is this machine, and the links are TCP proxies that stop passing on what they get.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from certifier.orphans import die_with_parent
from tests.workers.service import ROOT

NETWORK = "10.213.{machine}.{host}"
"""In use nowhere else, one hopes."""
REDIS, DATABASE = "redis", "database"


def namespaces_are_permitted() -> bool:
    """Whether this process may make network namespaces and cables into them."""
    probe = f"ciris-probe-{os.getpid()}"
    try:
        cable = ("link", "add", "ci-probe", "type", "veth", "peer", "name", "ci-probed", "netns", probe)
        return _ip("netns", "add", probe, check=False) == 0 and _ip(*cable, check=False) == 0
    finally:
        _ip("netns", "delete", probe, check=False)


def addresses(machines: int) -> list[str]:
    """This side's addresses of the cables, for servers to listen on; they exist once the machines do."""
    return [NETWORK.format(machine=machine, host=host) for machine in range(machines) for host in (1, 5)]


@dataclass
class Machine:
    """Where a worker runs, and how it finds the servers."""

    name: str
    prefix: list[str]
    host_of: dict[str, str]
    port_of: dict[str, int]
    links: dict[str, Cable | Proxy]
    pid: int = 0
    """The worker's, while it runs."""

    def cut(self, link: str) -> None:
        self.links[link].cut()

    def restore(self, link: str) -> None:
        self.links[link].restore()

    @contextmanager
    def worker(self, log: Path, **environment: str) -> Iterator[None]:
        """A solve worker with one process on this machine."""
        with log.open("ab") as output:
            process = subprocess.Popen(
                [*self.prefix, sys.executable, "-m", "workers", "solve"],
                cwd=ROOT,
                env={**os.environ, "CIRIS_SOLVE_PROCESSES": "1", **environment},
                stdout=output,
                stderr=output,
                preexec_fn=partial(die_with_parent, signal.SIGKILL),
            )
        self.pid = process.pid
        try:
            yield
        finally:
            process.kill()
            process.wait()


@dataclass
class Cable:
    """A pair of virtual network devices, one of them in the machine's namespace."""

    device: str

    def cut(self) -> None:
        _ip("link", "set", self.device, "down")

    def restore(self) -> None:
        _ip("link", "set", self.device, "up")


@contextmanager
def namespaces(count: int, ports: dict[str, int]) -> Iterator[list[Machine]]:
    """Machines that are network namespaces."""
    with ExitStack() as stack:
        yield [stack.enter_context(_namespace(machine, ports)) for machine in range(count)]


@contextmanager
def _namespace(machine: int, ports: dict[str, int]) -> Iterator[Machine]:
    name = f"ciris-{machine}"
    _ip("netns", "delete", name, check=False)
    _ip("netns", "add", name)
    try:
        links: dict[str, Cable | Proxy] = {}
        hosts = {}
        for link, first in ((REDIS, 1), (DATABASE, 5)):
            here, there = f"ci{machine}{link[0]}h", f"ci{machine}{link[0]}m"
            _ip("link", "delete", here, check=False)
            _ip("link", "add", here, "type", "veth", "peer", "name", there, "netns", name)
            hosts[link] = NETWORK.format(machine=machine, host=first)
            _ip("address", "add", f"{hosts[link]}/30", "dev", here)
            _ip("-netns", name, "address", "add", f"{NETWORK.format(machine=machine, host=first + 1)}/30", "dev", there)
            _ip("link", "set", here, "up")
            _ip("-netns", name, "link", "set", there, "up")
            links[link] = Cable(here)
        _ip("-netns", name, "link", "set", "lo", "up")
        enter = ["ip", "netns", "exec", name, "unshare", "--uts", "sh", "-c", f'hostname {name}; exec "$@"', "sh"]
        yield Machine(name, enter, hosts, ports, links)
    finally:
        _ip("netns", "delete", name)


def _ip(*arguments: str, check: bool = True) -> int:
    try:
        done = subprocess.run(["ip", *arguments], capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return 127
    if check and done.returncode:
        raise RuntimeError(f"ip {' '.join(arguments)}: {done.stderr}")
    return done.returncode


@contextmanager
def proxies(count: int, ports: dict[str, int]) -> Iterator[list[Machine]]:
    """Machines that are this one, with proxies for links."""
    machines = []
    for number in range(count):
        links = {name: Proxy(port) for name, port in ports.items()}
        port_of = {name: link.port for name, link in links.items()}
        machines.append(Machine(f"here-{number}", [], dict.fromkeys(ports, "127.0.0.1"), port_of, dict(links)))
    yield machines


class Proxy:
    """Passes connections on to a port of this machine, unless it is cut."""

    def __init__(self, target: int) -> None:
        self._target = target
        self._whole = threading.Event()
        self._whole.set()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        threading.Thread(target=self._accept, daemon=True).start()

    def cut(self) -> None:
        self._whole.clear()

    def restore(self) -> None:
        self._whole.set()

    def _accept(self) -> None:
        while True:
            client, _ = self._listener.accept()
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        self._whole.wait()
        with client, suppress(OSError), socket.create_connection(("127.0.0.1", self._target)) as server:
            other = {client: server, server: client}
            while True:
                ready, _, _ = select.select([client, server], [], [])
                self._whole.wait()
                for end in ready:
                    data = end.recv(65536)
                    if not data:
                        return
                    other[end].sendall(data)
