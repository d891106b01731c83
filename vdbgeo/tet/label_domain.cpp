#include "vdbgeo/tet/label_domain.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/surface/label_surfaces.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;

constexpr double least_margin = 0.05;
/// Binomials once and twice, B and B², as 2B − B².
constexpr std::array<double, 5> once = {0, 1.0 / 4, 2.0 / 4, 1.0 / 4, 0},
                                twice = {1.0 / 16, 4.0 / 16, 6.0 / 16, 4.0 / 16, 1.0 / 16};
double kernel(int x, int y, int z) {
    const auto product = [&](const std::array<double, 5>& b) {
        return b[static_cast<std::size_t>(x)] * b[static_cast<std::size_t>(y)] *
               b[static_cast<std::size_t>(z)];
    };
    return 2 * product(once) - product(twice);
}
constexpr double largest_label = 2147483647.0;

/// 21 bits a coordinate.
std::uint64_t key_of(const Coord& c) {
    const auto bits = [](int v) { return static_cast<std::uint64_t>(v + (1 << 20)) & 0x1FFFFF; };
    return bits(c.x()) << 42 | bits(c.y()) << 21 | bits(c.z());
}
Coord coord_of(std::uint64_t key) {
    const auto part = [&](int shift) { return static_cast<int>(key >> shift & 0x1FFFFF) - (1 << 20); };
    return {part(42), part(21), part(0)};
}
std::size_t hash(std::uint64_t key) {
    key *= 0x9E3779B97F4A7C15ull;
    return static_cast<std::size_t>(key ^ key >> 32);
}
Coord floor_coord(const Vec3d& p) {
    return {static_cast<int>(std::floor(p.x())), static_cast<int>(std::floor(p.y())),
            static_cast<int>(std::floor(p.z()))};
}

const DensityMap& checked(const DensityMap& map) {
    if (!is_label_map(map))
        throw InvalidInput("tetrahedra of labels need a segmentation: whole numbers, one a label");
    return map;
}

/// A voxel keeps what it is: of a margin that is negative or small the sign is turned.
double kept(double margin) {
    return margin < least_margin ? std::max(std::abs(margin), least_margin) : margin;
}

/// The share of each label around a voxel.
class Shares {
 public:
    void clear() { shares_.clear(); }
    void add(std::int32_t label, double weight) {
        for (auto& [known, sum] : shares_)
            if (known == label) {
                sum += weight;
                return;
            }
        shares_.emplace_back(label, weight);
    }
    /// By how much the background outweighs the labels together.
    double outside() const {
        double margin = 0;
        for (const auto& [label, sum] : shares_) margin += label == 0 ? sum : -sum;
        return margin;
    }
    double of(std::int32_t label) const {
        for (const auto& [known, sum] : shares_)
            if (known == label) return sum;
        return 0;
    }
    /// By how much a label outweighs every other one.
    double ahead(std::int32_t own) const {
        double other = 0;
        for (const auto& [label, sum] : shares_)
            if (label != own && label != 0) other = std::max(other, sum);
        return of(own) - other;
    }

 private:
    std::vector<std::pair<std::int32_t, double>> shares_;
};

/// Sets that are joined one by one.
class Groups {
 public:
    explicit Groups(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0u); }
    std::uint32_t root(std::uint32_t n) {
        while (parent_[n] != n) n = parent_[n] = parent_[parent_[n]];
        return n;
    }
    void join(std::uint32_t a, std::uint32_t b) {
        a = root(a);
        b = root(b);
        parent_[std::max(a, b)] = std::min(a, b);
    }

 private:
    std::vector<std::uint32_t> parent_;
};

}  // namespace

LabelDomain::LabelDomain(const DensityMap& map, const std::vector<std::int64_t>& wanted, double tolerance,
                         const Progress& progress)
    : TetDomain(tolerance),
      frame_(map.frame),
      to_index_(map.frame.axes.inverse()),
      field_(checked(map), -0.5),
      net_(label_net(map, 0.5, progress.part(0, 0.5))) {
    choose(wanted);
    make_cells(progress.part(0.5, 1));
}

void LabelDomain::choose(const std::vector<std::int64_t>& wanted) {
    for (const float label : net_.labels)
        if (static_cast<double>(label) > largest_label)
            throw InvalidInput(fmt::format("the label {} is too large: 1 to 2^31-1 are possible", label));
    all_ = wanted.empty();
    for (const std::int64_t label : wanted) {
        const bool known = std::any_of(net_.labels.begin(), net_.labels.end(), [&](float value) {
            return static_cast<std::int64_t>(value) == label;
        });
        if (label < 1) throw InvalidInput(fmt::format("label {}: regions count from 1", label));
        if (!known) throw InvalidInput(fmt::format("no voxel has the label {}", label));
        labels_.push_back(static_cast<std::int32_t>(label));
    }
    if (all_)
        for (const float label : net_.labels)
            if (label > 0) labels_.push_back(static_cast<std::int32_t>(label));
    std::sort(labels_.begin(), labels_.end());
    labels_.erase(std::unique(labels_.begin(), labels_.end()), labels_.end());
    if (labels_.empty()) throw InvalidInput("the segmentation has no label above 0");
}

