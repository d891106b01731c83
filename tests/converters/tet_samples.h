// Tetrahedra made in code, for the tests of their files.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>

#include "converters/tet_file.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::test {

/// n³ cells of 6 tetrahedra each (around the cell's diagonal), with points that no decimal of few digits
/// tells. region(x, y, z) of a cell; 0 leaves it out.
template <class Region>
TetMesh cell_tets(int n, const Region& region) {
    TetMesh mesh;
    const auto id = [&](const Vec3i& p) {
        return static_cast<VertexId>((p.z() * (n + 1) + p.y()) * (n + 1) + p.x());
    };
    for (int z = 0; z <= n; ++z)
        for (int y = 0; y <= n; ++y)
            for (int x = 0; x <= n; ++x)
                mesh.points.emplace_back(x + 0.1 * std::sin(y + 2.0 * z), y * (1 / 3.0) - 1e-7,
                                         z * std::sqrt(2.0) + 1e5);
    std::array<int, 3> axes{0, 1, 2};
    for (int z = 0; z < n; ++z)
        for (int y = 0; y < n; ++y)
            for (int x = 0; x < n; ++x) {
                if (region(x, y, z) == 0) continue;
                do {
                    const Vec3i a(x, y, z), b = a + Vec3i::Unit(axes[0]), c = b + Vec3i::Unit(axes[1]),
                                            d = a + Vec3i::Ones();
                    Tetrahedron t{id(a), id(b), id(c), id(d)};
                    mesh.tets.push_back(t);
                    if (tet_determinant(mesh, mesh.tets.size() - 1) < 0)
                        std::swap(mesh.tets.back()[2], mesh.tets.back()[3]);
                    mesh.regions.push_back(region(x, y, z));
                } while (std::next_permutation(axes.begin(), axes.end()));
            }
    set_faces(mesh);
    return mesh;
}

/// Two regions, 3 and 7, that lie against each other and take turns in the order of tetrahedra, and a point
/// that belongs to nothing.
inline TetMesh two_regions(int n = 3) {
    TetMesh mesh = cell_tets(n, [](int x, int y, int) { return x + y < 2 ? 3 : 7; });
    mesh.points.emplace_back(1e-300, -0.0, 12345.678901234567);
    return mesh;
}

inline double volume_of(const TetMesh& mesh) {
    double sum = 0;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) sum += tet_determinant(mesh, t) / 6;
    return sum;
}

/// The same points to the last bit, tetrahedra, regions and faces.
inline void expect_same(const TetMesh& found, const TetMesh& expected) {
    ASSERT_EQ(found.points.size(), expected.points.size());
    for (std::size_t i = 0; i < found.points.size(); ++i)
        EXPECT_EQ(std::memcmp(&found.points[i], &expected.points[i], sizeof(Vec3d)), 0) << i;
    EXPECT_EQ(found.tets, expected.tets);
    ASSERT_EQ(found.tets.size(), expected.tets.size());
    for (std::size_t t = 0; t < found.tets.size(); ++t) ASSERT_EQ(found.region(t), expected.region(t)) << t;
    EXPECT_EQ(found.faces, expected.faces);
    EXPECT_EQ(found.face_regions, expected.face_regions);
}

/// What the refusal of `content` says behind the file's name; a note where it is not refused.
inline std::string tet_refusal(const std::string& content, const std::string& name) {
    const TempFolder folder;
    write_bytes(folder / name, content);
    try {
        read_tets(folder / name);
    } catch (const InvalidInput& error) {
        const std::string text = error.what(), prefix = (folder / name).string() + ": ";
        EXPECT_EQ(text.find('\n'), text.npos) << text;
        EXPECT_EQ(text.substr(0, prefix.size()), prefix);
        return text.substr(std::min(prefix.size(), text.size()));
    }
    return "(not refused)";
}

/// Reads a file of this content.
inline TetMesh tets_in(const std::string& content, const std::string& name) {
    const TempFolder folder;
    write_bytes(folder / name, content);
    return read_tets(folder / name);
}

}  // namespace vdbgeo::test
