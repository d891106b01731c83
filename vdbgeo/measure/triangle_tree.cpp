#include "vdbgeo/measure/triangle_tree.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

/// gcc 12 leaves the loop over four boxes scalar, which costs a third of a query.
typedef float Float4 __attribute__((vector_size(16)));

Float4 load(const float* four) {
    Float4 value;
    std::memcpy(&value, four, sizeof(value));
    return value;
}

/// A face while the faces are put in order: three times its centroid, and its number.
struct Item {
    float centre[3];
    std::uint32_t number;
};

int longest_side(const Item* begin, const Item* end) {
    float low[3] = {infinity, infinity, infinity}, high[3] = {-infinity, -infinity, -infinity};
    for (const Item* item = begin; item != end; ++item)
        for (int a = 0; a < 3; ++a) {
            low[a] = std::min(low[a], item->centre[a]);
            high[a] = std::max(high[a], item->centre[a]);
        }
    int axis = 0;
    for (int a = 1; a < 3; ++a)
        if (high[a] - low[a] > high[axis] - low[axis]) axis = a;
    return axis;
}

/// Orders the items of one node, whose children take `block` items each (the last may have fewer), and goes
/// on in the children. The result is a function of the items alone: every cut is through a total order.
void order(Item* items, std::size_t count, std::size_t block) {
    while (block >= count && block > 1) block /= 4;
    if (count <= 1 || count <= block) return;
    const std::size_t children = (count + block - 1) / block;
    const auto cut = [&](std::size_t from, std::size_t to) {  // children [from, to) in two halves
        const std::size_t middle = (from + to + 1) / 2;
        Item *begin = items + from * block, *end = items + std::min(to * block, count);
        const int axis = longest_side(begin, end);
        std::nth_element(begin, items + middle * block, end, [axis](const Item& a, const Item& b) {
            return a.centre[axis] != b.centre[axis] ? a.centre[axis] < b.centre[axis] : a.number < b.number;
        });
        return middle;
    };
    const std::size_t middle = cut(0, children);
    if (middle > 1) cut(0, middle);
    if (children - middle > 1) cut(middle, children);
    if (block < 4) return;
    const auto descend = [&](std::size_t child) {
        order(items + child * block, std::min(block, count - child * block), block / 4);
    };
    if (count > 8192) {
        parallel_for(children, 1, descend);
    } else {
        for (std::size_t child = 0; child < children; ++child) descend(child);
    }
}

Vec3d nearest_on_segment(const Vec3d& p, const Vec3d& a, const Vec3d& b) {
    const Vec3d ab = b - a;
    const double length2 = ab.squaredNorm(), along = ab.dot(p - a);
    if (!(along > 0)) return a;
    if (along >= length2) return b;
    return a + ab * (along / length2);
}

/// For triangles without an area: their nearest point is on a side.
Vec3d nearest_on_sides(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    Vec3d best = nearest_on_segment(p, a, b);
    for (const Vec3d& q : {nearest_on_segment(p, b, c), nearest_on_segment(p, c, a)})
        if ((q - p).squaredNorm() < (best - p).squaredNorm()) best = q;
    return best;
}