std::int32_t LabelDomain::region_of(double value) const {
    if (!(value > 0)) return 0;
    const auto label = static_cast<std::int32_t>(value);
    return all_ || std::binary_search(labels_.begin(), labels_.end(), label) ? label : 0;
}

std::int32_t LabelDomain::sample(const Coord& c) const {
    if (frame_.bounded())
        for (int a = 0; a < 3; ++a)
            if (c[a] < 0 || c[a] >= frame_.size[a]) return 0;
    return region_of(field_.value(c));
}

/// The cells with two regions or more, and the weights at their corners.
void LabelDomain::make_cells(const Progress& progress) {
    std::vector<std::uint64_t> keys;
    for (const NetVertex& v : net_.vertices) {
        const Coord c = floor_coord(v.start.cast<double>());
        for (int a = 0; a < 3; ++a)
            if (c[a] < -(1 << 20) || c[a] >= (1 << 20))
                throw InvalidInput("tetrahedra of labels: voxels farther than 2^20 from index 0");
        keys.push_back(key_of(c));
    }
    std::sort(keys.begin(), keys.end());
    keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
    std::vector<std::vector<std::int32_t>> labels((keys.size() + 4095) / 4096);
    std::vector<std::vector<float>> weights(labels.size());
    cells_.resize(keys.size());
    parallel_blocks(keys.size(), 4096, [&](std::size_t begin, std::size_t end) {
        std::vector<std::int32_t>& at = labels[begin / 4096];
        for (std::size_t n = begin; n < end; ++n) {
            const std::size_t first = at.size();
            weigh(coord_of(keys[n]), at, weights[begin / 4096]);
            cells_[n] = {keys[n], static_cast<std::uint32_t>(first),
                         static_cast<std::uint32_t>(at.size() - first)};
        }
    });
    for (std::size_t block = 0; block < labels.size(); ++block) {
        const auto shift = static_cast<std::uint32_t>(cell_labels_.size());
        for (std::size_t n = 4096 * block; n < std::min(cells_.size(), 4096 * (block + 1)); ++n)
            cells_[n].first += shift;
        cell_labels_.insert(cell_labels_.end(), labels[block].begin(), labels[block].end());
        for (std::size_t k = 0; k < labels[block].size(); ++k) {
            std::array<float, 8> corner;
            std::copy_n(weights[block].begin() + static_cast<std::ptrdiff_t>(8 * k), 8, corner.begin());
            weights_.push_back(corner);
        }
    }
    cells_.erase(std::remove_if(cells_.begin(), cells_.end(), [](const Cell& c) { return c.count < 2; }),
                 cells_.end());
    std::size_t slots = 4;
    while (slots < 2 * cells_.size()) slots *= 2;
    slots_.assign(slots, -1);
    for (std::size_t n = 0; n < cells_.size(); ++n) {
        std::size_t s = hash(cells_[n].key) & (slots - 1);
        while (slots_[s] >= 0) s = (s + 1) & (slots - 1);
        slots_[s] = static_cast<std::int32_t>(n);
    }
    progress.report(1);
}

/// Appends the regions at the corners of a cell and their weights there; none where all corners are of one.
void LabelDomain::weigh(const Coord& c, std::vector<std::int32_t>& labels,
                        std::vector<float>& weights) const {
    constexpr int around = 2, side = 2 * around + 2;
    std::array<std::int32_t, side * side * side> near;
    for (int x = 0; x < side; ++x)
        for (int y = 0; y < side; ++y)
            for (int z = 0; z < side; ++z)
                near[static_cast<std::size_t>((x * side + y) * side + z)] =
                    sample(c.offsetBy(x - around, y - around, z - around));
    const auto at = [&](int x, int y, int z) {
        return near[static_cast<std::size_t>((x * side + y) * side + z)];
    };
    std::array<std::int32_t, 8> own;
    for (int k = 0; k < 8; ++k)
        own[static_cast<std::size_t>(k)] = at(around + (k & 1), around + (k >> 1 & 1), around + (k >> 2));
    std::array<std::int32_t, 8> found = own;
    std::sort(found.begin(), found.end());
    const auto end = std::unique(found.begin(), found.end());
    if (end - found.begin() < 2) return;
    const std::size_t first = weights.size();
    labels.insert(labels.end(), found.begin(), end);
    weights.resize(first + 8 * static_cast<std::size_t>(end - found.begin()));
    Shares shares;
    for (int k = 0; k < 8; ++k) {
        shares.clear();
        for (int x = 0; x < 5; ++x)
            for (int y = 0; y < 5; ++y)
                for (int z = 0; z < 5; ++z)
                    shares.add(at(x + (k & 1), y + (k >> 1 & 1), z + (k >> 2)), kernel(x, y, z));
        const std::int32_t label = own[static_cast<std::size_t>(k)];
        const double outside = label == 0 ? kept(shares.outside()) : -kept(-shares.outside());
        const double gain = label == 0 ? 0 : kept(shares.ahead(label)) - shares.ahead(label);
        for (auto it = found.begin(); it != end; ++it)
            weights[first + 8 * static_cast<std::size_t>(it - found.begin()) + static_cast<std::size_t>(k)] =
                static_cast<float>(*it == 0 ? outside : shares.of(*it) + (*it == label ? gain : 0));
    }
}

