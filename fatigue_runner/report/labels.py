"""Labels beside points, each where it covers neither another label nor a point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE = 6.5  # pt
ADVANCE = 0.62  # mean width of a glyph over the size of the type (DejaVu Sans)
# Offsets from the point to the label's nearest corner [pt] and its alignment, the preferred one first.
PLACES = (
    (5.0, 2.5, "left"),
    (5.0, -7.5, "left"),
    (-5.0, 2.5, "right"),
    (-5.0, -7.5, "right"),
    (5.0, 10.0, "left"),
)

Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Label:
    """A text beside a point in data coordinates."""

    point: tuple[float, float]
    text: str
    colour: str
    bold: bool = False

    @property
    def width(self) -> float:
        """Estimated width [pt]."""
        return SIZE * ADVANCE * (1.12 if self.bold else 1.0) * len(self.text)


def draw_labels(axes: Axes, labels: Sequence[Label]) -> None:
    """Write every label at the first of PLACES that is free, at the first of all where none is.

    The figure is laid out first: free is what is free in print, not in data.
    """
    from matplotlib.patheffects import withStroke

    axes.get_figure(root=True).draw_without_rendering()  # type: ignore[union-attr]
    inch = 72.0 / axes.get_figure(root=True).dpi  # type: ignore[union-attr]
    spots = [tuple(inch * value for value in axes.transData.transform(label.point)) for label in labels]
    taken: list[Box] = [(x - 3.0, y - 3.0, x + 3.0, y + 3.0) for x, y in spots]
    for label, spot in zip(labels, spots, strict=True):
        boxes = [_box(spot, place, label.width) for place in PLACES]
        chosen = next(
            (i for i, box in enumerate(boxes) if not any(overlap(box, other) for other in taken)), 0
        )
        taken.append(boxes[chosen])
        dx, dy, align = PLACES[chosen]
        axes.annotate(
            label.text,
            label.point,
            xytext=(dx, dy),
            textcoords="offset points",
            ha=align,
            fontsize=SIZE,
            fontweight="bold" if label.bold else "normal",
            color=label.colour,
            # A white edge keeps the label readable where a line runs below it.
            path_effects=[withStroke(linewidth=1.8, foreground="white")],
        )


def _box(spot: tuple[float, ...], place: tuple[float, float, str], width: float) -> Box:
    x, y = spot[0] + place[0], spot[1] + place[1]
    left = x if place[2] == "left" else x - width
    return left, y, left + width, y + SIZE


def overlap(a: Box, b: Box) -> bool:
    """Whether two boxes (left, bottom, right, top) share an area."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
