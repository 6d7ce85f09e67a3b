"""Times over sizes as an SVG picture: a panel for each kind of work, both axes logarithmic."""

import math
from xml.sax.saxutils import escape

from peers.data import known

OURS = "#1b6ca8"
COLOURS = {"OctoMap": "#c0504d", "OpenVDB": "#6a994e", "gdal_merge.py": "#d08c2e", "gdal_translate, not compressed": "#a8a8a8"}
OTHER = "#7f7f7f"
WIDTH, HEIGHT, LEFT, TOP, RIGHT, BOTTOM = 300, 220, 54, 28, 10, 34
LEGEND = 15


class Panel:
    def __init__(self, title, series, x, y):
        self.title, self.series, self.x, self.y = title, series, x, y
        times = [t for points in series.values() for _, t in points]
        cells = [c for points in series.values() for c, _ in points]
        self.low, self.high = math.floor(math.log10(min(times))), math.ceil(math.log10(max(times)))
        self.high += self.high == self.low
        self.first, self.last = math.log10(min(cells)), math.log10(max(cells))

    def at(self, cells, seconds):
        right = (math.log10(cells) - self.first) / max(self.last - self.first, 1e-9)
        up = (math.log10(seconds) - self.low) / (self.high - self.low)
        return (self.x + LEFT + right * (WIDTH - LEFT - RIGHT), self.y + HEIGHT - BOTTOM - up * (HEIGHT - TOP - BOTTOM))

    def svg(self):
        out = [f'<text x="{self.x + LEFT}" y="{self.y + 16}" font-weight="bold">{escape(self.title)}</text>']
        for power in range(self.low, self.high + 1):
            _, y = self.at(10**self.first, 10**power)
            out.append(f'<line x1="{self.x + LEFT}" x2="{self.x + WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}" stroke="#dddddd"/>')
            out.append(f'<text x="{self.x + LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{label(power)}</text>')
        for cells in sorted({c for points in self.series.values() for c, _ in points}):
            x, _ = self.at(cells, 10**self.low)
            out.append(f'<text x="{x:.1f}" y="{self.y + HEIGHT - BOTTOM + 16}" text-anchor="middle">{cells / 1e6:g} M</text>')
        for k, (name, points) in enumerate(self.series.items()):
            colour, width = (OURS, 2.5) if k == 0 else (COLOURS.get(name, OTHER), 1.4)
            places = [self.at(*p) for p in points]
            path = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
            out.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width}"/>')
            out += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{width + 0.8}" fill="{colour}"/>' for x, y in places]
            y = self.y + HEIGHT + k * LEGEND
            out.append(f'<line x1="{self.x + LEFT}" x2="{self.x + LEFT + 18}" y1="{y - 4}" y2="{y - 4}" stroke="{colour}" stroke-width="{width}"/>')
            out.append(f'<text x="{self.x + LEFT + 24}" y="{y}">{escape(name)}</text>')
        return out


def label(power):
    return {-3: "1 ms", -2: "10 ms", -1: "0.1 s", 0: "1 s", 1: "10 s", 2: "100 s", 3: "1000 s"}.get(power, f"1e{power} s")


def sizes_svg(curves, tools):
    """`curves`: by work, size and name seconds. `tools` names ours in each."""
    panels, names = [], 0
    for k, (work, by_size) in enumerate((w, s) for w, s in curves.items() if len(s) > 1 and w in tools):
        series = {}
        for size, taken in by_size.items():
            for name, seconds in taken.items():
                series.setdefault(tools[work] if name == "ours" else name, []).append((known(size), seconds))
        names = max(names, len(series))
        panels.append((work, series, k))
    columns = 3
    row = HEIGHT + names * LEGEND + 16
    height = row * ((len(panels) + columns - 1) // columns)
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH * columns + LEGEND} {height}" width="{WIDTH * columns + LEGEND}" height="{height}" '
           'font-family="sans-serif" font-size="11">', '<rect width="100%" height="100%" fill="white"/>']
    for work, series, k in panels:
        out += Panel(work, series, WIDTH * (k % columns), row * (k // columns)).svg()
    return "\n".join([*out, "</svg>"]) + "\n"
