"""The page: tables of figures, and the goals with their verdicts."""

from peers.measure import median


def show_time(seconds):
    if seconds < 0.1:
        return f"{seconds * 1000:.2f} ms" if seconds < 0.01 else f"{seconds * 1000:.1f} ms"
    return f"{seconds:.2f} s" if seconds < 10 else f"{seconds:.0f} s"


def show_ratio(ratio):
    return f"{ratio:.4f}" if ratio < 0.1 else f"{ratio:.2f}"


def pair_ratio(a, b):
    """Median of ratios of runs taken in turn; of medians where one was run more often."""
    return median([x / y for x, y in zip(a, b)]) if len(a) == len(b) else median(a) / median(b)


class Goal:
    """One line of the table of goals. `met` is None where nothing was measured."""

    def __init__(self, work, ours, against, peer, ratio, goal, met):
        self.cells = (work, ours, against, peer, ratio, goal)
        self.met = met

    @property
    def verdict(self):
        return {True: "met", False: "**missed**", None: "not measured"}[self.met]


class Page:
    def __init__(self):
        self.goals = []
        self.sections = []
        self.skipped = []

    def at_most(self, work, against, ours, peer, bound, show=show_time, goal=None, ratio=None):
        """ours <= bound x peer; `ratio` where it was taken pair by pair."""
        ratio = ours / peer if ratio is None else ratio
        self.goals.append(Goal(work, show(ours), against, show(peer), show_ratio(ratio), goal or f"<= {bound:g} x", ratio <= bound))

    def at_least(self, work, against, ours, peer, bound, ratio, show=str):
        self.goals.append(Goal(work, show(ours), against, show(peer), show_ratio(ratio), f">= {bound:g} x", ratio >= bound))

    def below(self, work, ours, bound, show=show_time, goal=None):
        self.goals.append(Goal(work, show(ours), "", "", "", goal or f"<= {show(bound)}", ours <= bound))

    def unmeasured(self, work, against, goal):
        self.goals.append(Goal(work, "", against, "", "", goal, None))

    def skip(self, what):
        self.skipped.append(what)

    def section(self, title, *lines):
        self.sections.append([f"## {title}", "", *lines, ""])

    def text(self, head, explained):
        missed = sum(g.met is False for g in self.goals)
        unmeasured = sum(g.met is None for g in self.goals)
        lines = [*head, "## Goals", "",
                 f"{sum(g.met is True for g in self.goals)} met, {missed} missed, {unmeasured} not measured in this run.", "",
                 *table(("work", "ours", "held against", "its figure", "ratio", "goal", ""),
                        [(*g.cells, g.verdict) for g in self.goals]), "", *explained, ""]
        for section in self.sections:
            lines += section
        if self.skipped:
            lines += ["## Left out", "", *[f"- {s}" for s in self.skipped], ""]
        return "\n".join(lines).rstrip() + "\n"

    def figures(self):
        return [{"cells": g.cells, "met": g.met} for g in self.goals]


def table(head, rows):
    def line(cells):
        return "| " + " | ".join(str(c) for c in cells) + " |"
    return [line(head), "|" + "---|" * len(head), *[line(row) for row in rows]]
