"""Windows of time in which requests are counted."""

import pytest
from limits import parse

from app.errors import TooMany
from app.security.rates import _Windows


def test_a_window_begins_with_the_first_request_and_ends_for_all():
    windows = _Windows(parse("2/minute"), "requests")
    windows.count("a", 100.0)
    windows.count("a", 130.0)
    with pytest.raises(TooMany) as refused:
        windows.count("a", 150.5)
    assert refused.value.retry_after_s == 10
    windows.count("b", 150.5)
    windows.count("a", 160.0)
    windows.count("a", 160.0)
    with pytest.raises(TooMany):
        windows.count("a", 219.9)


def test_clients_that_do_not_come_again_are_forgotten():
    windows = _Windows(parse("2/minute"), "requests")
    for number in range(1000):
        windows.count(f"address {number}", number * 0.01)
    assert len(windows._by_client) == 1000
    windows.count("another", 65.0)
    assert set(windows._by_client) == {*(f"address {number}" for number in range(501, 1000)), "another"}
