"""Numbers in addresses of requests: decimal digits only, where pydantic also takes 1_0."""

from __future__ import annotations

from pydantic import BeforeValidator

from drone_mesh.arguments import is_decimal, is_whole


def _whole(value: object) -> object:
    if isinstance(value, str) and not is_whole(value):
        raise ValueError("must be a whole number in decimal digits")
    return value


def _decimal(value: object) -> object:
    if isinstance(value, str) and not is_decimal(value):
        raise ValueError("must be a number in decimal digits")
    return value


WholeDigits = BeforeValidator(_whole)
DecimalDigits = BeforeValidator(_decimal)
