"""Draw SVG by hand: small files that look the same everywhere, with the numbers behind each mark in its tooltip."""

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Final

INK: Final = "#222222"
GREY: Final = "#8a8a8a"
FAINT: Final = "#dddddd"
COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
"""For simulations, in order; most colour-blind eyes tell them apart (Okabe and Ito 2008). The recording is in ink."""
DASHES: Final = ("", "6 3", "2 2", "8 3 2 3")
"""Line styles, one for each time the colours have been used up."""
_COLD_TO_WARM: Final = ((33, 102, 172), (146, 197, 222), (247, 247, 247), (244, 165, 130), (178, 24, 43))

Point = tuple[float, float]


def colour(k: int) -> str:
    """Colour of the k-th simulation."""
    return COLOURS[k % len(COLOURS)]


def dash(k: int) -> str:
    """Line style of the k-th simulation."""
    return DASHES[k // len(COLOURS) % len(DASHES)]


def cold_to_warm(t: float) -> str:
    """Colour for -1 (blue) over 0 (almost white) to 1 (red); grey for NaN."""
    if math.isnan(t):
        return "#bbbbbb"
    x = (min(max(t, -1.0), 1.0) + 1.0) / 2.0 * (len(_COLD_TO_WARM) - 1)
    k = min(int(x), len(_COLD_TO_WARM) - 2)
    mixed = (round(a + (x - k) * (b - a)) for a, b in zip(_COLD_TO_WARM[k], _COLD_TO_WARM[k + 1], strict=True))
    return "#" + "".join(f"{value:02x}" for value in mixed)


def ticks(low: float, high: float, about: int = 5) -> list[float]:
    """Round numbers (1, 2 or 5 times a power of ten apart) within ``low`` to ``high``."""
    span = high - low
    if not (math.isfinite(span) and span > 0):
        return [low]
    raw = span / max(about, 1)
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= raw * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [0.0 if k == 0 else k * step for k in range(first, last + 1)]


@dataclass
class Drawing:
    """An SVG picture of ``width`` by ``height`` [px]; y runs down."""

    width: float
    height: float
    _parts: list[str] = field(default_factory=list)

    def line(self, a: Point, b: Point, stroke: str = INK, width: float = 1.0, dashes: str = "") -> None:
        """A straight line."""
        self._add(
            "line", x1=a[0], y1=a[1], x2=b[0], y2=b[1], stroke=stroke, stroke_width=width, stroke_dasharray=dashes
        )

    def curve(self, points: Iterable[Point], stroke: str, width: float = 1.6, dashes: str = "", tip: str = "") -> None:
        """Straight pieces through points; a point with NaN breaks the line."""
        pieces: list[list[Point]] = [[]]
        for point in points:
            if any(math.isnan(v) for v in point):
                pieces.append([])
            else:
                pieces[-1].append(point)
        for piece in pieces:
            if len(piece) > 1:
                d = "M" + "L".join(f"{_number(x)},{_number(y)}" for x, y in piece)
                self._add(
                    "path", tip, d=d, fill="none", stroke=stroke, stroke_width=width, stroke_dasharray=dashes,
                    stroke_linejoin="round",
                )  # fmt: skip

    def area(self, points: Sequence[Point], fill: str, opacity: float = 0.15) -> None:
        """A filled polygon; points with NaN are left out."""
        kept = [f"{_number(x)},{_number(y)}" for x, y in points if not (math.isnan(x) or math.isnan(y))]
        if len(kept) > 2:
            self._add("polygon", points=" ".join(kept), fill=fill, fill_opacity=opacity)

    def dot(self, at: Point, fill: str, radius: float = 2.5, tip: str = "") -> None:
        """A filled circle; nothing for NaN."""
        if not any(math.isnan(v) for v in at):
            self._add("circle", tip, cx=at[0], cy=at[1], r=radius, fill=fill)

    def ring(self, centre: Point, radius: float, stroke: str = FAINT) -> None:
        """A circle that is not filled."""
        self._add("circle", cx=centre[0], cy=centre[1], r=radius, fill="none", stroke=stroke)

    def half_ring(self, centre: Point, radius: float, stroke: str = FAINT) -> None:
        """The lower half of a circle."""
        x, y = centre
        start, end = f"{_number(x - radius)},{_number(y)}", f"{_number(x + radius)},{_number(y)}"
        self._add("path", d=f"M{start}A{_number(radius)},{_number(radius)} 0 0 0 {end}", fill="none", stroke=stroke)

    def box(self, corner: Point, width: float, height: float, fill: str, tip: str = "") -> None:
        """A filled rectangle."""
        self._add("rect", tip, x=corner[0], y=corner[1], width=width, height=height, fill=fill)

    def text(
        self, at: Point, words: str, *, size: float = 11, anchor: str = "start", fill: str = INK, turned: bool = False,
        bold: bool = False,
    ) -> None:  # fmt: skip
        """Words; ``anchor`` is start, middle or end; turned ones read upwards."""
        x, y = at
        attributes = {"x": x, "y": y, "font_size": size, "text_anchor": anchor, "fill": fill}
        if turned:
            attributes["transform"] = f"rotate(-90 {_number(x)} {_number(y)})"
        if bold:
            attributes["font_weight"] = "600"
        self._parts.append(f"<text{_attributes(attributes)}>{escape(words)}</text>")

    def _add(self, tag: str, tip: str = "", **attributes: object) -> None:
        inside = f"<title>{escape(tip)}</title></{tag}>" if tip else ""
        self._parts.append(f"<{tag}{_attributes(attributes)}{'>' + inside if tip else '/>'}")

    def render(self, title: str) -> str:
        """The picture as text; ``title`` is what a screen reader says."""
        w, h = _number(self.width), _number(self.height)
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {w} {h}" width="{w}" height="{h}" role="img" '
            f'font-family="system-ui, sans-serif"><title>{escape(title)}</title>'
            f'<rect width="{w}" height="{h}" fill="white"/>{"".join(self._parts)}</svg>\n'
        )


