"""TLS in front of real servers, whatever they were built with: a certificate, and a terminator that speaks TLS for a server behind it."""

from __future__ import annotations

import socket
import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

SSL_REQUEST = bytes([0, 0, 0, 8, 4, 210, 22, 47])
"""With this a client of PostgreSQL asks for TLS; the server answers S and begins with it."""


@dataclass(frozen=True)
class Certificate:
    """A certificate for ``localhost`` that is its own authority, and its key, in files."""

    pem: Path
    key: Path


def certificate(directory: Path) -> Certificate:
    directory.mkdir(exist_ok=True)
    key, now = ec.generate_private_key(ec.SECP256R1()), datetime.now(UTC)
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "localhost")])
    builder = x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number())
    builder = builder.not_valid_before(now - timedelta(days=1)).not_valid_after(now + timedelta(days=1))
    builder = builder.add_extension(x509.SubjectAlternativeName([x509.DNSName("localhost")]), critical=False)
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=None), critical=True)
    files = Certificate(directory / "server.pem", directory / "server.key")
    files.pem.write_bytes(builder.sign(key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM))
    plain = (serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    files.key.write_bytes(key.private_bytes(*plain))
    return files


@contextmanager
def tls_before(server: str | int, own: Certificate, *, postgresql: bool = False) -> Iterator[int]:
    """Yields a port of localhost that speaks TLS for the server at a Unix socket or at a port of this machine."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(own.pem, own.key)
    opened: list[socket.socket] = []

    def serve(plain: socket.socket) -> None:
        with suppress(OSError):
            if postgresql:
                if plain.recv(len(SSL_REQUEST)) != SSL_REQUEST:
                    plain.close()
                    return
                plain.sendall(b"S")
            outside = context.wrap_socket(plain, server_side=True)
            if isinstance(server, str):
                inside = socket.socket(socket.AF_UNIX)
                inside.connect(server)
            else:
                inside = socket.create_connection(("127.0.0.1", server))
            opened.extend((outside, inside))
            threading.Thread(target=_pump, args=(inside, outside), daemon=True).start()
            _pump(outside, inside)

    with socket.create_server(("127.0.0.1", 0)) as listener:

        def accept() -> None:
            with suppress(OSError):
                while True:
                    plain, _ = listener.accept()
                    opened.append(plain)
                    threading.Thread(target=serve, args=(plain,), daemon=True).start()

        threading.Thread(target=accept, daemon=True).start()
        try:
            yield int(listener.getsockname()[1])
        finally:
            listener.shutdown(socket.SHUT_RDWR)
            for one in opened:
                one.close()


def _pump(source: socket.socket, sink: socket.socket) -> None:
    with suppress(OSError):
        while data := source.recv(65536):
            sink.sendall(data)
        sink.shutdown(socket.SHUT_WR)
