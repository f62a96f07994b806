"""Which addresses are of the public internet, whatever this Python's `ipaddress` thinks of them."""

from __future__ import annotations

from ipaddress import IPv4Address, IPv4Network, IPv6Address, IPv6Network, ip_address, ip_network

import pytest

from marey.core.addresses import Allowed, is_public
from marey.core.errors import Refused
from marey.core.special_addresses import SPECIAL_4, SPECIAL_6, purpose_of
from marey.webhooks.addresses import choose_address

REGISTRY = (
    "0.0.0.0/8", "10.0.0.0/8", "100.64.0.0/10", "127.0.0.0/8", "169.254.0.0/16", "172.16.0.0/12", "192.0.0.0/24",
    "192.0.0.0/29", "192.0.0.8/32", "192.0.0.9/32", "192.0.0.10/32", "192.0.0.170/32", "192.0.0.171/32",
    "192.0.2.0/24", "192.31.196.0/24", "192.52.193.0/24", "192.88.99.0/24", "192.88.99.2/32", "192.168.0.0/16",
    "192.175.48.0/24", "198.18.0.0/15", "198.51.100.0/24", "203.0.113.0/24", "224.0.0.0/4", "240.0.0.0/4",
    "255.255.255.255/32", "168.63.129.16/32", "::/128", "::1/128", "::/96", "::ffff:0:0/96", "64:ff9b::/96",
    "64:ff9b:1::/48", "100::/64", "100:0:0:1::/64", "2001::/23", "2001::/32", "2001:1::1/128", "2001:1::2/128",
    "2001:1::3/128", "2001:2::/48", "2001:3::/32", "2001:4:112::/48", "2001:10::/28", "2001:20::/28",
    "2001:30::/28", "2001:db8::/32", "2002::/16", "2620:4f:8000::/48", "3fff::/20", "3ffe::/16", "5f00::/16",
    "fc00::/7", "fe80::/10", "fec0::/10", "ff00::/8", "4000::/3", "6000::/3", "8000::/3", "a000::/3", "c000::/3",
    "e000::/4", "f000::/5", "f800::/6", "200::/7", "400::/6", "800::/5", "1000::/4",
)  # fmt: skip
"""Every block of IANA's registries, and of IPv6 all that is not given out."""


@pytest.mark.parametrize("block", REGISTRY)
def test_every_special_block_is_refused_from_end_to_end(block: str) -> None:
    network = ip_network(block)
    for address in (network[0], network[network.num_addresses // 2], network[-1]):
        assert not is_public(address)
        if block == "::ffff:0:0/96":
            continue  # such an address is taken for the IPv4 address inside
        with pytest.raises(Refused, match="private address"):
            choose_address([str(address)], "https", Allowed.of(["public"]))


@pytest.mark.parametrize(
    "address",
    [
        *("1.1.1.1", "8.8.8.8", "9.255.255.255", "11.0.0.0", "100.63.255.255", "100.128.0.0", "126.255.255.255"),
        *("128.0.0.0", "168.63.129.15", "168.63.129.17", "169.253.255.255", "169.255.0.0", "172.15.255.255"),
        *("172.32.0.0", "191.255.255.255", "192.0.1.0", "192.0.3.0", "192.88.98.255", "192.88.100.0"),
        *("192.167.255.255", "192.169.0.0", "198.17.255.255", "198.20.0.0", "223.255.255.255"),
        *("2000::1", "2001:200::1", "2001:db7::1", "2001:db9::1", "2003::1", "2606:4700:4700::1111", "2a00::1"),
        *("3ffd::1", "3fff:1000::1", "2620:4f:7fff::1", "2620:4f:8001::1"),
    ],
)  # fmt: skip
def test_their_neighbours_are_public(address: str) -> None:
    assert is_public(ip_address(address))
    assert choose_address([address], "https", Allowed.of(["public"])) == address


@pytest.mark.parametrize("inner", ["127.0.0.1", "10.0.0.1", "169.254.169.254", "192.0.0.192"])
def test_an_address_inside_an_address_is_refused(inner: str) -> None:
    number = int(IPv4Address(inner))
    for base in ("::", "::ffff:0:0", "64:ff9b::", "64:ff9b:1::", "2001::"):
        assert not is_public(IPv6Address(int(IPv6Address(base)) | number)), base
    assert not is_public(IPv6Address(int(IPv6Address("2002::")) | number << 80))
    for form in (f"::ffff:{inner}", f"::{inner}", f"64:ff9b::{inner}"):
        with pytest.raises(Refused, match="private address"):
            choose_address([form], "https", Allowed.of(["public"]))


def test_blocks_stand_once_and_say_what_they_are_for() -> None:
    tables: tuple[dict[IPv4Network, str] | dict[IPv6Network, str], ...] = (SPECIAL_4, SPECIAL_6)
    for table in tables:
        for block, purpose in table.items():
            assert purpose
            assert purpose_of(block[0]) == purpose