def _number(value: float) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".")


def _attributes(given: dict[str, object]) -> str:
    made = ""
    for name, value in given.items():
        if value != "":
            text = _number(value) if isinstance(value, int | float) else escape(str(value))
            made += f' {name.replace("_", "-")}="{text}"'
    return made


@dataclass
class Frame:
    """A pair of axes in a drawing: the box [px] and what it spans."""

    drawing: Drawing
    left: float
    top: float
    width: float
    height: float
    x: tuple[float, float]
    y: tuple[float, float]

    def at(self, x: float, y: float) -> Point:
        """Where a point of data lies in the drawing."""
        return (
            self.left + (x - self.x[0]) / (self.x[1] - self.x[0]) * self.width,
            self.top + self.height - (y - self.y[0]) / (self.y[1] - self.y[0]) * self.height,
        )

    def axes(
        self, x_label: str, y_label: str, *, x_ticks: Sequence[tuple[float, str]] | None = None, slanted: bool = False
    ) -> None:
        """Grid, ticks and labels; ``x_ticks`` are places with words instead of round numbers."""
        d, bottom, right = self.drawing, self.top + self.height, self.left + self.width
        for y in ticks(*self.y):
            at = self.at(self.x[0], y)[1]
            d.line((self.left, at), (right, at), FAINT)
            d.text((self.left - 5, at + 4), f"{y:g}", anchor="end")
        for x, words in x_ticks if x_ticks is not None else [(x, f"{x:g}") for x in ticks(*self.x, about=9)]:
            at = self.at(x, self.y[0])[0]
            d.line((at, bottom), (at, bottom + 4), GREY)
            if slanted:
                d.text((at + 4, bottom + 8), words, anchor="end", size=9, turned=True)
            else:
                d.text((at, bottom + 16), words, anchor="middle")
        d.line((self.left, bottom), (right, bottom), GREY)
        d.text((self.left + self.width / 2, bottom + (46 if slanted else 32)), x_label, anchor="middle", fill=GREY)
        d.text((self.left - 42, self.top + self.height / 2), y_label, anchor="middle", fill=GREY, turned=True)

    def level(self, y: float, stroke: str = GREY) -> None:
        """A line across at one value, where the frame shows it."""
        if self.y[0] <= y <= self.y[1]:
            self.drawing.line(self.at(self.x[0], y), self.at(self.x[1], y), stroke)


def legend(
    drawing: Drawing, at: Point, order: Sequence[str], shown: Collection[str], *, recording: bool = True
) -> None:
    """Names of the recording and of the simulations that are ``shown``, in a row; ``order`` gives their colours."""
    x, y = at
    entries = [("recording", INK, "")] if recording else []
    entries += [(name, colour(k), dash(k)) for k, name in enumerate(order) if name in shown]
    for name, stroke, dashes in entries:
        words = shortened(name, 40)
        drawing.line((x, y - 4), (x + 18, y - 4), stroke, 2.0, dashes)
        drawing.text((x + 23, y), words)
        x += 23 + 6.2 * len(words) + 18


def shortened(text: str, most: int) -> str:
    """``text``, cut with an ellipsis where it is longer than ``most`` letters."""
    return text if len(text) <= most else text[: most - 1] + "…"
