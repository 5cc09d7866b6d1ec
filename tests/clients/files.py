#!/usr/bin/env python3
"""Opens the program's files with NumPy and zipfile: a measured recording and a taught recipe.

    python3 tests/clients/files.py target/release/fringed

Exits with a code other than 0 at the first broken promise. Needs only numpy.
"""

import io
import json
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy

# Measured errors may exceed the predicted ones by this factor, because the prediction includes only noise and not the averaging of a slope within a pixel.
RMS_OVER_SIGMA = 1.2


def expect(condition, promise):
    if not condition:
        sys.exit(f"broken promise: {promise}")


def measured(program, folder):
    recording, out = folder / "recording", folder / "out"
    subprocess.run([program, "record", recording, "--quiet"], check=True)
    subprocess.run([program, "measure", recording, "--out", out, "--quiet"], check=True)
    report = json.loads((out / "report.json").read_text())
    maps = {name: numpy.load(out / f"{name}.npy") for name in ("phase", "height", "sigma")}
    truth = numpy.load(recording / "truth" / "height.npy")
    whole = numpy.load(recording / "truth" / "class.npy") == 2
    for name, values in maps.items():
        expect(values.dtype == numpy.float32 and values.shape == truth.shape, f"{name}.npy is f32 [rows, columns]")
        count = numpy.count_nonzero(~numpy.isnan(values))
        expect(count == report["resolved"], f"{name}.npy is known at the {report['resolved']} resolved pixels ({count})")
    scored = whole & ~numpy.isnan(maps["height"])
    error = (maps["height"].astype(float) - truth)[scored]
    rms, predicted = numpy.sqrt(numpy.mean(error**2)), report["sigma_mm"]
    expect(report["score"]["gross"] == 0 and abs(rms - report["score"]["rms_mm"]) < 1e-5, "NumPy finds the report's error")
    expect(rms <= RMS_OVER_SIGMA * predicted, f"the error of {rms:.4f} mm is the predicted {predicted:.4f} mm")
    header, _, body = (out / "cloud.ply").read_bytes().partition(b"end_header\n")
    vertex = numpy.dtype([("xyz", "<f4", 3), ("intensity", "u1"), ("sigma", "<f4")])
    points = numpy.frombuffer(body, vertex)
    expect(f"element vertex {len(points)}\n".encode() in header, "the cloud has as many vertices as it says")
    heights = maps["height"][~numpy.isnan(maps["height"])]
    expect(numpy.array_equal(points["xyz"][:, 2], heights), "z of the cloud's points are the heights")
    return rms, predicted


def recipe(program, folder):
    state = folder / "state"
    subprocess.run([program, "demo", "--exit", "--quiet", "--state", state,
                    "--modbus", "127.0.0.1:0", "--http", "127.0.0.1:0"], check=True)
    with zipfile.ZipFile(state / "recipes" / "0001.recipe") as archive:
        expect(archive.testzip() is None, "the recipe's checksums hold")
        manifest = json.loads(archive.read("recipe.json"))
        rows_and_columns = {key: (manifest[key]["height"], manifest[key]["width"]) for key in ("camera", "projector")}
        rows, columns = rows_and_columns["camera"]
        others = {
            "phase_function.npy": rows_and_columns["projector"],
            "golden_signal.npy": (rows, 2 * columns),
            "sequence_offset.npy": ((len(manifest["sequences"]) - 1) * rows, columns),
        }
        arrays = [name for name in archive.namelist() if name.endswith(".npy")]
        expect(set(others) <= set(arrays), f"the recipe holds {', '.join(others)}")
        for name in arrays:
            size = others.get(name, (rows, columns))
            shape = numpy.load(io.BytesIO(archive.read(name))).shape
            expect(shape == size, f"{name} is {size}, not {shape}")
    return len(arrays)


def main():
    with tempfile.TemporaryDirectory() as folder:
        rms, predicted = measured(sys.argv[1], Path(folder))
        count = recipe(sys.argv[1], Path(folder))
    print(f"NumPy: heights with an error of {rms:.4f} mm, {predicted:.4f} mm predicted; {count} arrays of a recipe")


if __name__ == "__main__":
    main()
