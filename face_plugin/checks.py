"""Checks of the fields of settings: each says which field it is, what was found, and what is allowed."""

from __future__ import annotations

import math
import numbers

__all__ = ["check_integer", "check_number"]


def check_integer(settings: object, name: str, least: int) -> None:
    """Raise unless the field is an integer of at least `least`; NumPy's numbers are kept as Python's.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> check_integer(SimpleNamespace(seed=-1), "seed", 0)
    Traceback (most recent call last):
    ValueError: seed must be an integer >= 0, found -1
    """
    value = getattr(settings, name)
    if isinstance(value, bool) or not isinstance(value, numbers.Integral) or value < least:
        raise ValueError(f"{name} must be an integer >= {least}, found {value!r}")
    object.__setattr__(settings, name, int(value))


def check_number(
    settings: object, name: str, low: float, high: float, *, closed: bool = False, least: bool = False
) -> None:
    """Raise unless the field is a number in (low, high); `closed` admits `high`, `least` admits `low`.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> check_number(SimpleNamespace(padding=0.0), "padding", 0.0, 100.0)
    Traceback (most recent call last):
    ValueError: padding must be in (0, 100), found 0.0
    """
    value = getattr(settings, name)
    span = f"{'[' if least else '('}{low:g}, {high:g}{']' if closed else ')'}"
    try:
        number = math.nan if isinstance(value, bool) or not isinstance(value, numbers.Real) else float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"{name} must be a finite number in {span}, found {value!r}")
    if not (low < number < high or (least and number == low) or (closed and number == high)):
        raise ValueError(f"{name} must be in {span}, found {value!r}")
    object.__setattr__(settings, name, number)
