"""Tests of the options of requests: type checkers know them, and they are the API's."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from palpate import StatusError, options

if TYPE_CHECKING:
    from palpate import Client

ROOT = Path(__file__).resolve().parents[1]


def test_options_are_those_of_the_api() -> None:
    command = [sys.executable, str(ROOT / "options_of_api.py")]
    written = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    ours = Path(options.__file__).read_text()
    assert ast.dump(ast.parse(ours)) == ast.dump(ast.parse(written))


def test_a_wrong_option_is_found_by_type_checkers_and_refused(client: Client) -> None:
    # The type checker fails if one of these is not an error for it.
    with pytest.raises(StatusError, match="methods"):
        client.create_session(methods="surface")  # type: ignore[call-arg]
    with pytest.raises(StatusError, match="method"):
        client.create_session(method="touch")  # type: ignore[arg-type]
    with pytest.raises(StatusError, match="ttl"):
        client.train(ttl_s=3)  # type: ignore[call-arg]
