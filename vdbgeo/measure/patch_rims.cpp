#include "vdbgeo/measure/patch_rims.h"

#include <algorithm>

#include "vdbgeo/core/vertex_faces.h"

namespace vdbgeo {
namespace {

/// Of the largest loop's area: what spans less is a pinhole.
constexpr double pinhole = 0.05;

struct Loop {
    std::uint32_t patch;
    double length;
    Vec3d area;
};

/// An edge that leaves a patch, as inner and outer end.
using Cut = std::uint64_t;
Cut cut_between(VertexId in, VertexId out) { return Cut{in} << 32 | out; }
VertexId inner(Cut cut) { return static_cast<VertexId>(cut >> 32); }
VertexId outer(Cut cut) { return static_cast<VertexId>(cut & 0xFFFFFFFFu); }

/// Part of a rim within a face, the patch on its left.
struct Step {
    Cut from, to;
    bool operator<(const Step& other) const { return from != other.from ? from < other.from : to < other.to; }
};

/// The steps through a face, one for each patch that has one or two of its corners.
void add_steps(const Triangle& t, const Array<std::uint32_t>& patch, std::vector<Step>& steps) {
    for (std::size_t k = 0; k < 3; ++k) {
        const VertexId a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3];
        const std::uint32_t pa = patch[a], pb = patch[b], pc = patch[c];
        if (pa != 0 && pa != pb && pa != pc) steps.push_back({cut_between(a, b), cut_between(a, c)});
        if (pa != 0 && pa == pb && pa != pc) steps.push_back({cut_between(b, c), cut_between(a, c)});
    }
}

}  // namespace

std::vector<PatchRim> patch_rims(const TriMesh& mesh, const Array<std::uint32_t>& patch, std::uint32_t count,
                                 const Array<double>& excess) {
    const MeshProperty* caps = mesh.find_face_property(cap_property);
    if (caps && caps->components != 1) caps = nullptr;
    std::vector<Step> steps;
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        const Triangle& t = mesh.triangles[f];
        if (patch[t[0]] == patch[t[1]] && patch[t[1]] == patch[t[2]]) continue;
        if (degenerate(t) || (caps && caps->values[f] > 0.5f)) continue;
        add_steps(t, patch, steps);
    }
    std::sort(steps.begin(), steps.end());
    std::vector<Cut> reached;  // by a step: what is not begins an open line
    for (const Step& s : steps) reached.push_back(s.to);
    std::sort(reached.begin(), reached.end());
    const auto place = [&](Cut cut) {
        const VertexId in = inner(cut), out = outer(cut);
        const double a = excess[in], b = excess[out];
        const double along = a <= 0 && b >= 0 && a < b ? -a / (b - a) : 0.5;
        const Vec3d p = mesh.points[in].cast<double>();
        return Vec3d(p + along * (mesh.points[out].cast<double>() - p));
    };
    std::vector<Loop> loops;
    std::vector<bool> done(steps.size(), false);
    const auto follow = [&](std::size_t first) {
        const Vec3d origin = place(steps[first].from);
        Vec3d at = origin, doubled = Vec3d::Zero();
        double length = 0;
        for (std::size_t s = first; s < steps.size() && !done[s];) {
            done[s] = true;
            const Cut cut = steps[s].to;
            const Vec3d next = place(cut);
            length += (next - at).norm();
            doubled += (at - origin).cross(next - origin);
            at = next;
            s = static_cast<std::size_t>(std::lower_bound(steps.begin(), steps.end(), Step{cut, 0}) -
                                         steps.begin());
            if (s < steps.size() && steps[s].from != cut) break;
        }
        loops.push_back({patch[inner(steps[first].from)] - 1, length, 0.5 * doubled});
    };
    for (std::size_t s = 0; s < steps.size(); ++s)
        if (!done[s] && !std::binary_search(reached.begin(), reached.end(), steps[s].from)) follow(s);
    for (std::size_t s = 0; s < steps.size(); ++s)
        if (!done[s]) follow(s);
    std::vector<PatchRim> rims(count);
    for (const Loop& loop : loops)
        if (loop.area.norm() > rims[loop.patch].mouth_A2.norm()) rims[loop.patch].mouth_A2 = loop.area;
    for (const Loop& loop : loops) {
        PatchRim& rim = rims[loop.patch];
        if (loop.area.norm() < pinhole * rim.mouth_A2.norm()) continue;
        ++rim.loops;
        rim.length_A += loop.length;
    }
    return rims;
}

}  // namespace vdbgeo
