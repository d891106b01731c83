#include "vdbgeo/volume/part_field.h"

#include <algorithm>
#include <cmath>

namespace vdbgeo {

namespace {

// R / radius: 2 (1 - d²/R²)³ is 1 at d = radius.
const double support_ratio = 1 / std::sqrt(1 - std::cbrt(0.5));

}  // namespace

PartField::PartField(const std::vector<Part>& parts, int size, double voxel_size)
    : size_(size), parts_of_section_(static_cast<std::size_t>(size)) {
    const Vec3d centre = Vec3d::Constant((size - 1) / 2.0);
    parts_.reserve(parts.size());
    for (const Part& part : parts) {
        Prepared p;
        p.a = centre + part.a / voxel_size;
        p.ab = (part.b - part.a) / voxel_size;
        const double length = p.ab.norm();
        p.direction = length > 0 ? Vec3d(p.ab / length) : Vec3d(Vec3d::Zero());
        p.inv_length2 = length > 0 ? 1 / (length * length) : 0;
        p.support = part.radius * support_ratio / voxel_size;
        for (int axis = 0; axis < 3; ++axis) {
            const double end = p.a[axis] + p.ab[axis];
            const double low = std::ceil(std::min(p.a[axis], end) - p.support);
            const double high = std::floor(std::max(p.a[axis], end) + p.support) + 1;
            p.low[axis] = static_cast<int>(std::clamp<double>(low, 0, size));
            p.high[axis] = static_cast<int>(std::clamp<double>(high, 0, size));
        }
        for (int z = p.low.z(); z < p.high.z(); ++z)
            parts_of_section_[static_cast<std::size_t>(z)].push_back(
                static_cast<std::uint32_t>(parts_.size()));
        parts_.push_back(p);
    }
}

void PartField::add_row(const Prepared& part, int y, int z, float* row) const {
    // The row meets the infinite cylinder around the segment where k2 x² - 2 k1 x + k0 ≤ 0, x from part.a.
    const double py = y - part.a.y(), pz = z - part.a.z(), r2 = part.support * part.support;
    const Vec3d& n = part.direction;
    const double along = py * n.y() + pz * n.z();
    const double k2 = 1 - n.x() * n.x(), k1 = n.x() * along, k0 = py * py + pz * pz - along * along - r2;
    int begin = part.low.x(), end = part.high.x();
    if (k2 > 1e-6) {
        const double root2 = k1 * k1 - k2 * k0;
        if (root2 <= 0) return;
        const double middle = part.a.x() + k1 / k2, half = std::sqrt(root2) / k2;
        begin = static_cast<int>(std::clamp<double>(std::floor(middle - half), begin, end));
        end = static_cast<int>(std::clamp<double>(std::ceil(middle + half) + 1, begin, end));
    }
    const auto x0 = static_cast<float>(begin - part.a.x());
    const auto fy = static_cast<float>(py), fz = static_cast<float>(pz);
    const Vec3f ab = part.ab.cast<float>();
    const auto inv_length2 = static_cast<float>(part.inv_length2), inv_r2 = static_cast<float>(1 / r2);
    const float dot_yz = fy * ab.y() + fz * ab.z();
    float* out = row + begin;
    for (int k = 0; k < end - begin; ++k) {
        const float fx = x0 + static_cast<float>(k);
        const float t = std::min(std::max((fx * ab.x() + dot_yz) * inv_length2, 0.f), 1.f);
        const float dx = fx - t * ab.x(), dy = fy - t * ab.y(), dz = fz - t * ab.z();
        const float bell = std::max(1 - (dx * dx + dy * dy + dz * dz) * inv_r2, 0.f);
        out[k] += 2 * bell * bell * bell;
    }
}

void PartField::rows(int z, int y0, int y1, float* out) const {
    const std::size_t width = static_cast<std::size_t>(size_);
    const std::size_t count = static_cast<std::size_t>(y1 - y0) * width;
    std::fill(out, out + count, 0.f);
    for (const std::uint32_t index : parts_of_section_[static_cast<std::size_t>(z)]) {
        const Prepared& part = parts_[index];
        for (int y = std::max(y0, part.low.y()); y < std::min(y1, part.high.y()); ++y)
            add_row(part, y, z, out + static_cast<std::size_t>(y - y0) * width);
    }
    for (std::size_t i = 0; i < count; ++i) {
        const float s2 = out[i] * out[i];
        out[i] = s2 / (1 + s2);
    }
}

double part_density(const std::vector<Part>& parts, const Vec3d& p) {
    double sum = 0;
    for (const Part& part : parts) {
        const Vec3d ab = part.b - part.a;
        const double length2 = ab.squaredNorm();
        const double t = length2 > 0 ? std::clamp((p - part.a).dot(ab) / length2, 0.0, 1.0) : 0.0;
        const double support = part.radius * support_ratio;
        const double bell = std::max(0.0, 1 - (p - part.a - t * ab).squaredNorm() / (support * support));
        sum += 2 * bell * bell * bell;
    }
    return sum * sum / (1 + sum * sum);
}

}  // namespace vdbgeo
