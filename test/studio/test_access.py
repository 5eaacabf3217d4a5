"""Who may see and change what in the studio."""

from __future__ import annotations

import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.studio.access import Access

LOCAL = Access("localhost", 8970)
OPEN = Access("0.0.0.0", 8970)
NAMED = Access("robot.lan", 8970)


@pytest.mark.parametrize(
    ("access", "host", "known"),
    [
        (LOCAL, "localhost:8970", True),
        (LOCAL, "127.0.0.1:8970", True),
        (LOCAL, "[::1]:8970", True),
        (LOCAL, "LOCALHOST:8970", True),
        (LOCAL, "localhost", False),
        (LOCAL, "localhost:80", False),
        (LOCAL, "localhost:8970x", False),
        (LOCAL, "192.168.0.7:8970", False),
        (LOCAL, "evil.example:8970", False),
        (LOCAL, "localhost.evil.example:8970", False),
        (LOCAL, "a@localhost:8970", False),
        (LOCAL, "localhost:8970/x", False),
        (LOCAL, "localhost:8970?x", False),
        (LOCAL, "", False),
        (LOCAL, None, False),
        (OPEN, "192.168.0.7:8970", True),
        (OPEN, "[fe80::1]:8970", True),
        (OPEN, f"{socket.gethostname()}:8970", True),
        (OPEN, "localhost:8970", True),
        (OPEN, "evil.example:8970", False),
        (NAMED, "robot.lan:8970", True),
        (NAMED, "Robot.LAN:8970", True),
        (NAMED, "localhost:8970", False),
        (NAMED, "evil.example:8970", False),
    ],
)
def test_only_the_own_names_of_the_studio_are_known(
    access: Access, host: str | None, known: bool
) -> None:
    assert access.knows_host(host) is known


def test_a_page_is_its_own_only_with_the_very_address_that_it_was_opened_at() -> None:
    assert LOCAL.knows_origin("http://localhost:8970", "localhost:8970")
    for origin in (None, "null", "http://127.0.0.1:8970", "https://localhost:8970", "http://a.b"):
        assert not LOCAL.knows_origin(origin, "localhost:8970")
    assert not LOCAL.knows_origin("http://evil.example:8970", "evil.example:8970")


@given(st.text() | st.none())
def test_no_other_text_is_the_token(text: str | None) -> None:
    assert not LOCAL.has_token(text)
    assert LOCAL.has_token(LOCAL.token)


def test_each_session_has_a_token_of_its_own_which_is_shown_in_the_url_alone() -> None:
    assert LOCAL.token != OPEN.token
    assert OPEN.token in OPEN.url
    assert OPEN.token not in repr(OPEN)
    assert LOCAL.token not in LOCAL.url


@given(st.text())
def test_no_host_is_too_odd_to_be_refused(host: str) -> None:
    known = {"localhost:8970", "127.0.0.1:8970", "[::1]:8970", "robot.lan:8970"}
    for access in (LOCAL, NAMED):
        assert access.knows_host(host) <= (host.lower() in known)
