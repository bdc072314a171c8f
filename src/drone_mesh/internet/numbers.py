"""Numbers in addresses of requests: decimal digits only, where pydantic also takes 1_0."""

from __future__ import annotations

from typing import Callable

from pydantic import BeforeValidator

from drone_mesh.arguments import is_decimal, is_whole


def _digits(is_number: Callable[[str], bool], what: str) -> BeforeValidator:
    def check(value: object) -> object:
        if isinstance(value, str) and not is_number(value):
            raise ValueError(f"must be {what} in decimal digits")
        return value

    return BeforeValidator(check)


WholeDigits = _digits(is_whole, "a whole number")
DecimalDigits = _digits(is_decimal, "a number")