/// By the Voronoi regions of corners, sides and inside (Ericson, Real-Time Collision Detection, 2005, 5.1.5).
/// Every answer is a convex combination of the corners, so that rounding never makes a face seem nearer than
/// it is.
Vec3d nearest_on_triangle(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const Vec3d ab = b - a, ac = c - a, ap = p - a;
    const double ab_a = ab.dot(ap), ac_a = ac.dot(ap);
    if (ab_a <= 0 && ac_a <= 0) return a;
    const Vec3d bp = p - b;
    const double ab_b = ab.dot(bp), ac_b = ac.dot(bp);
    if (ab_b >= 0 && ac_b <= ab_b) return b;
    const Vec3d cp = p - c;
    const double ab_c = ab.dot(cp), ac_c = ac.dot(cp);
    if (ac_c >= 0 && ab_c <= ac_c) return c;
    const double wc = ab_a * ac_b - ab_b * ac_a;
    if (wc <= 0 && ab_a >= 0 && ab_b <= 0 && ab_a > ab_b) return a + ab * (ab_a / (ab_a - ab_b));
    const double wb = ab_c * ac_a - ab_a * ac_c;
    if (wb <= 0 && ac_a >= 0 && ac_c <= 0 && ac_a > ac_c) return a + ac * (ac_a / (ac_a - ac_c));
    const double wa = ab_b * ac_c - ab_c * ac_b, from_b = ac_b - ab_b, from_c = ab_c - ac_c;
    if (wa <= 0 && from_b >= 0 && from_c >= 0 && from_b + from_c > 0)
        return b + (c - b) * (from_b / (from_b + from_c));
    const double sum = wa + wb + wc;
    if (!(sum > 0 && wa >= 0 && wb >= 0 && wc >= 0)) return nearest_on_sides(p, a, b, c);
    return a + ab * (wb / sum) + ac * (wc / sum);
}

}  // namespace

/// One query on its way down the tree.
struct TriangleTree::Search {
    Vec3d p;
    float q[3];   ///< p rounded
    float slack;  ///< what rounding p and the differences can hide of a distance to a box
    Nearest best;
    float limit;  ///< boxes further than this, squared, hold nothing nearer

    Search(const Vec3d& point, double squared_reach) : p(point) {
        for (int a = 0; a < 3; ++a) q[a] = static_cast<float>(p[a]);
        slack = static_cast<float>(p.cwiseAbs().maxCoeff()) * 4e-7f;
        best.squared_distance = squared_reach;
        best.face = std::numeric_limits<std::uint64_t>::max();
        tighten();
    }

    void tighten() {
        const float reach = static_cast<float>(std::sqrt(best.squared_distance)) + slack;
        limit = reach * reach * 1.00001f;
    }

    /// The squared distances to the four boxes.
    void measure(const Box4& box, float (&squared)[4]) const {
        Float4 sum = {};
        for (int a = 0; a < 3; ++a) {
            const Float4 under = load(box.low[a]) - q[a], over = q[a] - load(box.high[a]);
            Float4 gap = under > over ? under : over;
            gap = gap > 0 ? gap : Float4{};
            sum += gap * gap;
        }
        std::memcpy(squared, &sum, sizeof(sum));
    }
};

TriangleTree::TriangleTree(const TriMesh& mesh) {
    const std::size_t n = mesh.triangles.size();
    if (n >= std::numeric_limits<std::uint32_t>::max())
        throw InvalidInput("nearest points: a mesh of 2^32 faces or more");
    check(mesh, "nearest points");
    Array<Item> items(n);
    parallel_for(n, 4096, [&](std::size_t f) {
        Item& item = items[f];
        item.number = static_cast<std::uint32_t>(f);
        for (int a = 0; a < 3; ++a) {
            item.centre[a] = 0;
            for (const VertexId v : mesh.triangles[f]) item.centre[a] += mesh.points[v][a] / 3;
        }
    });
    std::size_t block = 1;
    while (block * 4 < n) block *= 4;
    order(items.data(), n, block);
    faces_.resize(n);
    parallel_for(n, 4096, [&](std::size_t i) {
        Face& face = faces_[i];
        face.number = items[i].number;
        const Triangle& t = mesh.triangles[face.number];
        for (int c = 0; c < 3; ++c)
            for (int a = 0; a < 3; ++a) face.corners[c][a] = mesh.points[t[static_cast<std::size_t>(c)]][a];
    });
    bound_faces();
    bound_nodes();
}

