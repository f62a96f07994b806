"""Network addresses that outgoing requests may reach: public ones, unless the settings allow others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv4Network, IPv6Address, IPv6Network, ip_address, ip_network

from marey.core.errors import InvalidInput
from marey.core.special_addresses import purpose_of

Address = IPv4Address | IPv6Address

PUBLIC = "public"


@dataclass(frozen=True)
class Allowed:
    """Address policy of this installation.

    Attributes:
        public: allow public addresses, over https.
        networks: allow these networks, also over http.
    """

    public: bool
    networks: tuple[IPv4Network | IPv6Network, ...]

    @classmethod
    def of(cls, values: Sequence[str]) -> Allowed:
        """Parse `MAREY_WEBHOOK_ALLOW`: networks, and the word `public`.

        Raises:
            InvalidInput: any other value.
        """
        try:
            networks = tuple(ip_network(value) for value in values if value != PUBLIC)
        except ValueError as error:
            raise InvalidInput(
                str(error), where="MAREY_WEBHOOK_ALLOW", hint='Write ["public", "10.1.0.0/16"].'
            ) from error
        return cls(PUBLIC in values, networks)

    def named(self, address: Address) -> bool:
        """Return True if the address is in one of the allowed networks."""
        return any(address in network for network in self.networks)

    def permits(self, address: Address) -> bool:
        """Return True if requests may be sent to the address."""
        return self.named(address) or (self.public and is_public(address))


def parse_address(text: str) -> Address:
    """Parse an address; unwrap an IPv4-mapped IPv6 address."""
    address = ip_address(text)
    return getattr(address, "ipv4_mapped", None) or address


def is_public(address: Address) -> bool:
    """Return True if an address belongs to one machine of the public internet."""
    return purpose_of(address) is None
