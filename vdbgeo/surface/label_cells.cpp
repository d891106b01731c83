#include "vdbgeo/surface/label_cells.h"

namespace vdbgeo::label_cell {
namespace {

/// Union-find over the twelve edges; roots are the lowest numbers.
class EdgeSets {
 public:
    EdgeSets() {
        for (int e = 0; e < cell::edges; ++e) parent_[static_cast<std::size_t>(e)] = e;
    }
    int root(int e) const {
        while (parent_[static_cast<std::size_t>(e)] != e) e = parent_[static_cast<std::size_t>(e)];
        return e;
    }
    void join(int a, int b) {
        const int from = root(a), to = root(b);
        parent_[static_cast<std::size_t>(from > to ? from : to)] = from > to ? to : from;
    }

 private:
    std::array<int, cell::edges> parent_;
};

/// Joins those edges of each face that `counts` accepts and that lie on one line.
template <class Counts>
Sheets find_sheets(const Labels& labels, const Counts& counts) {
    EdgeSets sets;
    for (int f = 0; f < cell::faces; ++f) {
        const auto q = face_corners(f);
        const auto edge = [&](int k) {  // from corner k of the face to the next
            return edge_between(q[static_cast<std::size_t>(k % 4)], q[static_cast<std::size_t>((k + 1) % 4)]);
        };
        const FaceParts parts = face_parts(labels, f);
        if (parts.parted) {
            for (const int k : parts.cut)
                if (counts(edge(k)) && counts(edge(k + 3))) sets.join(edge(k), edge(k + 3));
            continue;
        }
        int before = Sheets::none;
        for (int k = 0; k < 4; ++k) {
            if (!counts(edge(k))) continue;
            if (before != Sheets::none) sets.join(before, edge(k));
            before = edge(k);
        }
    }
    Sheets out;
    for (int e = 0; e < cell::edges; ++e) {
        const auto at = static_cast<std::size_t>(e);
        out.of_edge[at] = Sheets::none;
        if (!counts(e)) continue;
        const int root = sets.root(e);
        out.of_edge[at] =
            root == e ? static_cast<std::int8_t>(out.count++) : out.of_edge[static_cast<std::size_t>(root)];
    }
    return out;
}

bool is_joined_before(float a, float b) { return a != 0 && (b == 0 || a < b); }

}  // namespace

FaceParts face_parts(const Labels& labels, int face) {
    const auto q = face_corners(face);
    const auto at = [&](int k) { return labels[static_cast<std::size_t>(q[static_cast<std::size_t>(k)])]; };
    const float a = at(0), b = at(1), c = at(2), d = at(3);
    FaceParts out;
    const int changes = (a != b) + (b != c) + (c != d) + (d != a);
    if (changes < 3) return out;
    if (changes == 4 && (a == c || b == d)) {
        out.parted = true;
        const bool join_even = a == c && (b != d || is_joined_before(a, b));
        out.cut = join_even ? std::array<int, 2>{1, 3} : std::array<int, 2>{0, 2};
        return out;
    }
    out.junction = true;
    return out;
}

Sheets sheets(const Labels& labels) {
    return find_sheets(labels, [&](int e) { return crossed(labels, e); });
}

Sheets sheets_of_label(const Labels& labels, float label) {
    return find_sheets(labels, [&](int e) {
        return (labels[static_cast<std::size_t>(cell::lower_corner(e))] == label) !=
               (labels[static_cast<std::size_t>(cell::upper_corner(e))] == label);
    });
}

}  // namespace vdbgeo::label_cell
