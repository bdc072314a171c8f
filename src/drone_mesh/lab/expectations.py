"""`expect:` of an experiment: statements about its metrics, and the cells that they speak of.

healed >= 0.95                                          every cell
healed of repair=thesis,faults.kill.share=0.3 >= 0.95   those with these values
pdr_up of beacon > child_table_tree - 0.02              those with the one value against the
                                                        same with the other, seed by seed
"""

from __future__ import annotations

import re
from typing import Mapping, NamedTuple, Sequence

from drone_mesh.errors import ConfigurationError

Values = Mapping[str, str]
"""A cell: its value on each axis, as text."""

_NUMBER = r"-?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?"
_FORM = re.compile(
    rf"(?P<metric>[\w:.]+)(?: of (?P<cell>\S+))? (?P<relation>[<>]=?) "
    rf"(?:(?P<bound>{_NUMBER})|(?P<other>\S+?)(?: (?P<sign>[+-]) (?P<margin>{_NUMBER}))?)"
)
_OUTSIDE_BRACKETS = re.compile(r",(?![^\[]*\])")  # commas, but not those of a list


class Expectation(NamedTuple):
    """A metric of some cells, compared with a number or, seed by seed, with other cells."""

    text: str
    metric: str  # a column of runs.csv
    cell: str  # as `matching` takes it; empty: every cell
    relation: str  # one of > >= < <=
    other: str  # the cells to compare with; empty: a number
    bound: float  # this number, or what is added to the other's

    @staticmethod
    def parse(text: str) -> Expectation:
        """Raises ConfigurationError."""
        found = _FORM.fullmatch(text)
        if found is None or (found["other"] and not found["cell"]):
            raise ConfigurationError(
                f"{text!r:.80}: expected METRIC >= NUMBER, METRIC of CELL >= NUMBER or METRIC of "
                "CELL > CELL, with >, >=, < or <=; a cell is axis=value[,axis=value...]"
            )
        bound = float(found["bound"] or (found["sign"] or "") + (found["margin"] or "0"))
        metric = found["metric"].rpartition(":")[2]
        return Expectation(
            text, metric, found["cell"] or "", found["relation"], found["other"] or "", bound
        )

    def cells(self, cells: Sequence[Values]) -> list[tuple[int, int | None]]:
        """The cells to judge, each with the one to compare with. Raises ConfigurationError."""
        chosen = matching(cells, self.cell)
        last = self.text.rpartition(" ")[2]
        for axis in _named(cells, self.cell):
            if not self.other and any(cell[axis] == last for cell in cells):
                raise ConfigurationError(
                    f"{self.text}: write {axis}={last} for a cell, {float(last):.3f} for a number"
                )
        pairs: list[tuple[int, int | None]] = [(index, None) for index in chosen]
        if self.other:
            other = _named(cells, self.other)
            wanted = [(index, {**cells[index], **other}) for index in chosen]
            pairs = [(i, cells.index(w)) for i, w in wanted if w in cells and w != cells[i]]
        if not pairs:
            raise ConfigurationError(f"{self.text}: no such cells")
        return pairs


def matching(cells: Sequence[Values], text: str) -> list[int]:
    """The cells that match axis=value[,axis=value...], where the value of one axis alone may stand.

    Raises ConfigurationError for an unknown axis.
    """
    wanted = _named(cells, text).items()
    return [index for index, cell in enumerate(cells) if wanted <= cell.items()]


def _named(cells: Sequence[Values], text: str) -> dict[str, str]:
    axes = list(cells[0])
    wanted: dict[str, str] = {}
    for part in filter(None, _OUTSIDE_BRACKETS.split(text)):
        axis, equals, value = part.partition("=")
        if not equals:
            value = part
            fit = [axis for axis in axes if any(cell[axis] == value for cell in cells)]
            axis = fit[0] if len(fit) == 1 else ""
        if axis not in axes:
            raise ConfigurationError(
                f"cell {text}: expected axis=value with one of {', '.join(axes) or 'no axes'}"
            )
        wanted[axis] = value
    return wanted
