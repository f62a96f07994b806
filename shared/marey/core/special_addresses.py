"""Addresses outside the public internet: IANA's special-purpose registries, and those that clouds reserve.

The tables are here because `ipaddress.is_global` differs between patch versions of Python (192.0.0.0/24 is global for
3.11.7, where a cloud's metadata service answers). They also list blocks that IANA calls globally reachable but that
serve a protocol instead of a machine (AS112, AMT, anycast of PCP and TURN): no receiver of webhooks is there.

Sources: IANA IPv4 and IPv6 Special-Purpose Address Registries (RFC 6890 and later), IPv4 and IPv6 address space.
"""

from __future__ import annotations

from ipaddress import IPv4Address, IPv4Network, IPv6Address, IPv6Network

UNICAST_6 = IPv6Network("2000::/3")
"""All IPv6 space that IANA has allocated; addresses outside are refused, listed below or not."""

SPECIAL_4: dict[IPv4Network, str] = {
    IPv4Network(block): purpose
    for block, purpose in (
        ("0.0.0.0/8", "this network (RFC 791)"),
        ("10.0.0.0/8", "private (RFC 1918)"),
        ("100.64.0.0/10", "shared address space of carriers (RFC 6598)"),
        ("127.0.0.0/8", "loopback (RFC 1122)"),
        ("168.63.129.16/32", "Azure's platform services, seen from its machines alone"),
        ("169.254.0.0/16", "link-local, metadata services of clouds (RFC 3927)"),
        ("172.16.0.0/12", "private (RFC 1918)"),
        ("192.0.0.0/24", "IETF protocol assignments, a metadata service (RFC 6890)"),
        ("192.0.2.0/24", "documentation (RFC 5737)"),
        ("192.31.196.0/24", "AS112 (RFC 7535)"),
        ("192.52.193.0/24", "AMT (RFC 7450)"),
        ("192.88.99.0/24", "6to4 relays (RFC 7526)"),
        ("192.168.0.0/16", "private (RFC 1918)"),
        ("192.175.48.0/24", "AS112 (RFC 7534)"),
        ("198.18.0.0/15", "benchmarks (RFC 2544)"),
        ("198.51.100.0/24", "documentation (RFC 5737)"),
        ("203.0.113.0/24", "documentation (RFC 5737)"),
        ("224.0.0.0/4", "multicast (RFC 5771)"),
        ("240.0.0.0/4", "reserved and broadcast (RFC 1112, RFC 919)"),
    )
}
SPECIAL_6: dict[IPv6Network, str] = {
    IPv6Network(block): purpose
    for block, purpose in (
        ("::/96", "unspecified, loopback, IPv4-compatible (RFC 4291)"),
        ("::ffff:0:0/96", "IPv4-mapped (RFC 4291)"),
        ("64:ff9b::/96", "NAT64: an IPv4 address inside (RFC 6052)"),
        ("64:ff9b:1::/48", "NAT64 of a site: an IPv4 address inside (RFC 8215)"),
        ("100::/64", "discard (RFC 6666)"),
        ("100:0:0:1::/64", "dummy prefix (RFC 9780)"),
        ("2001::/23", "IETF protocol assignments: Teredo, benchmarks, ORCHID, AMT, AS112 (RFC 2928)"),
        ("2001:db8::/32", "documentation (RFC 3849)"),
        ("2002::/16", "6to4: an IPv4 address inside (RFC 3056)"),
        ("2620:4f:8000::/48", "AS112 (RFC 7534)"),
        ("3ffe::/16", "6bone, returned (RFC 3701)"),
        ("3fff::/20", "documentation (RFC 9637)"),
        ("5f00::/16", "segment routing (RFC 9602)"),
        ("fc00::/7", "unique local (RFC 4193)"),
        ("fe80::/10", "link-local (RFC 4291)"),
        ("fec0::/10", "site-local (RFC 3879)"),
        ("ff00::/8", "multicast (RFC 4291)"),
    )
}


def purpose_of(address: IPv4Address | IPv6Address) -> str | None:
    """Return the special purpose of an address; None for an address of the public internet."""
    if isinstance(address, IPv4Address):
        return next((purpose for block, purpose in SPECIAL_4.items() if address in block), None)
    for block, purpose in SPECIAL_6.items():
        if address in block:
            return purpose
    return None if address in UNICAST_6 else "not allocated by IANA"
