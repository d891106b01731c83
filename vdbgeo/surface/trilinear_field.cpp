#include "vdbgeo/surface/trilinear_field.h"

#include <cmath>

#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo {
namespace {

using leaf::LowerNode;
using openvdb::Coord;

std::size_t hash(const Coord& c, int bits) {
    const auto part = [&](int a) {
        return static_cast<std::uint64_t>(static_cast<std::uint32_t>(c[a] >> bits));
    };
    std::uint64_t h =
        part(0) * 0x9E3779B97F4A7C15ull ^ part(1) * 0xC2B2AE3D27D4EB4Full ^ part(2) * 0x165667B19E3779F9ull;
    return static_cast<std::size_t>(h ^ h >> 29);
}

}  // namespace

TrilinearField::TrilinearField(const DensityMap& map, double isovalue)
    : tree_(map.grid->constTreePtr()),
      frame_(map.frame),
      isovalue_(static_cast<double>(static_cast<float>(isovalue))) {
    const double height = isovalue_ - map.statistics.min;
    lift_ = (height > 0 && std::isfinite(height) ? height : std::max(std::abs(isovalue_), 1e-30)) / 1024;
    std::vector<const LowerNode*> lower;
    tree_->getNodes(lower);
    nodes_.resize(lower.size());
    std::size_t slots = 4;
    while (slots < 4 * lower.size()) slots *= 2;
    slots_.assign(slots, -1);
    for (std::size_t n = 0; n < lower.size(); ++n) {
        Node& node = nodes_[n];
        node.origin = lower[n]->origin();
        node.samples.assign(LowerNode::NUM_VALUES, nullptr);
        node.tile.assign(LowerNode::NUM_VALUES, 0);
        for (auto it = lower[n]->cbeginValueAll(); it; ++it) node.tile[it.pos()] = *it;
        for (auto it = lower[n]->cbeginChildOn(); it; ++it) node.samples[it.pos()] = it->buffer().data();
        std::size_t s = hash(node.origin, node_bits) & (slots - 1);
        while (slots_[s] >= 0) s = (s + 1) & (slots - 1);
        slots_[s] = static_cast<std::int32_t>(n);
    }
}

const TrilinearField::Node* TrilinearField::find(const Coord& c) const {
    const Coord origin(c[0] & ~127, c[1] & ~127, c[2] & ~127);
    for (std::size_t s = hash(origin, node_bits) & (slots_.size() - 1); slots_[s] >= 0;
         s = (s + 1) & (slots_.size() - 1)) {
        const Node& node = nodes_[static_cast<std::size_t>(slots_[s])];
        if (node.origin == origin) return &node;
    }
    return nullptr;
}

double TrilinearField::value(const Coord& c) const {
    const Node* node = find(c);
    if (!node) return static_cast<double>(tree_->getValue(c));
    const auto b =
        static_cast<std::size_t>(((c[0] >> 3 & 15) << 8) | ((c[1] >> 3 & 15) << 4) | (c[2] >> 3 & 15));
    const float* in = node->samples[b];
    return static_cast<double>(in ? in[leaf::offset(c[0] & 7, c[1] & 7, c[2] & 7)] : node->tile[b]);
}

/// The samples at the corners of the cell at c, as cell_topology.h numbers them, minus the isovalue.
TrilinearField::Corners TrilinearField::corners(const Coord& c) const {
    Corners d;
    if ((c[0] & 7) < 7 && (c[1] & 7) < 7 && (c[2] & 7) < 7) {  // two cells of three lie in one leaf
        const Node* node = find(c);
        const auto b =
            static_cast<std::size_t>(((c[0] >> 3 & 15) << 8) | ((c[1] >> 3 & 15) << 4) | (c[2] >> 3 & 15));
        if (!node || !node->samples[b]) {
            d.fill(static_cast<double>(node ? node->tile[b] : tree_->getValue(c)));
        } else {
            const float* in = node->samples[b] + leaf::offset(c[0] & 7, c[1] & 7, c[2] & 7);
            for (std::size_t k = 0; k < 8; ++k)
                d[k] = static_cast<double>(in[(k & 1) * 64 + (k >> 1 & 1) * 8 + (k >> 2)]);
        }
    } else {
        for (int k = 0; k < 8; ++k)
            d[static_cast<std::size_t>(k)] = value(c.offsetBy(k & 1, k >> 1 & 1, k >> 2));
    }
    for (double& v : d) {
        v -= isovalue_;
        if (v == 0) v = lift_;
    }
    return d;
}

double TrilinearField::without_nan(const Corners& d, const Vec3d& t) {
    double sum = 0, lost = 0;
    for (std::size_t k = 0; k < 8; ++k) {
        const double weight =
            (k & 1 ? t.x() : 1 - t.x()) * (k & 2 ? t.y() : 1 - t.y()) * (k & 4 ? t.z() : 1 - t.z());
        if (std::isfinite(d[k]))
            sum += weight * d[k];
        else
            lost += d[k] > 0 ? 0 : weight;
    }
    return lost > 1.0 / 1024 ? -std::numeric_limits<double>::infinity() : sum;
}

double TrilinearField::operator()(const Vec3d& index, Cursor& cursor) const {
    constexpr double nothing = -std::numeric_limits<double>::infinity(), far = 0x1p30;
    Coord c;
    Vec3d t;
    const bool bounded = frame_.bounded();
    for (int a = 0; a < 3; ++a) {
        const double x = index[a];
        if (bounded) {
            if (!(x >= 0 && x <= frame_.size[a] - 1) || frame_.size[a] < 2) return nothing;
            c[a] = std::min(static_cast<int>(x), frame_.size[a] - 2);
        } else {
            if (!(std::abs(x) < far)) return static_cast<double>(tree_->background()) - isovalue_;
            c[a] = static_cast<int>(std::floor(x));
        }
        t[a] = x - c[a];
    }
    if (c != cursor.cell_) cursor.cell_ = c, cursor.corners_ = corners(c);
    const Corners& d = cursor.corners_;
    const auto mix = [](double p, double q, double w) { return p + (q - p) * w; };
    const double value = mix(mix(mix(d[0], d[1], t.x()), mix(d[2], d[3], t.x()), t.y()),
                             mix(mix(d[4], d[5], t.x()), mix(d[6], d[7], t.x()), t.y()), t.z());
    return std::isfinite(value) ? value : without_nan(d, t);
}

}  // namespace vdbgeo
