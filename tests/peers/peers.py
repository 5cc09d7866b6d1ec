"""Times other implementations of the same computation on the same frames: float C, fringes, OpenCV, NumPy.

    peers.py FRAMES BENCHMARKS

FRAMES is the folder that `fringed-lab bench --frames` writes, BENCHMARKS the folder that `fringed-lab bench --out` writes: times are
given in multiples of the fastest of its decoders of whole sets, and its kernels are in the same table. The table is printed and
written to BENCHMARKS as peers.json and peers.md.

Processor time of the process on one thread, medians of nine, frame sets rotating through more than 200 MB.
"""

import argparse
import ctypes
import json
import os
import pathlib
import platform
import statistics
import subprocess
import tempfile
import time
import warnings

for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[threads] = "1"

import cv2  # noqa: E402
import fringes  # noqa: E402
import numpy as np  # noqa: E402

ROUNDS = 9
ROTATION_BYTES = 210_000_000
LEAST_MODULATION = 16
MAX_RESIDUAL = 0.40
RIGHT = 0.05  # turns; seven sigma of the noise in the frames


# What the loop of float.c is vectorised with, and with which instructions.
FLAGS = ["-O3", "-fno-math-errno", "-fno-trapping-math"]
INSTRUCTIONS = [["-mavx2", "-mfma"], ["-march=native"]] if platform.machine() == "x86_64" else [["-march=native"]]


class FloatC:
    """float.c, built by `cc` for these instructions. Results go to arrays that are allocated once, as ours do."""

    def __init__(self, instructions, ratios, size):
        source = pathlib.Path(__file__).with_name("float.c")
        with tempfile.TemporaryDirectory() as folder:
            library = f"{folder}/float.so"
            flags = [*FLAGS, *instructions, "-shared", "-fPIC"]
            subprocess.run(["cc", *flags, "-o", library, source, "-lm"], check=True)
            self.decode = ctypes.CDLL(library).decode
        self.factor = ctypes.c_float(ratios[1] / ratios[0])
        self.phase, self.modulation = np.ones((2, *size), np.float32)

    def __call__(self, frames):
        pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in (frames, self.phase, self.modulation)]
        pixels = ctypes.c_size_t(self.phase.size)
        self.decode(pointers[0], pixels, self.factor, *pointers[1:])
        return self.phase


class Numpy:
    """The textbook's formulas on whole arrays in one precision."""

    def __init__(self, ratios, kind):
        self.ratios, self.kind = ratios, kind

    def __call__(self, frames):
        phase, bad = None, np.zeros(frames.shape[1:], bool)
        coarser = None
        for level, ratio in enumerate(self.ratios):
            shifts = frames[4 * level : 4 * level + 4].astype(self.kind)
            s, c = shifts[0] - shifts[2], shifts[1] - shifts[3]
            wrapped = np.arctan2(s, c) * self.kind(1 / (2 * np.pi))
            bad |= np.hypot(s, c) < self.kind(2 * LEAST_MODULATION)
            if phase is None:
                phase = wrapped - np.floor(wrapped + self.kind(0.03))
            else:
                turns = phase * self.kind(ratio / coarser) - wrapped
                order = np.rint(turns)
                bad |= np.abs(turns - order) > self.kind(MAX_RESIDUAL)
                phase = wrapped + order
            coarser = ratio
        phase[bad] = np.nan
        return phase


def opencv(ratios):
    """The same with OpenCV's functions where there is one."""

    def decode(frames):
        phase, bad, coarser = None, None, None
        for level, ratio in enumerate(ratios):
            i0, i1, i2, i3 = frames[4 * level : 4 * level + 4]
            s = cv2.subtract(i0, i2, dtype=cv2.CV_32F)
            c = cv2.subtract(i1, i3, dtype=cv2.CV_32F)
            modulation, angle = cv2.cartToPolar(c, s)
            wrapped = cv2.multiply(angle, 1 / (2 * np.pi))
            weak = cv2.compare(modulation, 2.0 * LEAST_MODULATION, cv2.CMP_LT)
            bad = weak if bad is None else cv2.bitwise_or(bad, weak)
            if phase is None:
                # The angle is 0 to 1 turn; a phase that noise has moved below 0 is wrapped back.
                above = cv2.compare(wrapped, 0.97, cv2.CMP_GT)
                phase = cv2.subtract(wrapped, 1.0, mask=above, dst=wrapped.copy())
            else:
                turns = cv2.scaleAdd(phase, ratio / coarser, cv2.multiply(wrapped, -1.0))
                order = np.rint(turns)
                residual = cv2.compare(cv2.absdiff(turns, order), MAX_RESIDUAL, cv2.CMP_GT)
                bad = cv2.bitwise_or(bad, residual)
                phase = cv2.add(wrapped, order)
            coarser = ratio
        phase[bad != 0] = np.nan
        return phase

    return decode