void TriangleTree::bound_faces() {
    if (faces_.empty()) return;
    Array<Box4>& level = levels_.emplace_back();
    level.resize((faces_.size() + 3) / 4);
    parallel_for(level.size(), 1024, [&](std::size_t node) {
        for (std::size_t lane = 0; lane < 4; ++lane)
            for (int a = 0; a < 3; ++a) {
                float low = infinity, high = -infinity;
                if (4 * node + lane < faces_.size())
                    for (const auto& corner : faces_[4 * node + lane].corners) {
                        low = std::min(low, corner[a]);
                        high = std::max(high, corner[a]);
                    }
                level[node].low[a][lane] = low;
                level[node].high[a][lane] = high;
            }
    });
}

void TriangleTree::bound_nodes() {
    while (!levels_.empty() && levels_.back().size() > 1) {
        Array<Box4> level((levels_.back().size() + 3) / 4);
        const Array<Box4>& below = levels_.back();
        parallel_for(level.size(), 1024, [&](std::size_t node) {
            for (std::size_t lane = 0; lane < 4; ++lane)
                for (int a = 0; a < 3; ++a) {
                    float low = infinity, high = -infinity;
                    if (4 * node + lane < below.size()) {
                        const Box4& child = below[4 * node + lane];
                        low = *std::min_element(child.low[a], child.low[a] + 4);
                        high = *std::max_element(child.high[a], child.high[a] + 4);
                    }
                    level[node].low[a][lane] = low;
                    level[node].high[a][lane] = high;
                }
        });
        levels_.push_back(std::move(level));
    }
}

void TriangleTree::visit_leaf(Search& search, std::uint32_t node) const {
    float squared[4];
    search.measure(levels_[0][node], squared);
    const std::size_t count = std::min<std::size_t>(4, faces_.size() - 4 * std::size_t(node));
    for (std::size_t lane = 0; lane < count; ++lane) {
        if (squared[lane] > search.limit) continue;
        const Face& face = faces_[4 * std::size_t(node) + lane];
        const auto corner = [&](int c) {
            return Vec3d(face.corners[c][0], face.corners[c][1], face.corners[c][2]);
        };
        const Vec3d point = nearest_on_triangle(search.p, corner(0), corner(1), corner(2));
        const double distance = (point - search.p).squaredNorm();
        Nearest& best = search.best;
        if (distance < best.squared_distance) {
            best = {point, face.number, distance};
            search.tighten();
        } else if (distance == best.squared_distance && face.number < best.face) {
            best = {point, face.number, distance};
        }
    }
}

TriangleTree::Nearest TriangleTree::nearest(const Vec3d& p, double squared_reach) const {
    Search search(p, squared_reach);
    struct Entry {
        float squared;
        std::uint32_t node;
        int level;
    };
    // Three siblings wait on each level at most, and 2^32 faces make 16 levels.
    Entry stack[64];
    int top = 0;
    if (!levels_.empty()) stack[top++] = {0, 0, static_cast<int>(levels_.size()) - 1};
    while (top > 0) {
        const Entry entry = stack[--top];
        if (entry.squared > search.limit) continue;
        if (entry.level == 0) {
            visit_leaf(search, entry.node);
            continue;
        }
        const std::size_t level = static_cast<std::size_t>(entry.level);
        float squared[4];
        search.measure(levels_[level][entry.node], squared);
        const std::uint32_t first = 4 * entry.node;
        const std::size_t count = std::min<std::size_t>(4, levels_[level - 1].size() - first);
        const int bottom = top;
        for (std::size_t lane = 0; lane < count; ++lane) {  // the nearest comes to lie on top
            if (squared[lane] > search.limit) continue;
            int place = top++;
            for (; place > bottom && stack[place - 1].squared < squared[lane]; --place)
                stack[place] = stack[place - 1];
            stack[place] = {squared[lane], first + static_cast<std::uint32_t>(lane), entry.level - 1};
        }
    }
    if (search.best.face == std::numeric_limits<std::uint64_t>::max())
        return {Vec3d::Zero(), 0, Nearest().squared_distance};
    return search.best;
}

}  // namespace vdbgeo
