"""What all tests rely on."""

import signal

import pytest


@pytest.fixture(scope="session", autouse=True)
def interruptible():
    """Where tests are started in the background, shells have SIGINT ignored, and Ctrl-C would end nothing."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
