"""This module decides which addresses the service may call when a user names them."""

from __future__ import annotations

import socket
from ipaddress import IPv6Address, ip_address, ip_network

from certifier.errors import CirisError

_TRANSLATED = (ip_network("64:ff9b::/96"), ip_network("64:ff9b:1::/48"))


def is_public(address: str) -> bool:
    """Says whether this is an address of the public internet. An IPv6 address that stands for an IPv4 address counts as not public."""
    ip = ip_address(address.partition("%")[0])
    if isinstance(ip, IPv6Address) and (ip.ipv4_mapped or ip.sixtofour or ip.teredo or any(ip in network for network in _TRANSLATED)):
        return False
    return ip.is_global and not ip.is_multicast


def resolve(host: str, port: int, *, private: bool) -> str:
    """Returns an address of the host. The caller must connect to this address: another look-up could give another answer.

    Args:
        private: accept addresses that are not public.

    Raises:
        CirisError: webhook_address, when the host has no address or one that is not public.
    """
    try:
        found = [str(entry[4][0]) for entry in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)]
    except (OSError, UnicodeError):
        hint = "is it spelt so, and does the service's machine know it?"
        raise CirisError("webhook_address", f"no address of {host} was found", field="webhook.url", hint=hint) from None
    if not private and not all(map(is_public, found)):
        raise CirisError(
            "webhook_address", f"{host} is not a public address", field="webhook.url", hint="CIRIS_WEBHOOK_PRIVATE=1 allows it"
        )
    return found[0]
