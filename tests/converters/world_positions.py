"""Where some voxels of map files lie, found without vdbgeo.

world_positions.py FILE... prints a line for each of some voxels of each file that it can read:
FILE <tab> i j k <tab> x y z <tab> value: the index along x, y, z, the position in Å, the value.

The header is decoded here, the data by numpy, and the cell by gemmi. Where gemmi can say where a voxel lies (it
knows NSTART and the cell, not ORIGIN), it has to agree. The origin follows the rule in docs/conventions.md.
"""
import bz2
import gzip
import sys

import gemmi
import numpy as np

TYPES = {0: "i1", 1: "i2", 2: "f4", 6: "u2", 12: "f2"}


def contents(path):
    data = open(path, "rb").read()
    if data[:2] == b"\x1f\x8b":
        return gzip.decompress(data)
    if data[:3] == b"BZh":
        return bz2.decompress(data)
    return data


def byte_order(data):
    def plausible(order):
        words = np.frombuffer(data[:76], order + "i4")
        return sum(0 < n < 1 << 20 for n in words[:3]) + 3 * (0 <= words[3] < 128) + sum(
            1 <= a <= 3 for a in words[16:19])

    return "<" if plausible("<") >= plausible(">") else ">"


class Map:
    def __init__(self, path):
        data = contents(path)
        order = byte_order(data)
        self.integers = integers = np.frombuffer(data[:1024], order + "i4")
        self.floats = floats = np.frombuffer(data[:1024], order + "f4")
        columns, rows, sections, self.mode = (int(n) for n in integers[:4])
        axes = [int(a) - 1 for a in integers[16:19]]
        if sorted(axes) != [0, 1, 2]:
            raise ValueError("axes")
        stored = np.dtype(order + TYPES[self.mode])
        begin = 1024 + int(integers[23])
        count = columns * rows * sections
        values = np.frombuffer(data, stored, count, begin).reshape(sections, rows, columns)
        # From section, row, column to x, y, z.
        self.values = np.transpose(values, [2 - axes.index(a) for a in range(3)])
        self.nstart = [int(integers[4 + axes.index(a)]) for a in range(3)]
        self.sampling = [int(m) for m in integers[7:10]]
        self.marked_as_scaled = int(integers[39]) == -128 and int(integers[40]) == 127
        # As gemmi: the orthogonal axes of a cell with x along X and y in the plane XY.
        lengths = [float(c) for c in floats[10:13]]
        angles = [float(a) for a in floats[13:16]]
        if any(a <= 0 or a >= 180 for a in angles):
            angles = [90.0] * 3
        size = self.values.shape
        if any(m <= 0 for m in self.sampling):
            self.sampling = list(size)
        # On an axis without a cell: 1 Å.
        for a in range(3):
            if lengths[a] / self.sampling[a] <= 1e-4:
                self.sampling[a] = size[a]
                lengths[a] = float(size[a])
        # M that makes one axis ten times the others, while N makes it like them: N it is.
        by_m = [c / m for c, m in zip(lengths, self.sampling)]
        for a in range(3):
            others = [by_m[b] for b in range(3) if b != a]
            if by_m[a] > 10 * max(others) and min(others) / 2 <= lengths[a] / size[a] <= 2 * max(others):
                self.sampling[a] = size[a]
        self.cell = gemmi.UnitCell(*lengths, *angles)
        self.origin = self.find_origin(data)

    def step(self, index):
        """From index 0 to this index, in Å."""
        p = self.cell.orthogonalize(gemmi.Fractional(*(i / m for i, m in zip(index, self.sampling))))
        return np.array([p.x, p.y, p.z])

    def find_origin(self, data):
        """The rule of docs/conventions.md: ORIGIN where it is set and plausible, else NSTART, else zero."""
        size = self.values.shape
        edge = max(np.linalg.norm(self.step([size[a] if a == b else 0 for a in range(3)])) for b in range(3))
        origin = np.array([float(v) for v in self.floats[49:52]])
        self.rule = "origin"
        if np.isfinite(origin).all() and origin.any() and np.abs(origin).max() <= 10 * edge:
            return origin
        start = self.nstart
        if any(abs(s) > 10 * max(n, m) for s, n, m in zip(start, size, self.sampling)):
            start = [0, 0, 0]
        self.rule = "nstart"
        position = self.step(start)
        if int(self.integers[24]) == 1 and data[208:211] == b"MAP":  # a skew transformation: its translation
            translation = np.array([float(v) for v in self.floats[34:37]])
            skew = np.array([float(v) for v in self.floats[25:34]]).reshape(3, 3)
            if np.isfinite(translation).all() and np.abs(skew - np.eye(3)).max() < 1e-3:
                self.rule = "skew"
                return position + translation
        return position

    def check_with_gemmi(self, path, index, position, value):
        crystal = 1 <= int(self.integers[22]) <= 230  # gemmi leaves out the cell of what is none
        if self.rule != "nstart" or not crystal or self.mode not in (0, 1, 2, 6) or path.endswith(".bz2"):
            return False
        if any(n > m for n, m in zip(self.values.shape, self.sampling)) or np.prod(self.sampling) > 2e7:
            return False
        if self.gemmi_map is None:
            self.gemmi_map = gemmi.read_ccp4_map(path)
            self.gemmi_map.setup(float("nan"))
        grid = self.gemmi_map.grid
        if [grid.nu, grid.nv, grid.nw] != self.sampling:
            return False
        at = [s + i for s, i in zip(self.nstart, index)]
        p = grid.get_position(*at)
        shift = np.array([p.x, p.y, p.z]) - position
        found = grid.get_value(*at)
        if np.abs(shift).max() > 1e-3 or not np.isclose(found, value, rtol=1e-6, atol=1e-12):
            raise SystemExit(f"{path}: gemmi has {found} at {p} for voxel {index}, expected {value} at {position}")
        return True

    gemmi_map = None


def main():
    by_gemmi = 0
    for path in sys.argv[1:]:
        try:
            m = Map(path)
        except (ValueError, KeyError, IndexError, OSError):
            continue
        if m.marked_as_scaled:
            continue
        nx, ny, nz = m.values.shape
        checked = False
        for i, j, k in [(0, 0, 0), (nx - 1, 0, 0), (0, ny - 1, 0), (0, 0, nz - 1), (nx - 1, ny - 1, nz - 1),
                        (nx // 2, ny // 3, nz // 4), (nx // 5, ny // 2, nz * 2 // 3)]:
            position = m.origin + m.step([i, j, k])
            value = float(m.values[i, j, k])
            try:
                checked |= m.check_with_gemmi(path, (i, j, k), position, value)
            except (RuntimeError, ValueError):
                pass  # a file that gemmi does not read
            print(path, f"{i} {j} {k}", "%.9g %.9g %.9g" % tuple(position), "%.9g" % value, sep="\t")
        by_gemmi += checked
    print(by_gemmi, file=sys.stderr)


main()
