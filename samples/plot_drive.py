#!/usr/bin/env python3
"""Draws the cells of a drive over time, as the paper's figure does, from the statistics of drive-map.

    drive-map --stats drive.csv
    samples/plot_drive.py drive.csv drive.svg
"""

import csv
import sys

WIDTH, HEIGHT = 860, 300
LEFT, RIGHT, TOP, BOTTOM = 62, 12, 26, 40
MAX_CELLS = 700_000
REFERENCE_CELLS = 640_000  # Buerkle et al. 2020, in the setting the paper compares with
COLOURS = {"parking": "#f6e3b4", "road": "#cfe6cf"}


def read(path):
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    if not rows or "semantics_cells" not in rows[0]:
        sys.exit(f"plot_drive.py: error: '{path}' holds no statistics of drive-map")
    return rows


def phases(rows):
    """(profile, first, last time) for each stretch of one profile."""
    out = []
    for row in rows:
        time = float(row["time_s"])
        if out and out[-1][0] == row["profile"]:
            out[-1][2] = time
        else:
            if out:
                out[-1][2] = time
            out.append([row["profile"], time, time])
    return out


def draw(rows):
    begin, end = float(rows[0]["time_s"]), float(rows[-1]["time_s"])

    def x(time):
        return LEFT + (WIDTH - LEFT - RIGHT) * (time - begin) / max(end - begin, 1e-9)

    def y(cells):
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * min(cells / MAX_CELLS, 1)

    def line(points, style):
        text = " ".join(f"{px:.1f},{py:.1f}" for px, py in points)
        return f'<polyline points="{text}" fill="none" stroke-width="1.5" {style}/>'

    def text(px, py, words, anchor="middle"):
        return f'<text x="{px:.1f}" y="{py:.1f}" text-anchor="{anchor}">{words}</text>'

    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}"'
        ' font-family="sans-serif" font-size="12">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
    ]
    for profile, first, last in phases(rows):
        colour = COLOURS.get(profile, "#eeeeee")
        out.append(
            f'<rect x="{x(first):.1f}" y="{TOP}" width="{x(last) - x(first):.1f}"'
            f' height="{HEIGHT - TOP - BOTTOM}" fill="{colour}"/>'
        )
        out.append(text(x((first + last) / 2), TOP + 16, profile))
    for cells in range(0, MAX_CELLS + 1, 100_000):
        out.append(line([(LEFT, y(cells)), (WIDTH - RIGHT, y(cells))], 'stroke="#bbbbbb" opacity="0.5"'))
        out.append(text(LEFT - 6, y(cells) + 4, f"{cells // 1000}k", "end"))
    for time in range(int(begin) // 50 * 50, int(end) + 1, 50):
        if time >= begin:
            out.append(text(x(time), HEIGHT - BOTTOM + 16, str(time)))
    out.append(text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 6, "time [s]"))
    step = max(1, len(rows) // 465)
    curves = [
        ("Buerkle et al. 2020", [(begin, REFERENCE_CELLS), (end, REFERENCE_CELLS)], "#777777", "6 4"),
        ("occupancy", [(float(r["time_s"]), int(r["occupancy_cells"])) for r in rows[::step]], "#c0392b", ""),
        ("semantics", [(float(r["time_s"]), int(r["semantics_cells"])) for r in rows[::step]], "#2471a3", ""),
    ]
    for place, (name, points, colour, dashes) in enumerate(curves):
        style = f'stroke="{colour}" stroke-dasharray="{dashes}"' if dashes else f'stroke="{colour}"'
        out.append(line([(x(time), y(cells)) for time, cells in points], style))
        at = LEFT + 10 + 190 * place
        out.append(line([(at, TOP - 12), (at + 24, TOP - 12)], style))
        out.append(text(at + 30, TOP - 8, name, "start"))
    return "\n".join(out + ["</svg>", ""])


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    try:
        picture = draw(read(sys.argv[1]))
        with open(sys.argv[2], "w") as file:
            file.write(picture)
    except OSError as error:
        sys.exit(f"plot_drive.py: error: {error}")


main()
