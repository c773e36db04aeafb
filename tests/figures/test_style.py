"""The visual language: readable colours, one look, the same bytes in every run."""

import matplotlib as mpl
import pytest

from cpl.figures import style


def luminance(colour: str) -> float:
    """Relative luminance as the accessibility guidelines (WCAG 2) define it."""
    channels = [
        c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4
        for c in mpl.colors.to_rgb(colour)
    ]
    return 0.2126 * channels[0] + 0.7152 * channels[1] + 0.0722 * channels[2]


@pytest.mark.parametrize(
    "colour", [style.INK, style.BLUE, style.RED, style.GREEN, style.PURPLE, style.GREY]
)
def test_every_text_colour_reaches_a_contrast_of_4_5_on_white(colour):
    assert 1.05 / (luminance(colour) + 0.05) >= 4.5


def test_no_letter_is_smaller_than_9_points():
    figure, axes = style.card()
    axes.set(xlabel="x", ylabel="y", title="t")
    style.drawn(style.note)(axes, 0.5, 0.5, "here")
    figure.canvas.draw()
    texts = [t for t in figure.findobj(mpl.text.Text) if t.get_text()]
    assert min(t.get_fontsize() for t in texts) >= 9


def test_a_card_is_svg_and_repeats_to_the_byte():
    first, second = style.card()[0].svg(), style.card()[0].svg()
    assert first == second
    assert "<svg" in first
    assert "<dc:date>" not in first


def test_the_notebook_gets_the_vector_form_and_a_line_of_text():
    figure, axes = style.card()
    axes.set(xlabel="time [s]", ylabel="score")
    bundle = figure._repr_mimebundle_()
    assert set(bundle) == {"image/svg+xml", "text/plain"}
    assert bundle["text/plain"] == "Figure: score against time [s]"


def test_the_readers_own_settings_are_left_alone():
    before = mpl.rcParams["font.size"]
    style.card()
    assert mpl.rcParams["font.size"] == before


def test_cards_stack_from_top_to_bottom():
    _, axes = style.cards(3)
    tops = [a.get_position().y1 for a in axes]
    assert tops == sorted(tops, reverse=True)


def test_level_and_span_write_their_names():
    _, axes = style.card()
    style.level(axes, 0.1, "target")
    style.span(axes, 0.2, 0.4, "shift")
    assert {t.get_text() for t in axes.texts} == {"target", "shift"}
