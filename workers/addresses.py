"""This module decides which addresses the service may call when a user names them."""

from __future__ import annotations

import socket
from collections.abc import Collection, Sequence
from ipaddress import IPv4Address, IPv4Network, IPv6Address, IPv6Network, ip_address, ip_network

from certifier.errors import CirisError
from db.settings import Host


def _networks(*texts: str) -> tuple[IPv4Network | IPv6Network, ...]:
    return tuple(map(ip_network, texts))


PORTS = (443, 80)
"""Receivers are called on these ports unless the settings name another port of the host."""
_PLATFORM = ("168.63.129.16", "100.100.100.200", "169.254.169.254", "192.0.0.192", "fd00:ec2::254", "fd20:ce::254")
"""Platforms answer here with credentials and settings of their machines. No setting allows these addresses."""
_OWN = _networks("10.0.0.0/8", "172.16.0.0/12", "192.168.0.0/16", "100.64.0.0/10", "127.0.0.0/8", "::1/128", "fc00::/7")
"""Addresses of private networks and of this machine, which the settings can allow."""
_UNICAST = _networks("0.0.0.0/0", "2000::/3")
_RESERVED = _networks("192.0.0.0/24", "192.88.99.0/24", "224.0.0.0/4", "2001::/23", "2001:db8::/32", "2002::/16", "3fff::/20")
"""Addresses outside _UNICAST, and these, are not of the public internet. Among them are all IPv6 addresses that stand for an IPv4 one."""


def is_public(address: str) -> bool:
    """Says whether this is an address of the public internet. An IPv6 address that stands for an IPv4 address counts as not public."""
    ip = _ip(address)
    return ip.is_global and str(ip) not in _PLATFORM and _among(ip, _UNICAST) and not _among(ip, _RESERVED)


def may_be_called(address: str, *, listed: bool) -> bool:
    """Says whether the service may connect to the address.

    Args:
        listed: the settings list the host that has the address. Then it may be of a private network or of this machine.
    """
    ip = _ip(address)
    return is_public(address) or (listed and str(ip) not in _PLATFORM and _among(ip, _OWN))


def check(host: str, port: int, hosts: Collection[Host]) -> bool:
    """Refuses a port, and an address in place of a name, that may not be called. Returns whether the settings list host and port.

    Args:
        hosts: those that the settings list.

    Raises:
        CirisError: webhook_address.
    """
    name = host.lower().rstrip(".")
    listed = any(one.name == name and port in (PORTS if one.port is None else (one.port,)) for one in hosts)
    if not listed and port not in PORTS:
        raise CirisError("webhook_address", f"port {port} of {host} may not be called", field="webhook.url", hint=_hint(f"{host}:{port}"))
    try:
        refused = not may_be_called(host, listed=listed)
    except ValueError:
        return listed  # the host is a name: who calls it resolves it
    if refused:
        raise _refusal(host, listed)
    return listed


def resolve(host: str, port: int, hosts: Collection[Host]) -> str:
    """Returns an address of the host. The caller must connect to this address: another look-up could give another answer.

    A name that is not known and one that has other addresses get the same words. So nobody learns which names a private network has.

    Args:
        hosts: those that the settings list.

    Raises:
        CirisError: webhook_address, when the host has no address, or any that may not be called.
    """
    listed = check(host, port, hosts)
    try:
        found = [str(entry[4][0]) for entry in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)]
    except (OSError, UnicodeError):
        found = []
    if not found or not all(may_be_called(address, listed=listed) for address in found):
        raise _refusal(host, listed)
    return found[0]


def _ip(address: str) -> IPv4Address | IPv6Address:
    return ip_address(address.partition("%")[0])


def _among(ip: IPv4Address | IPv6Address, networks: Sequence[IPv4Network | IPv6Network]) -> bool:
    return any(ip in network for network in networks)


def _refusal(host: str, listed: bool) -> CirisError:
    problem = f"{host} has no address that may be called" if listed else f"{host} has no public address"
    return CirisError("webhook_address", problem, field="webhook.url", hint=_hint(host))


def _hint(place: str) -> str:
    return f"is it spelt so? Operators allow receivers of their own network with CIRIS_WEBHOOK_HOSTS={place}"