def package(ratios, size, finest):
    """The package fringes, set up for our frames: it uses a cosine, with shifts in the opposite direction."""
    height, width = size
    decoder = fringes.Fringes()
    decoder.X, decoder.Y, decoder.D, decoder.axes = width, height, 1, [1]
    decoder.K, decoder.N, decoder.p0 = len(ratios), 4, 0
    decoder.v = [finest * ratio for ratio in ratios]

    def decode(frames):
        # It divides by the fractional part of its frequencies, and warns about it in every call.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            x = np.asarray(decoder.decode(frames, bmin=LEAST_MODULATION, threads=1).x)
        return x.squeeze() * (finest / width)

    return decode


def reordered(frames):
    order = [4 * level + shift for level in range(len(frames) // 4) for shift in (1, 0, 3, 2)]
    return np.ascontiguousarray(frames[order][..., None])


def measured(decode, frames):
    """Median and least processor time of one set of frames, ns per pixel."""
    sets = [frames.copy() for _ in range(-(-ROTATION_BYTES // frames.nbytes))]
    pixels = frames.shape[1] * frames.shape[2]
    times = []
    for at in range(ROUNDS):
        began = time.process_time_ns()
        decode(sets[at % len(sets)])
        times.append((time.process_time_ns() - began) / pixels)
    return statistics.median(times), min(times)


def rows_of(folder):
    """Name, median and least ns per pixel and share of right pixels of each peer."""
    sequence = json.loads((folder / "sequence.json").read_text())
    frames = np.stack([np.load(path) for path in sorted(folder.glob("frame-*.npy"))])
    truth = np.load(folder / "phase.npy")
    ratios = [frame["ratio"] for frame in sequence["frames"]][::4]
    finest = sequence["fringes"]
    cv2.setNumThreads(1)
    peers = [
        (f"float C, cc {' '.join(each)}", FloatC(each, ratios, truth.shape), frames)
        for each in INSTRUCTIONS
    ] + [
        ("OpenCV, its calls", opencv(ratios), frames),
        ("NumPy, f32", Numpy(ratios, np.float32), frames),
        ("NumPy, f64", Numpy(ratios, np.float64), frames),
        (
            f"fringes {fringes.__version__}",
            package(ratios, truth.shape, finest),
            reordered(frames),
        ),
    ]
    for name, decode, frames in peers:
        found = decode(frames)
        right = float(np.mean(np.abs(found - truth) <= RIGHT))
        median, least = measured(decode, frames)
        yield {"name": name, "ns_per_px": median, "least_ns_per_px": least, "right": right}


def table(rows, machine):
    lines = [
        f"### Peers\n\n{machine['processor']}, one thread; twelve frames of 8 bits, 3 levels of 4 shifts.\n",
        "| decoder | ns/px | least | × ours | right, % |",
        "|---|---:|---:|---:|---:|",
    ]
    for row in rows:
        lines.append(
            f"| {row['name']} | {row['ns_per_px']:.2f} | {row['least_ns_per_px']:.2f} "
            f"| {row['x_ours']:.1f} | {100 * row['right']:.1f} |"
        )
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("frames", type=pathlib.Path)
    parser.add_argument("benchmarks", type=pathlib.Path)
    arguments = parser.parse_args()
    results = json.loads((arguments.benchmarks / "benchmarks.json").read_text())
    floor = results["kernel"]["floor_ns_per_px"]
    rows = [
        {"name": f"ours: {name.removesuffix('_geometric_12')}", **row}
        for name, row in results["kernel"].items()
        if name.endswith("_geometric_12")
    ]
    rows += [{**row, "x_floor": row["ns_per_px"] / floor} for row in rows_of(arguments.frames)]
    ours = min(
        row["ns_per_px"]
        for row in rows
        if row["name"].startswith("ours: ") and not row["name"].endswith("last_frames_of")
    )
    for row in rows:
        row["x_ours"] = row["ns_per_px"] / ours
    rows.sort(key=lambda row: row["ns_per_px"])
    peers = table(rows, results["machine"])
    print(peers)
    (arguments.benchmarks / "peers.json").write_text(json.dumps(rows, indent=2) + "\n")
    (arguments.benchmarks / "peers.md").write_text(peers)


if __name__ == "__main__":
    main()
