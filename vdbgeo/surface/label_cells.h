// How the labels at a cell's eight corners part the cell: which of its crossed edges lie on one sheet. For
// label_surfaces and its tests.
#pragma once

#include <array>
#include <cstdint>

#include "vdbgeo/surface/cell_topology.h"

namespace vdbgeo::label_cell {

using Labels = std::array<float, cell::corners>;

/// The edge along `axis` whose lower corner is c, in the numbering of cell_topology.h.
constexpr int edge_along(int axis, int c) {
    const int first = axis == 0 ? 1 : 0, second = axis == 2 ? 1 : 2;
    return 4 * axis + ((c >> first & 1) | (c >> second & 1) << 1);
}
constexpr int edge_between(int c, int d) {
    const int low = c < d ? c : d, step = c < d ? d - c : c - d;
    return edge_along(step == 4 ? 2 : step - 1, low);
}
/// Corners of face 2·axis + side, one after another around it.
constexpr std::array<int, 4> face_corners(int face) {
    const int axis = face / 2, base = (face % 2) << axis, u = 1 << (axis + 1) % 3, v = 1 << (axis + 2) % 3;
    return {base, base + u, base + u + v, base + v};
}

inline bool crossed(const Labels& labels, int edge) {
    return labels[static_cast<std::size_t>(cell::lower_corner(edge))] !=
           labels[static_cast<std::size_t>(cell::upper_corner(edge))];
}

/// Where two equal labels lie diagonally across a face and the other two corners hold other labels, the two
/// are joined and each other corner is cut off by a line of its own. Where both diagonals are equal, the
/// label that is not 0 is joined, of two such the smaller. `cut` are places in face_corners.
struct FaceParts {
    bool parted = false;
    std::array<int, 2> cut{};
    bool junction = false;  ///< lines between three labels or more meet in the face
};
FaceParts face_parts(const Labels& labels, int face);

/// Sets of crossed edges that the lines in the faces join. Per edge its set, `none` where it is not crossed.
struct Sheets {
    static constexpr int none = -1;
    int count = 0;
    std::array<std::int8_t, cell::edges> of_edge{};
};
/// All labels together: the net has a vertex for each sheet.
Sheets sheets(const Labels& labels);
/// The sheets between one label and all others: closed loops of edges, within the sheets of all labels.
Sheets sheets_of_label(const Labels& labels, float label);

}  // namespace vdbgeo::label_cell
