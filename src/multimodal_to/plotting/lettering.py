"""Names in figures as they are written: each letter in an installed font that has it, and no formulas."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from functools import cache

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure, SubFigure
from matplotlib.font_manager import FontProperties, findfont, fontManager, get_font
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.ticker import FixedFormatter, FuncFormatter

STAND_IN = "□"
"""Stands for a letter that no installed font has."""
_REGULAR = (400, "normal", "normal")
_BOXES = "Last Resort"  # a font of matplotlib's that has a box for every letter
_NAMED = 10  # so many letters are named in the warning


class LetterWarning(UserWarning):
    """Letters of a figure that no installed font has."""


def lettered(figure: Figure) -> Figure:
    """Return the figure with its names as they are written.

    A letter that matplotlib's font does not have is drawn in the first installed fonts that do; one that none has is
    drawn as `STAND_IN`, and a `LetterWarning` says so. A `$` in a name begins no formula.
    """
    lost = dict[str, None]()
    for text in _names(figure):
        lost |= _letter(text)
    for axis in figure.findobj(Axis):
        if isinstance(axis.get_major_formatter(), FuncFormatter):  # ticks with names, as `Axes.set_yticks` gives them
            labels = axis.get_majorticklabels()
            for label in labels:
                lost |= _letter(label)
            axis.set_major_formatter(FixedFormatter([label.get_text() for label in labels]))
    if lost:
        more = f" and {len(lost) - _NAMED} more" if len(lost) > _NAMED else ""
        warnings.warn(
            f"no installed font has {' '.join([*lost][:_NAMED])}{more}; figures show {STAND_IN} for each",
            LetterWarning,
            stacklevel=1,  # so that it is said once, however many figures there are
        )
    return figure


def _names(figure: Figure) -> Iterator[Text]:
    """Yield the texts of a figure but the labels of ticks that are numbers: powers of ten are formulas."""
    for part in (figure, *figure.findobj(SubFigure)):
        yield from part.texts
    for legend in figure.findobj(Legend):
        yield from (*legend.get_texts(), legend.get_title())
    for axis in figure.findobj(Axis):
        yield axis.label
    for axes in figure.findobj(Axes):
        yield from (axes.title, *axes.texts)


def _letter(text: Text) -> dict[str, None]:
    """Let a text be drawn as it is written; return the letters that no font has."""
    text.set_parse_math(False)
    missing = _missing(text.get_text(), text.get_fontproperties())
    if not missing:
        return {}
    families, lacking = _families(missing)
    text.set_fontfamily([*text.get_fontfamily(), *families])
    text.set_text("".join(STAND_IN if letter in lacking else letter for letter in text.get_text()))
    return dict.fromkeys(sorted(lacking))


def _missing(text: str, properties: FontProperties) -> frozenset[str]:
    known = _letters(findfont(properties))
    return frozenset(letter for letter in text if ord(letter) not in known and not letter.isspace())


@cache
def _letters(font: str) -> frozenset[int]:
    try:
        return frozenset(get_font(font).get_charmap())
    except (OSError, RuntimeError):  # a file that is gone or no font that can be read
        return frozenset()


@cache
def _families(letters: frozenset[str]) -> tuple[tuple[str, ...], frozenset[str]]:
    """Return families of installed fonts that have letters, those with the most of them first, and what none has."""
    covered: dict[str, frozenset[str]] = {}
    for font in fontManager.ttflist:
        if (font.weight, font.style, font.variant) == _REGULAR and not font.name.startswith(_BOXES):
            known = _letters(font.fname)
            found = frozenset(letter for letter in letters if ord(letter) in known)
            covered[font.name] = max(covered.get(font.name, found), found, key=len)
    families, left = list[str](), letters
    while left and (best := max(covered, key=lambda name: len(covered[name] & left), default=None)) is not None:
        if not covered[best] & left:
            break
        families.append(best)
        left -= covered[best]
    return tuple(families), left
