#include "vdbgeo/tet/map_projection.h"

#include <cmath>
#include <memory>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/surface/trilinear_field.h"

namespace vdbgeo {
namespace {

constexpr double difference = 0.2;  // half of the gradient's stencil, in voxels along each axis
constexpr double on_border = 1e-9;  // of a voxel

class Projection {
 public:
    Projection(const DensityMap& map, double isovalue)
        : grid_(map.grid),
          field_(map, isovalue),
          frame_(map.frame),
          to_index_(map.frame.axes.inverse()),
          voxel_(map.frame.voxel_size().minCoeff()),
          last_(map.frame.size.cast<double>() - Vec3d::Ones()) {}

    std::optional<Vec3d> operator()(const Vec3d& world) const {
        const Vec3d x = to_index_ * (world - frame_.origin);
        if (!x.allFinite()) return std::nullopt;
        const Vec3d in = frame_.bounded() ? Vec3d(x.cwiseMax(0).cwiseMin(last_)) : x;
        if (!((frame_.axes * (x - in)).norm() <= voxel_)) return std::nullopt;
        const Border border = border_of(in);
        const double value = field_(in);
        if (value == 0 || (value > 0 && border.any)) return frame_.to_world(border.snapped);
        const std::optional<Vec3d> crossing = search(border.snapped, value, border);
        const std::optional<Vec3d> wall = value > 0 ? nearest_wall(in) : std::nullopt;
        if (!wall && !crossing) return std::nullopt;
        const auto far = [&](const Vec3d& p) { return (frame_.axes * (p - in)).squaredNorm(); };
        return frame_.to_world(!crossing || (wall && far(*wall) < far(*crossing)) ? *wall : *crossing);
    }

 private:
    /// Along which axes a place is on the border of the box.
    struct Border {
        std::array<bool, 3> on{};
        bool any = false;
        Vec3d snapped;  ///< to the last bit
    };

    Border border_of(const Vec3d& in) const {
        Border border;
        border.snapped = in;
        for (int a = 0; frame_.bounded() && a < 3; ++a) {
            const double end = in[a] < 0.5 * last_[a] ? 0 : last_[a];
            if (std::abs(in[a] - end) > on_border) continue;
            border.on[static_cast<std::size_t>(a)] = border.any = true;
            border.snapped[a] = end;
        }
        return border;
    }

    std::optional<Vec3d> nearest_wall(const Vec3d& in) const {
        if (!frame_.bounded()) return std::nullopt;
        double nearest = voxel_;
        std::optional<Vec3d> best;
        for (int a = 0; a < 3; ++a)
            for (const double end : {0.0, last_[a]}) {
                // The foot of the perpendicular on the plane of index end along a.
                const Vec3d normal = to_index_.row(a).transpose();
                const double distance = std::abs(in[a] - end) / normal.norm();
                if (!(distance < nearest)) continue;
                Vec3d foot = in + to_index_ * ((end - in[a]) / normal.squaredNorm() * normal);
                foot[a] = end;
                if ((foot.array() < 0).any() || (foot.array() > last_.array()).any()) continue;
                nearest = distance, best = foot;
            }
        return best;
    }

    /// Unit length in the world, in index units, uphill; along the border where x is on it. Zero for none.
    Vec3d uphill(const Vec3d& x, const Border& border) const {
        Vec3d slope;
        Mat3d metric = frame_.axes.transpose() * frame_.axes;
        for (int a = 0; a < 3; ++a) {
            Vec3d low = x, high = x;
            low[a] -= difference, high[a] += difference;
            if (frame_.bounded()) low[a] = std::max(low[a], 0.0), high[a] = std::min(high[a], last_[a]);
            slope[a] = (field_(high) - field_(low)) / (high[a] - low[a]);
            if (!border.on[static_cast<std::size_t>(a)]) continue;
            slope[a] = 0;
            metric.row(a).setZero();
            metric.col(a).setZero();
            metric(a, a) = 1;
        }
        const Vec3d direction = metric.inverse() * slope;
        const double length = (frame_.axes * direction).norm();
        return std::isfinite(length) && length > 0 ? Vec3d(direction / length) : Vec3d(Vec3d::Zero());
    }

    /// Where the field along the gradient through x changes its sign first, in growing steps, at most a voxel
    /// away.
    std::optional<Vec3d> search(const Vec3d& x, double value, const Border& border) const {
        const Vec3d direction = (value > 0 ? -1 : 1) * uphill(x, border);
        if (direction.isZero(0)) return std::nullopt;
        double near = 0, at_near = value, step = 0.02 * voxel_;
        while (near < voxel_) {
            const double far = std::min(near + step, voxel_);
            const double at_far = field_(x + far * direction);
            if ((at_far > 0) != (value > 0))
                return x + root(x, direction, near, at_near, far, at_far) * direction;
            near = far, at_near = at_far, step *= 2;
        }
        return std::nullopt;
    }

    /// The Illinois variant of the false position; bisection where the field is not finite.
    double root(const Vec3d& x, const Vec3d& direction, double a, double at_a, double b, double at_b) const {
        for (int i = 0; i < 80 && std::abs(b - a) > 1e-12 * voxel_; ++i) {
            const bool finite = std::isfinite(at_a) && std::isfinite(at_b);
            const double c = finite ? b - at_b * (b - a) / (at_b - at_a) : 0.5 * (a + b);
            const double at_c = field_(x + c * direction);
            if (at_c == 0 || c == a || c == b) return c;
            if ((at_c > 0) != (at_b > 0))
                a = b, at_a = at_b;
            else
                at_a *= finite ? 0.5 : 1;
            b = c, at_b = at_c;
        }
        return b;
    }

    openvdb::FloatGrid::ConstPtr grid_;
    TrilinearField field_;
    Frame frame_;
    Mat3d to_index_;
    double voxel_;
    Vec3d last_;
};

}  // namespace

SurfaceProjection map_projection(const DensityMap& map, double isovalue) {
    if (!std::isfinite(isovalue)) throw InvalidInput("map projection: the isovalue is not a finite number");
    const auto projection = std::make_shared<const Projection>(map, isovalue);
    return [projection](const Vec3d& x) { return (*projection)(x); };
}

}  // namespace vdbgeo
