"""Draws what `fringed-lab bench --out DIR` and `fringed-lab experiment --out DIR` measured, as SVG and PNG beside their CSV.

    plots.py DIR

Run time against error from accuracy.csv; error over unresolved pixels, coverage and residuals from experiments.csv; and of each part what
the methods projected, saw and measured.
"""

import collections
import csv
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib.colors import LightSource  # noqa: E402

FIXED, PAPER, BETTER = "#1f5fa8", "#c2410c", "#15803d"
# What the figures of the paper show of a part; of the others the error over unresolved pixels.
OVER_FRINGES = {
    "flowerpot": ("coverage", 100, "resolved share of the lit pixels, %"),
    "tube": ("fit_residual_mm", 1, "RMS distance from the cylinder, mm"),
}
# A point is on the front if its error is at least this much smaller than that of every faster one.
SMALLER = 0.995


def rows_of(path):
    with path.open() as lines:
        return list(csv.DictReader(lines))


def mean(rows, keys, values):
    """The means of rows that agree in some keys, in the order of the first ones."""
    groups = collections.defaultdict(list)
    for row in rows:
        groups[tuple(row[key] for key in keys)].append(row)
    for key, members in groups.items():
        average = {name: np.mean([float(row[name] or "nan") for row in members]) for name in values}
        yield {**dict(zip(keys, key)), **average}


def plot(title, x, y):
    figure, axes = plt.subplots(figsize=(7.6, 6.2), layout="constrained")
    axes.set(title=title, xlabel=x, ylabel=y)
    axes.grid(color="#e4e4e4")
    axes.set_axisbelow(True)
    return figure, axes


def labels(axes, points):
    """Words beside points (x, y, words, colour); those of points that lie on each other stand in one line."""
    placed = []
    for x, y, words, colour in points:
        at = axes.transData.transform((x, y))
        near = next((one for one in placed if one[3] == colour and abs(one[0][0] - at[0]) < 40 and abs(one[0][1] - at[1]) < 9), None)
        if near:
            near[2].append(words)
        else:
            placed.append((at, (x, y), [words], colour))
    for _, place, words, colour in placed:
        axes.annotate(", ".join(words), place, xytext=(5, 4), textcoords="offset points", fontsize=8, color=colour)


def save(figure, path):
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)
    print(path)


def time_against_error(folder):
    rows = rows_of(folder / "accuracy.csv")
    keys = ["sequence", "frames", "bits", "implementation", "skipping"]
    points = [one for one in mean([row for row in rows if row["part"] != "mean"], keys, ["ns_per_px", "rms_mm"]) if one["rms_mm"] > 0]
    front = []
    for point in sorted(points, key=lambda one: one["ns_per_px"]):
        if not front or point["rms_mm"] < SMALLER * front[-1]["rms_mm"]:
            front.append(point)
    figure, axes = plot("Run time against error, mean over the parts", "processor time of the decoding, ns per pixel", "RMS error of the height, mm")
    axes.set_xscale("log")
    for name in dict.fromkeys(point["implementation"] for point in points):
        of = [point for point in points if point["implementation"] == name and point not in front]
        axes.plot([one["ns_per_px"] for one in of], [one["rms_mm"] for one in of], "o", label=name)
    axes.plot([one["ns_per_px"] for one in front], [one["rms_mm"] for one in front], "o-", color=BETTER, label="Pareto front")
    axes.set_ylim(bottom=0)
    words = lambda one: f"{one['sequence']}-{one['frames']}, {one['bits']} bit, {one['implementation']}{', skipping' * (one['skipping'] == 'true')}"
    labels(axes, [(one["ns_per_px"], one["rms_mm"], words(one), BETTER) for one in front])
    axes.legend()
    save(figure, folder / "accuracy.svg")


