"""Names in figures are drawn as they are written, whatever letters they have."""

from __future__ import annotations

import warnings
from pathlib import Path

import matplotlib.font_manager as fonts
import pytest
from matplotlib.text import Text

from multimodal_to.plotting import FIGURES, LetterWarning, plot, save
from multimodal_to.plotting.lettering import STAND_IN
from odd_robots import JOINTS, at_rest, odd_robot

IN_STIX = "\u1d84"  # of matplotlib's own fonts only STIXGeneral has it
NOWHERE = "机"


def texts(figure) -> list[Text]:
    figure.draw_without_rendering()
    return [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]


def drawn(tmp_path: Path, figure: str, letters: str):
    robot = odd_robot(tmp_path, joints=JOINTS, feet=True, jets=True, letters=letters)
    return plot(figure, robot, at_rest(robot))


@pytest.fixture
def own_fonts(monkeypatch):
    """Only the fonts that matplotlib brings along, wherever the test runs."""
    data = [font for font in fonts.fontManager.ttflist if "mpl-data" in font.fname]
    monkeypatch.setattr(fonts.fontManager, "ttflist", data)


@pytest.mark.parametrize("figure", FIGURES)
def test_letters_that_no_font_has_are_boxes_and_one_warning_says_so(tmp_path, own_fonts, figure, capfd):
    with pytest.warns(LetterWarning) as caught:
        drawing = drawn(tmp_path, figure, f" {NOWHERE}器")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        shown = "".join(text.get_text() for text in texts(drawing))
        for suffix in ("png", "svg", "pdf"):
            save(drawing, tmp_path / f"figure.{suffix}")
    assert str(caught[0].message) == f"no installed font has 器 {NOWHERE}; figures show {STAND_IN} for each"
    assert NOWHERE not in shown
    assert shown.count(STAND_IN) >= 2
    assert capfd.readouterr() == ("", "")


def test_letters_are_drawn_in_a_font_that_has_them(tmp_path, own_fonts):
    drawing = drawn(tmp_path, "contacts", f" {IN_STIX}")
    with_letter = [text for text in texts(drawing) if IN_STIX in text.get_text()]
    assert len(with_letter) >= 4  # the ticks of three contact points, a foot in the legend, the robot in the title
    assert all(text.get_fontfamily()[-1] == "STIXGeneral" for text in with_letter)


def test_a_name_is_no_formula_and_powers_of_ten_are(tmp_path):
    for figure in FIGURES:
        drawing = drawn(tmp_path, figure, " $x_1$ a$b_{$")  # the second of which would be none that can be read
        names = [text for text in texts(drawing) if "x_1" in text.get_text()]
        assert names
        assert not any(text.get_parse_math() for text in names)
    margins = drawn(tmp_path, "margins", "")
    assert any(text.get_parse_math() and "10^{" in text.get_text() for text in texts(margins))
