#include "vdbgeo/measure/vertex_samples.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/vertex_faces.h"

namespace vdbgeo {
namespace {

constexpr std::size_t grain = 1 << 12;
constexpr double none = std::numeric_limits<double>::quiet_NaN();
/// What rounding of coordinates may put outside the box, in voxels.
constexpr double forgiven = 1e-3;
constexpr int most_steps = 1000;

/// The trilinear interpolant of a map; one for each thread.
class Interpolant {
 public:
    explicit Interpolant(const DensityMap& map) : reader_(map.grid->getConstAccessor()), frame_(map.frame) {}

    double operator()(const Vec3d& index) {
        openvdb::Coord c;
        Vec3d t;
        for (int a = 0; a < 3; ++a)
            if (!split(index[a], a, c[a], t[a])) return none;
        // Corners without a weight are not read: they may be outside, or no number.
        double sum = 0;
        for (int k = 0; k < 8; ++k) {
            const double weight =
                (k & 1 ? t.x() : 1 - t.x()) * (k & 2 ? t.y() : 1 - t.y()) * (k & 4 ? t.z() : 1 - t.z());
            if (weight != 0)
                sum += weight * static_cast<double>(reader_.getValue(c.offsetBy(k & 1, k >> 1 & 1, k >> 2)));
        }
        return std::isfinite(sum) ? sum : none;
    }

 private:
    bool split(double x, int axis, int& cell, double& t) const {
        constexpr double far = 1 << 30;
        if (frame_.bounded()) {
            const double last = frame_.size[axis] - 1;
            if (!(x >= -forgiven && x <= last + forgiven)) return false;
            x = std::clamp(x, 0.0, last);
        } else if (!(std::abs(x) < far)) {
            return false;
        }
        cell = static_cast<int>(std::floor(x));
        t = x - cell;
        return true;
    }

    openvdb::FloatGrid::ConstAccessor reader_;
    const Frame& frame_;
};

/// Unit outward normals; zero where there is none.
Array<Vec3f> outward_normals(const TriMesh& mesh) {
    const VertexFaces faces(mesh);
    const MeshProperty* caps = mesh.find_face_property(cap_property);
    if (caps && caps->components != 1) caps = nullptr;
    Array<Vec3f> normals(mesh.points.size());
    parallel_for(normals.size(), grain, [&](std::size_t v) {
        const auto id = static_cast<VertexId>(v);
        Vec3d kept = Vec3d::Zero(), capped = Vec3d::Zero();
        for (const std::uint32_t* f = faces.begin(id); f != faces.end(id); ++f) {
            const Triangle& t = mesh.triangles[*f];
            const Vec3d a = mesh.points[t[0]].cast<double>();
            const Vec3d area =
                (mesh.points[t[1]].cast<double>() - a).cross(mesh.points[t[2]].cast<double>() - a);
            (caps && caps->values[*f] > 0.5f ? capped : kept) += area;
        }
        const Vec3d sum = kept.norm() > 0 ? kept : capped;
        normals[v] = sum.norm() > 0 ? Vec3f(sum.normalized().cast<float>()) : Vec3f(Vec3f::Zero());
    });
    return normals;
}

/// The places of one mean: at offset + (i − half) step along the normal.
struct Ladder {
    int half;  ///< steps to each side; 0: one place
    double step;

    Ladder(double length, const Frame& frame)
        : half(static_cast<int>(std::ceil(length / frame.voxel_size().minCoeff()))),
          step(half > 0 ? length / (2 * half) : 0) {}
    double weight(int i) const { return half == 0 ? 1 : (std::abs(i) == half ? 0.5 : 1) / (2.0 * half); }
};

}  // namespace

void VertexSampleOptions::check() const {
    if (!std::isfinite(offset))
        throw InvalidInput(fmt::format("vertex samples: the offset is {} Å, expected a number", offset));
    if (!(mean_over >= 0 && std::isfinite(mean_over)))
        throw InvalidInput(
            fmt::format("vertex samples: the mean is over {} Å, expected 0 or more", mean_over));
}

MeshProperty sample_at_vertices(const TriMesh& mesh, const DensityMap& map, const std::string& name,
                                const VertexSampleOptions& options, const Progress& progress) {
    options.check();
    if (name.empty()) throw InvalidInput("vertex samples: the property's name is empty");
    if (options.mean_over > 0.5 * most_steps * map.frame.voxel_size().minCoeff())
        throw InvalidInput(fmt::format("vertex samples: a mean over {} Å, more than {} voxels of {:.4g} Å",
                                       options.mean_over, most_steps / 2, map.frame.voxel_size().minCoeff()));
    check(mesh, "vertex samples");
    const Mat3d to_index = map.frame.axes.inverse();
    const Ladder ladder(options.mean_over, map.frame);
    const bool along_normal = options.offset != 0 || ladder.half > 0;
    const Array<Vec3f> normals = along_normal ? outward_normals(mesh) : Array<Vec3f>();

    MeshProperty out{name, 1, std::vector<float>(mesh.points.size())};
    std::atomic<std::size_t> done{0};
    parallel_blocks(out.values.size(), grain, [&](std::size_t begin, std::size_t end) {
        Interpolant value_at(map);
        for (std::size_t v = begin; v < end; ++v) {
            const Vec3d at = to_index * (mesh.points[v].cast<double>() - map.frame.origin);
            const Vec3d along =
                along_normal ? Vec3d(to_index * normals[v].cast<double>()) : Vec3d(Vec3d::Zero());
            double sum = along_normal && along.isZero(0) ? none : 0;
            for (int i = -ladder.half; i <= ladder.half && !std::isnan(sum); ++i)
                sum += ladder.weight(i) * value_at(at + (options.offset + i * ladder.step) * along);
            out.values[v] = static_cast<float>(sum);
        }
        const std::size_t now = done.fetch_add(end - begin, std::memory_order_relaxed) + end - begin;
        progress.report(static_cast<double>(now) / static_cast<double>(out.values.size()));
    });
    return out;
}

}  // namespace vdbgeo