const LabelDomain::Cell* LabelDomain::find(const Coord& c) const {
    const std::uint64_t key = key_of(c);
    for (std::size_t s = hash(key) & (slots_.size() - 1); slots_[s] >= 0; s = (s + 1) & (slots_.size() - 1)) {
        const Cell& cell = cells_[static_cast<std::size_t>(slots_[s])];
        if (cell.key == key) return &cell;
    }
    return nullptr;
}

std::int32_t LabelDomain::region(const Vec3d& place) const {
    const Vec3d index = to_index_ * (place - frame_.origin);
    for (int a = 0; a < 3; ++a)
        if (!(std::abs(index[a]) < 0x1p20)) return 0;
    const Coord c = floor_coord(index);
    const Cell* cell = find(c);
    if (!cell) return sample(c);
    const Vec3d t = index - Vec3d(c.x(), c.y(), c.z());
    const auto mix = [](double p, double q, double w) { return p + (q - p) * w; };
    std::int32_t best = 0;
    double most = -std::numeric_limits<double>::infinity();
    for (std::uint32_t k = cell->first; k < cell->first + cell->count; ++k) {
        std::array<double, 8> w;
        for (std::size_t n = 0; n < 8; ++n) w[n] = static_cast<double>(weights_[k][n]);
        const double weight = mix(mix(mix(w[0], w[1], t.x()), mix(w[2], w[3], t.x()), t.y()),
                                  mix(mix(w[4], w[5], t.x()), mix(w[6], w[7], t.x()), t.y()), t.z());
        if (cell_labels_[k] == 0) {  // the first, as it is the smallest
            if (weight > 0) return 0;
        } else if (weight > most) {
            most = weight;
            best = cell_labels_[k];
        }
    }
    return best;
}

ReferenceBoundary LabelDomain::boundary() const {
    ReferenceBoundary out;
    for (const NetVertex& v : net_.vertices) out.points.push_back(frame_.to_world(v.start.cast<double>()));
    out.reach = frame_.voxel_size().maxCoeff();

    std::vector<const NetPolygon*> polygons;
    for (const NetPolygon& p : net_.polygons)
        if (region_of(static_cast<double>(p.below)) != region_of(static_cast<double>(p.above)))
            polygons.push_back(&p);
    // The two sides of each polygon; those of one label at a vertex belong together.
    const auto label = [&](std::uint32_t half) {
        const NetPolygon& p = *polygons[half / 2];
        return region_of(static_cast<double>(half % 2 ? p.above : p.below));
    };
    std::vector<std::uint64_t> first(net_.vertices.size() + 1, 0);
    for (const NetPolygon* p : polygons)
        for (const VertexId v : p->corner) ++first[v + 1];
    for (std::size_t v = 1; v < first.size(); ++v) first[v] += first[v - 1];
    std::vector<std::uint32_t> at(first.back());
    std::vector<std::uint64_t> next(first.begin(), first.end() - 1);
    for (std::uint32_t p = 0; p < polygons.size(); ++p)
        for (const VertexId v : polygons[p]->corner) at[next[v]++] = p;
    Groups groups(2 * polygons.size());
    for (std::size_t v = 0; v + 1 < first.size(); ++v)
        for (std::uint64_t i = 2 * first[v]; i < 2 * first[v + 1]; ++i)
            for (std::uint64_t j = 2 * first[v]; j < i; ++j) {
                const auto half = [&](std::uint64_t k) {
                    return 2 * at[k / 2] + static_cast<std::uint32_t>(k % 2);
                };
                if (label(half(i)) == label(half(j))) groups.join(half(i), half(j));
            }

    std::vector<std::uint32_t> faces(2 * polygons.size(), 0);
    for (std::uint32_t half = 0; half < faces.size(); ++half) ++faces[groups.root(half)];
    std::vector<std::uint32_t> number(faces.size(), 0xFFFFFFFFu);
    std::uint32_t parts = 0;
    for (std::uint32_t p = 0; p < polygons.size(); ++p) {
        const std::uint32_t a = groups.root(2 * p), b = groups.root(2 * p + 1);
        std::uint32_t& part = number[faces[a] <= faces[b] ? a : b];
        if (part == 0xFFFFFFFFu) part = parts++;
        const auto& c = polygons[p]->corner;
        out.triangles.push_back({c[0], c[1], c[2]});
        out.triangles.push_back({c[0], c[2], c[3]});
        out.part.insert(out.part.end(), 2, part);
    }
    return out;
}

}  // namespace vdbgeo
