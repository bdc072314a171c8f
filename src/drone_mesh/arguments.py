"""Numbers that users write: on command lines, in parameters, in addresses, in files.

int() and float() also take `1_0`, digits of other scripts, white space and `nan`.
"""

from __future__ import annotations

import argparse
import math
import re
from typing import Any, Callable

MOST = 10**9  # for numbers without a bound of their own

_WHOLE = re.compile(r"-?[0-9]{1,18}", re.ASCII)
_DECIMAL = re.compile(r"-?([0-9]+\.?[0-9]*|\.[0-9]+)(e[-+]?[0-9]+)?", re.ASCII | re.IGNORECASE)


def is_whole(text: str) -> bool:
    """Whether the text is a whole number in decimal digits."""
    return _WHOLE.fullmatch(text) is not None


def is_up_to(text: str, most: int) -> bool:
    """Whether the text is a whole number 0..`most`, without a sign."""
    return is_whole(text) and text[0] != "-" and int(text) <= most


def is_decimal(text: str) -> bool:
    """Whether the text is a number in decimal digits, also with an exponent."""
    return _DECIMAL.fullmatch(text) is not None


def finite(text: str) -> float:
    """The number in this text of a file, which other programs may begin with +.

    Raises ValueError for anything but a decimal number, and above 1e9, where distances overflow.
    """
    text = text.strip(" \t")
    digits = text[1:] if text[:1] == "+" and text[1:2] != "-" else text
    number = float(digits) if is_decimal(digits) else math.nan
    if not abs(number) <= MOST:
        raise ValueError(f"{text[:40]!r} is not a number")
    return number


class ArgumentParser(argparse.ArgumentParser):
    """Takes what begins as a negative number for a value, as newer versions of argparse do.

    The others take `-1e3`, and places such as `-33.9,151.2,3`, for options.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._negative_number_matcher = re.compile(r"-\.?[0-9]")


def whole(lowest: int, highest: int) -> Callable[[str], int]:
    """For argparse: a whole number within these bounds."""

    def number_of(text: str) -> int:
        if not (is_whole(text) and lowest <= int(text) <= highest):
            raise argparse.ArgumentTypeError(
                f"invalid value {text!r}: must be a whole number {lowest}..{highest}"
            )
        return int(text)

    return number_of


def decimal(lowest: float, highest: float) -> Callable[[str], float]:
    """For argparse: a finite number within these bounds."""

    def number_of(text: str) -> float:
        if not (is_decimal(text) and lowest <= float(text) <= highest):
            raise argparse.ArgumentTypeError(
                f"invalid value {text!r}: must be a number {lowest:g}..{highest:g}"
            )
        return float(text)

    return number_of
