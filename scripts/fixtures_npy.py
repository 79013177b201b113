#!/usr/bin/env python3
"""Writes the arrays that `crates/arrays` is compared with (crates/arrays/tests/numpy_files.rs), as NumPy stores them.

    scripts/fixtures_npy.py [FOLDER]

Those in tests/data/npy were written by NumPy 2.4.6.
"""
import sys
from pathlib import Path

import numpy as np

FLOATS = [0.0, -0.0, 1.5, -2.25, float("inf"), float("nan")]


def arrays():
    """Name, array and version of the format."""
    for name in ["f4", "f8"]:
        yield name, np.array(FLOATS, dtype=f"<{name}").reshape(2, 3), (1, 0)
    for name in ["i1", "i2", "i4", "i8", "u1", "u4", "u8"]:
        limits = np.iinfo(name)
        yield name, np.array([limits.min, 0, 1, limits.max], dtype=f"<{name}"), (1, 0)
    yield "b1", np.array([[[True], [False]]]), (1, 0)
    yield "scalar", np.array(-7, dtype="<i2"), (1, 0)
    yield "empty", np.zeros((0, 7), dtype="<f4"), (1, 0)
    yield "version-2", np.array([1, 2, 3], dtype="<i4"), (2, 0)
    yield "version-3", np.array([1, 2, 3], dtype="<i4"), (3, 0)
    yield "column-major", np.asfortranarray(np.arange(6, dtype="<i4").reshape(2, 3)), (1, 0)
    yield "big-endian", np.array([1, 2, 3], dtype=">i4"), (1, 0)
    yield "half", np.array([1, 2, 3], dtype="<f2"), (1, 0)
    yield "text", np.array(["one", "two"]), (1, 0)
    yield "records", np.zeros(2, dtype=[("µ", "<f4"), ("count", "<i4")]), (3, 0)


folder = Path(sys.argv[1] if len(sys.argv) > 1 else "tests/data/npy")
folder.mkdir(parents=True, exist_ok=True)
for name, array, version in arrays():
    with open(folder / f"{name}.npy", "wb") as file:
        np.lib.format.write_array(file, array, version=version)
