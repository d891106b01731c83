#!/usr/bin/env python3
"""MRC to VDB with mrcfile and pyopenvdb, the way it is done without vdbgeo: a peer for scripts/bench.

Usage: peer_mrc2vdb.py IN.mrc OUT.vdb [THRESHOLD]
Exit code 77 where the two packages are not installed. Axes are put in x, y, z order, as mrc2vdb does.
"""
import sys

try:
    import mrcfile
    import numpy
    import pyopenvdb
except ImportError:
    sys.exit(77)


def main(source, target, threshold=None):
    with mrcfile.mmap(source, mode="r") as file:
        values = file.data
        step = float(file.voxel_size.x) or 1.0
        # A background that no sample has keeps every voxel active.
        background = -3.0e38 if threshold is None else float(threshold)
        if threshold is not None:
            values = numpy.maximum(values, numpy.float32(background))
        values = numpy.ascontiguousarray(values.transpose(2, 1, 0), dtype=numpy.float32)
    grid = pyopenvdb.FloatGrid(background)
    grid.name = "density"
    grid.copyFromArray(values)
    grid.transform = pyopenvdb.createLinearTransform(voxelSize=step)
    pyopenvdb.write(target, grids=[grid])


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    main(*sys.argv[1:])