def errors(part, optics, rows):
    figure, axes = plot(f"{part}, {optics} optics", "unresolvable pixels", "RMS error, mm")
    points = []
    for prefix, name, colour, line, before, after in [
        ("fixed-", "fixed pitch, n_F", FIXED, "o-", "n_F ", ""),
        ("paper-", "paper's adaptive, p_I", PAPER, "o", "p_I ", ""),
        ("better-", "better adaptive, frames", BETTER, "o", "", " frames"),
    ]:
        of = [row for row in rows if row["method"].startswith(prefix)]
        axes.plot([row["unresolved_px"] for row in of], [row["rms_mm"] for row in of], line, color=colour, label=name)
        points += [(row["unresolved_px"], row["rms_mm"], before + row["method"].removeprefix(prefix) + after, colour) for row in of]
    axes.set_ylim(bottom=0)
    labels(axes, points)
    axes.legend()
    return figure


def over_fringes(part, rows, column, factor, words):
    figure, axes = plot(part, "fringes over the projector's width, n_F", words)
    for optics, line in zip(dict.fromkeys(row["optics"] for row in rows), ("o-", "o--")):
        of = [row for row in rows if row["optics"] == optics and row["method"].startswith("fixed-")]
        axes.plot([float(row["method"].removeprefix("fixed-")) for row in of], [factor * row[column] for row in of], line, color=FIXED, label=f"fixed, {optics}")
        for method, colour in (("paper-5", PAPER), ("better-12", BETTER)):
            for row in rows:
                if row["optics"] == optics and row["method"] == method:
                    axes.axhline(factor * row[column], color=colour, linestyle="--", label=f"{method}, {optics}")
    axes.legend()
    return figure


def experiments(folder):
    rows = rows_of(folder / "experiments.csv")
    values = ["unresolved_px", "rms_mm", "coverage", "fit_residual_mm"]
    means = list(mean(rows, ["part", "optics", "method"], values))
    for part in dict.fromkeys(row["part"] for row in means):
        of = [row for row in means if row["part"] == part]
        optics = list(dict.fromkeys(row["optics"] for row in of))
        if part in OVER_FRINGES:
            save(over_fringes(part, of, *OVER_FRINGES[part]), folder / f"{part}-{optics[0]}.svg")
            continue
        for word in optics:
            save(errors(part, word, [row for row in of if row["optics"] == word]), folder / f"{part}-{word}.svg")


def middle(picture, size=512):
    top, left = (max(0, (length - size) // 2) for length in picture.shape[:2])
    return picture[top : top + size, left : left + size]


def shown(folder):
    """What methods projected, saw and measured: a row each."""
    views = collections.defaultdict(list)
    for path in sorted(folder.glob("*-height.npy")):
        stem = path.name.removesuffix("-height.npy")
        part, optics, method = stem.split("-", 2)
        views[f"{part}-{optics}"].append((method, stem))
    for name, rows in views.items():
        figure, axes = plt.subplots(len(rows), 3, figsize=(12, 4.2 * len(rows)), squeeze=False, layout="constrained")
        for (method, stem), line in zip(rows, axes):
            height = np.load(folder / f"{stem}-height.npy")
            shade = LightSource(azdeg=200, altdeg=40).hillshade(height, vert_exag=2)
            for one, picture, words in zip(
                line,
                (plt.imread(folder / f"{stem}-pattern.png"), plt.imread(folder / f"{stem}-frame.png"), np.where(np.isnan(height), np.nan, shade)),
                ("pattern, its middle", "camera, finest level", "measured heights, shaded"),
            ):
                one.imshow(middle(picture), cmap="gray")
                one.set_title(f"{method}: {words}", fontsize=10)
                one.axis("off")
        save(figure, folder / f"{name}.png")


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    folder = pathlib.Path(sys.argv[1])
    if (folder / "accuracy.csv").exists():
        time_against_error(folder)
    if (folder / "experiments.csv").exists():
        experiments(folder)
        shown(folder)


if __name__ == "__main__":
    main()
