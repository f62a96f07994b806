"""Which addresses a webhook may tell."""

from __future__ import annotations

import pytest

from marey.core.addresses import Allowed
from marey.core.errors import InvalidInput, Refused
from marey.webhooks.addresses import check_url, choose_address

DEFAULT = Allowed.of(["public"])
STUDIO = Allowed.of(["public", "10.1.0.0/16", "fd00:1::/32"])


@pytest.mark.parametrize("address", ["8.8.8.8", "2606:4700:4700::1111", "::ffff:8.8.8.8"])
def test_addresses_of_the_internet_may_be_told_over_https(address: str) -> None:
    assert choose_address([address], "https", DEFAULT) == address.removeprefix("::ffff:")


@pytest.mark.parametrize(
    "address",
    [
        *("127.0.0.1", "127.9.9.9", "0.0.0.0", "10.0.0.1", "172.16.3.4", "192.168.1.1", "100.64.0.1", "198.18.0.1"),
        *("169.254.169.254", "100.100.100.200", "168.63.129.16", "224.0.1.1", "255.255.255.255", "240.0.0.1"),
        *("192.88.99.1", "192.0.2.1", "::", "::1", "fe80::1", "fe80::1%eth0", "fc00::1", "fd00:ec2::254", "ff02::1"),
        *("fec0::1", "::ffff:127.0.0.1", "::ffff:169.254.169.254", "::127.0.0.1", "64:ff9b::7f00:1"),
        *("2002:7f00:1::", "2001::1", "2001:db8::1", "5f00::1"),
    ],
)  # fmt: skip
def test_no_other_address_is_told_unless_its_network_is_named(address: str) -> None:
    with pytest.raises(Refused, match="private address"):
        choose_address([address], "https", DEFAULT)


def test_a_name_that_leads_inside_as_well_as_outside_is_refused() -> None:
    for found in (["8.8.8.8", "10.0.0.1"], ["127.0.0.1", "2606:4700:4700::1111"]):
        with pytest.raises(Refused, match="private address"):
            choose_address(found, "https", DEFAULT)
    with pytest.raises(Refused, match="does not resolve"):
        choose_address([], "https", DEFAULT)


def test_networks_that_are_named_may_be_told_without_tls_and_nothing_beside_them() -> None:
    for address in ("10.1.2.3", "::ffff:10.1.2.3", "fd00:1::5"):
        for scheme in ("http", "https"):
            assert choose_address([address], scheme, STUDIO) == address.removeprefix("::ffff:")
    with pytest.raises(Refused, match="private address"):
        choose_address(["10.2.0.1"], "https", STUDIO)
    for found in (["8.8.8.8"], ["10.1.2.3", "8.8.8.8"]):
        assert choose_address(found, "https", STUDIO) == found[0]
        with pytest.raises(Refused, match="http is allowed only for the networks in MAREY_WEBHOOK_ALLOW"):
            choose_address(found, "http", STUDIO)
    with pytest.raises(Refused, match="private address"):
        choose_address(["8.8.8.8"], "https", Allowed.of(["10.1.0.0/16"]))


@pytest.mark.parametrize(
    "host", ["127.0.0.1", "2130706433", "0x7f.1", "127.1", "[::1]", "localhost", "localhost.", "127.0.0.1."]
)
def test_an_address_is_seen_however_it_is_written(host: str) -> None:
    with pytest.raises(InvalidInput, match="private address") as refused:
        check_url(f"https://{host}/hook", DEFAULT)
    assert refused.value.where == "url"
    assert "MAREY_WEBHOOK_ALLOW" in (refused.value.hint or "")
    assert check_url(f"http://{host}:8080/hook", Allowed.of(["127.0.0.0/8", "::1/128"]))


@pytest.mark.parametrize(
    "url",
    [
        *("ftp://studio.example/", "studio.example/hook", "https://", "https:///hook", "", "https://a:99999/"),
        *("https://user:secret@studio.example/", "https://studio.example/#x", "https://a/" + "x" * 2000),
        *("https://127.0.0.1%2f.example.com/", "http://studio.example/", "https://[::1", "https://0177.0.0.1/", "https://a\n.example/"),
    ],
)  # fmt: skip
def test_what_is_no_address_of_a_receiver_is_refused_at_the_door(url: str) -> None:
    with pytest.raises(InvalidInput) as refused:
        check_url(url, DEFAULT)
    assert refused.value.where == "url"


@pytest.mark.parametrize(
    "host",
    [
        *("a..example", ".example", "a.example..", "-a.example", "a-.example", "_a.example", "a_.example", "a.b_"),
        *(
            "a,b.example",
            "ex~ample.com",
            "*.example",
            "x" * 64 + ".example",
            "a." * 127 + "a",
            "render.123",
            "1.2.3.4.5",
        ),
    ],
)
def test_a_host_that_cannot_exist_is_refused(host: str) -> None:
    for url in (f"https://{host}/hook", f"https://{host}:8443/hook"):
        with pytest.raises(InvalidInput, match=r"cannot be the name of a host|ends in a number") as refused:
            check_url(url, DEFAULT)
        assert (refused.value.where, bool(refused.value.hint)) == ("url", True)


@pytest.mark.parametrize(
    "host",
    [
        *("farm", "render.example.", "my--site.example", "ab--cd.example", "render_farm.example", "7.example", "1a"),
        *("xn--bcher-kva.example", "x" * 63 + ".example", ".".join(["a" * 49] * 5)),
    ],
)
def test_a_host_that_may_be_made_later_is_kept(host: str) -> None:
    assert check_url(f"https://{host}/hook", DEFAULT) == f"https://{host}/hook"


def test_a_url_is_kept_in_its_normal_form() -> None:
    assert check_url("HTTPS://Studio.Example/a?b=ü", DEFAULT) == "https://studio.example/a?b=%C3%BC"
    assert check_url("http://render.local/hook", STUDIO) == "http://render.local/hook"


def test_a_rule_that_makes_no_sense_names_its_setting() -> None:
    for values in (["internet"], ["10.1.2.3/8"]):
        with pytest.raises(InvalidInput) as refused:
            Allowed.of(values)
        assert refused.value.where == "MAREY_WEBHOOK_ALLOW"
