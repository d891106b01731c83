#include "vdbgeo/measure/grid_shifts.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/jet_fit.h"
#include "vdbgeo/measure/patch_fit.h"
#include "vdbgeo/measure/vertex_patch.h"

namespace vdbgeo {
namespace {

constexpr std::size_t block = 1 << 11;
constexpr double sag_reach = 2.5;  // steps: enough points for the seven unknowns, and little of the surface
constexpr double mask_reach = 4;   // steps: over the terraces of a mask
constexpr double most_shift = 0.25;  // steps; the error is at most ⅛ h² f_aa/|∇f|, and that ratio below 2/h
constexpr double hold = 1e-3;        // weight of the mesh's ν: about half of what a patch knows of its own
constexpr std::size_t samples = 2000;

class SagFit {
 public:
    SagFit(const FitSurface& surface, const SamplingLattice& lattice)
        : surface_(surface),
          lattice_(lattice),
          patch_(surface.mesh(), surface.neighbours()),
          step_(lattice.step.mean()) {}

    struct Result {
        Mat3d shape;  // the shape operator, as a matrix of space
        double nu;
        Vec3d normal;
    };

    /// `nu` is held with a weight; with none it is free.
    bool fit(VertexId v, double nu, double weight_of_nu, Result& out) {
        constexpr int unknowns = 7;
        std::array<std::array<double, unknowns>, unknowns> a{};
        std::array<double, unknowns> b{};
        const Vec3d normal = surface_.normal(v).cast<double>();
        if (!(normal.squaredNorm() > 0)) return false;
        const TangentFrame frame(normal.normalized());
        const double radius = sag_reach * step_, scale = 1 / radius;
        const Vec3d centre = surface_.point(v);
        double weights = 0;
        for (const auto& m : patch_.ball(v, radius)) {
            const Vec3d n = surface_.normal(m.vertex).cast<double>();
            const double facing = frame.z.dot(n);
            if (!(facing > 0)) continue;
            const Vec3d p = scale * frame.local(surface_.point(m.vertex) - centre);
            const double window = std::max(0.0, 1 - p.squaredNorm()), w = window * window * facing;
            const LatticePlace place = lattice_.place(surface_.mesh().points[m.vertex]);
            double sag = 0, x = 0, y = 0, across = 0;
            if (place.axis >= 0) {
                sag = place.along * scale * scale;
                x = frame.x[place.axis], y = frame.y[place.axis], across = n[place.axis];
            }
            // S_aa of the quadric is −(2 c₃ x² + 2 c₄ x y + 2 c₅ y²) along the axis's part (x, y) in the
            // plane.
            const std::array<double, unknowns> f{1,
                                                 p[0],
                                                 p[1],
                                                 p[0] * p[0] + sag * x * x,
                                                 p[0] * p[1] + sag * x * y,
                                                 p[1] * p[1] + sag * y * y,
                                                 -0.5 * sag * across * across};
            for (std::size_t i = 0; i < unknowns; ++i) {
                const double g = w * f[i];
                for (std::size_t j = 0; j <= i; ++j) a[i][j] += g * f[j];
                b[i] += g * p[2];
            }
            weights += w;
        }
        const double edge = step_ * scale, prior = weight_of_nu * weights * edge * edge * edge * edge;
        a[6][6] += prior;
        b[6] += prior * nu * radius;
        if (!solve_positive<unknowns>(a, b, 1e-10)) return false;
        const double w = std::sqrt(1 + b[1] * b[1] + b[2] * b[2]);
        Mat3d axes;
        axes << frame.x, frame.y, frame.z;
        Mat3d shape = Mat3d::Zero();
        shape.topLeftCorner<2, 2>() << -2 * b[3], -b[4], -b[4], -2 * b[5];
        out.shape = scale / w * axes * shape * axes.transpose();
        out.nu = b[6] * scale;
        out.normal = frame.world(Vec3d(-b[1], -b[2], 1) / w);
        return std::isfinite(out.nu) && out.shape.allFinite();
    }

