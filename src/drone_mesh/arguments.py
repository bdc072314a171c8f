"""Types for argparse: numbers within bounds, whose errors name the bounds."""

from __future__ import annotations

import argparse
import re
from typing import Callable

_WHOLE = re.compile(r"-?[0-9]{1,18}", re.ASCII)  # not int(): that takes 1_0 as well
_DECIMAL = re.compile(r"-?([0-9]+\.?[0-9]*|\.[0-9]+)(e[-+]?[0-9]+)?", re.ASCII | re.IGNORECASE)


def whole(lowest: int, highest: int) -> Callable[[str], int]:
    """A whole number within these bounds."""

    def number_of(text: str) -> int:
        if not (_WHOLE.fullmatch(text) and lowest <= int(text) <= highest):
            raise argparse.ArgumentTypeError(
                f"invalid value {text!r}: must be a whole number {lowest}..{highest}"
            )
        return int(text)

    return number_of


def decimal(lowest: float, highest: float) -> Callable[[str], float]:
    """A finite number within these bounds."""

    def number_of(text: str) -> float:
        if not (_DECIMAL.fullmatch(text) and lowest <= float(text) <= highest):
            raise argparse.ArgumentTypeError(
                f"invalid value {text!r}: must be a number {lowest:g}..{highest:g}"
            )
        return float(text)

    return number_of