 private:
    const FitSurface& surface_;
    const SamplingLattice& lattice_;
    VertexPatch patch_;
    double step_;
};

double median_nu(const FitSurface& surface, const SamplingLattice& lattice) {
    const std::size_t count = surface.mesh().points.size(), every = count / samples + 1;
    std::vector<double> all((count + every - 1) / every, std::nan(""));
    tbb::enumerable_thread_specific<SagFit> fits([&] { return SagFit(surface, lattice); });
    parallel_blocks(all.size(), 64, [&](std::size_t begin, std::size_t end) {
        SagFit& fit = fits.local();
        SagFit::Result r;
        for (std::size_t i = begin; i < end; ++i)
            if (fit.fit(static_cast<VertexId>(i * every), 0, 0, r)) all[i] = r.nu;
    });
    all.erase(std::remove_if(all.begin(), all.end(), [](double x) { return std::isnan(x); }), all.end());
    if (all.empty()) return 0;
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
    std::nth_element(all.begin(), middle, all.end());
    return *middle;
}

}  // namespace

Array<Vec3f> interpolation_shifts(const FitSurface& surface, const SamplingLattice& lattice) {
    const double nu = median_nu(surface, lattice);
    Array<Vec3f> shifts(surface.mesh().points.size());
    tbb::enumerable_thread_specific<SagFit> fits([&] { return SagFit(surface, lattice); });
    parallel_blocks(shifts.size(), block, [&](std::size_t begin, std::size_t end) {
        SagFit& fit = fits.local();
        SagFit::Result r;
        for (std::size_t i = begin; i < end; ++i) {
            shifts[i].setZero();
            const LatticePlace place = lattice.place(surface.mesh().points[i]);
            if (place.axis < 0 || !fit.fit(static_cast<VertexId>(i), nu, hold, r)) continue;
            const int a = place.axis;
            const double off = -0.5 * place.along * (r.shape(a, a) + r.nu * r.normal[a] * r.normal[a]);
            if (std::abs(off) < most_shift * lattice.step[a]) shifts[i] = (-off * r.normal).cast<float>();
        }
    });
    return shifts;
}

bool joins_nodes(const TriMesh& mesh, const SamplingLattice& lattice) {
    for (const Vec3f& p : mesh.points)
        if (lattice.place(p).axis >= 0) return false;
    std::size_t along = 0, slanted = 0;
    for (const Triangle& t : mesh.triangles) {
        const Vec3d a = mesh.points[t[0]].cast<double>();
        Vec3d edges[3] = {mesh.points[t[1]].cast<double>() - a, mesh.points[t[2]].cast<double>() - a, {}};
        edges[2] = edges[1] - edges[0];
        for (const Vec3d& e : edges) along += e.cwiseQuotient(lattice.step).cwiseAbs().sum() < 1.5;
        slanted +=
            (edges[0].cross(edges[1]).cwiseAbs().array() > 1e-3 * lattice.step.squaredNorm()).count() > 1;
    }
    return 20 * along > mesh.triangles.size() && 20 * slanted > mesh.triangles.size();
}

Array<Vec3f> mask_shifts(const FitSurface& surface, const SamplingLattice& lattice) {
    Array<Vec3f> shifts(surface.mesh().points.size());
    tbb::enumerable_thread_specific<PatchFit> fits([&] { return PatchFit(surface); });
    parallel_blocks(shifts.size(), block, [&](std::size_t begin, std::size_t end) {
        PatchFit& fit = fits.local();
        FittedCurvature k;
        for (std::size_t i = begin; i < end; ++i) {
            const auto v = static_cast<VertexId>(i);
            Vec3d n = surface.normal(v).cast<double>();
            if (fit.ball(v, mask_reach * lattice.step.mean(), 2, k)) n = k.normal;
            shifts[i] = (0.5 * n.cwiseProduct(lattice.step).cwiseAbs().maxCoeff() * n).cast<float>();
        }
    });
    return shifts;
}

}  // namespace vdbgeo
