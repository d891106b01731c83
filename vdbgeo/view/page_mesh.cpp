#include "vdbgeo/view/page_mesh.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/view/page_text.h"

namespace vdbgeo {
namespace {

constexpr std::uint32_t steps = 65535;      ///< of a position along an axis
constexpr std::uint32_t no_scalar = 65535;  ///< in place of a scalar
constexpr std::uint32_t no_category = 255;  ///< in place of a category
constexpr double widths = 50;               ///< scalars are cut this far from what is shown
constexpr VertexId unseen = std::numeric_limits<VertexId>::max();

std::string deflated(const std::vector<std::uint8_t>& bytes) {
    uLongf size = compressBound(static_cast<uLong>(bytes.size()));
    std::string packed(size, '\0');
    if (compress2(reinterpret_cast<Bytef*>(packed.data()), &size, bytes.data(),
                  static_cast<uLong>(bytes.size()), Z_BEST_COMPRESSION) != Z_OK)
        throw std::bad_alloc();
    packed.resize(size);
    return packed;
}

/// The low bytes of all numbers, then their next bytes; packed, as text.
std::string in_planes(const std::vector<std::uint32_t>& values, int bytes) {
    std::vector<std::uint8_t> planes;
    planes.reserve(values.size() * static_cast<std::size_t>(bytes));
    for (int b = 0; b < bytes; ++b)
        for (const std::uint32_t v : values) planes.push_back(static_cast<std::uint8_t>(v >> 8 * b));
    return base64(deflated(planes));
}

/// A mesh as the two kinds share it: elements of `corners_each` vertices.
struct Elements {
    std::vector<VertexId> corners;
    std::size_t each = 3;
    std::size_t count() const { return corners.size() / each; }
};

/// The elements at each vertex, by their number.
struct Stars {
    std::vector<std::size_t> first;
    std::vector<std::uint32_t> elements;

    Stars(const Elements& mesh, std::size_t vertices) : first(vertices + 1), elements(mesh.corners.size()) {
        for (const VertexId v : mesh.corners) ++first[v + 1];
        std::partial_sum(first.begin(), first.end(), first.begin());
        std::vector<std::size_t> next(first.begin(), first.end() - 1);
        for (std::size_t i = 0; i < mesh.corners.size(); ++i)
            elements[next[mesh.corners[i]]++] = static_cast<std::uint32_t>(i / mesh.each);
    }
};

/// A mesh in the order in which it is packed.
struct Ordered {
    std::vector<std::uint32_t> elements;  ///< their old numbers
    std::vector<VertexId> vertices;       ///< likewise
    std::vector<VertexId> corners;        ///< in the new numbers
};

/// Walks over a mesh so that what comes next is close to what came before: vertices have small differences
/// then, and are named by small numbers. Vertices wait in a stack; the elements around the one on top come
/// next, as a fan, each with that vertex first. This takes two thirds of the bytes that remeshed and
/// simplified surfaces take as they are, and no more than theirs for those that come in order.
class Walk {
 public:
    Walk(const Elements& mesh, std::size_t vertices)
        : mesh_(mesh), stars_(mesh, vertices), taken_(mesh.count(), false), number_(vertices, unseen) {}

    Ordered run() {
        result_.elements.reserve(mesh_.count());
        result_.corners.reserve(mesh_.corners.size());
        for (std::size_t start = 0; start < mesh_.count(); ++start) {
            if (taken_[start]) continue;
            stack_.assign(1, mesh_.corners[start * mesh_.each]);
            while (!stack_.empty()) {
                const VertexId v = stack_.back();
                stack_.pop_back();
                take_fan(v);
            }
        }
        return std::move(result_);
    }

 private:
    const VertexId* corners(std::uint32_t element) const { return &mesh_.corners[element * mesh_.each]; }

    /// How well an element fits behind `last`: corners that they share count most, then those that have a
    /// number.
    int fit(std::uint32_t element, const VertexId* last) const {
        int score = 0;
        for (std::size_t k = 0; k < mesh_.each; ++k) {
            const VertexId v = corners(element)[k];
            score += number_[v] != unseen;
            if (last && std::find(last, last + mesh_.each, v) != last + mesh_.each) score += 8;
        }
        return score;
    }

    void take_fan(VertexId v) {
        fan_.clear();
        for (std::size_t i = stars_.first[v]; i < stars_.first[v + 1]; ++i)
            if (!taken_[stars_.elements[i]]) fan_.push_back(stars_.elements[i]);
        const VertexId* last = nullptr;
        while (!fan_.empty()) {
            std::size_t best = 0;
            for (std::size_t i = 1; i < fan_.size(); ++i)
                if (fit(fan_[i], last) > fit(fan_[best], last)) best = i;
            last = corners(fan_[best]);
            if (!taken_[fan_[best]]) take(fan_[best], v);
            fan_.erase(fan_.begin() + static_cast<std::ptrdiff_t>(best));
        }
    }

    void take(std::uint32_t element, VertexId first) {
        taken_[element] = true;
        result_.elements.push_back(element);
        std::array<VertexId, 4> turned{};
        const VertexId* old = corners(element);
        const auto at = static_cast<std::size_t>(std::find(old, old + mesh_.each, first) - old);
        // Even permutations: the element is not turned over.
        if (mesh_.each == 3)
            turned = {old[at], old[(at + 1) % 3], old[(at + 2) % 3]};
        else
            turned = {old[at], old[at ^ 1], old[at ^ 2], old[at ^ 3]};
        for (std::size_t k = 0; k < mesh_.each; ++k) {
            VertexId& number = number_[turned[k]];
            if (number == unseen) {
                number = static_cast<VertexId>(result_.vertices.size());
                result_.vertices.push_back(turned[k]);
                stack_.push_back(turned[k]);
            }
            result_.corners.push_back(number);
        }
    }

    const Elements& mesh_;
    const Stars stars_;
    std::vector<bool> taken_;
    std::vector<VertexId> number_, stack_;
    std::vector<std::uint32_t> fan_;
    Ordered result_;
};

using Points = std::vector<Vec3d>;

std::string vector_json(const Vec3d& v) {
    return fmt::format("[{},{},{}]", json_number(v.x()), json_number(v.y()), json_number(v.z()));
}

/// "box" and "position".
std::string positions_json(const Points& points) {
    Vec3d low = Vec3d::Zero(), high = Vec3d::Zero();
    if (!points.empty()) low = high = points[0];
    for (const Vec3d& p : points) low = low.cwiseMin(p), high = high.cwiseMax(p);
    std::vector<std::uint32_t> values;
    values.reserve(3 * points.size());
    for (int a = 0; a < 3; ++a)
        for (const Vec3d& p : points) {
            const double extent = high[a] - low[a];
            const double part = extent > 0 ? (p[a] - low[a]) / extent : 0;
            values.push_back(static_cast<std::uint32_t>(std::lround(steps * std::clamp(part, 0.0, 1.0))));
        }
    return fmt::format(R"("box":[{},{}],"position":{})", vector_json(low), vector_json(high),
                       packed_array(values, 16, 3));
}

/// Percentile of values in any order, which it changes.
double percentile(std::vector<float>& values, double part) {
    const auto rank = static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), values.begin() + rank, values.end());
    return static_cast<double>(values[static_cast<std::size_t>(rank)]);
}

/// What a scalar's numbers span, and what its colours span at first.
struct Spans {
    double low = 0, high = 0, shown_low = 0, shown_high = 0;
};

Spans spans_of(const PageProperty& p) {
    std::vector<float> finite;
    for (const float v : p.values)
        if (std::isfinite(v)) finite.push_back(v);
    Spans s;
    if (!finite.empty()) {
        s.shown_low = percentile(finite, 0.02), s.shown_high = percentile(finite, 0.98);
        const auto [least, most] = std::minmax_element(finite.begin(), finite.end());
        s.low = static_cast<double>(*least), s.high = static_cast<double>(*most);
    }
    if (p.colormap == "diverging") {
        s.shown_high = std::max(std::abs(s.shown_low), std::abs(s.shown_high));
        s.shown_low = -s.shown_high;
    }
    if (p.range) s.shown_low = (*p.range)[0], s.shown_high = (*p.range)[1];
    if (!(s.shown_low < s.shown_high)) {  // a single value
        const double half = s.shown_low != 0 ? std::abs(s.shown_low) / 2 : 1;
        s.shown_low -= half, s.shown_high += half;
    }
    const double reach = widths * (s.shown_high - s.shown_low);
    s.low = std::max(s.low, s.shown_low - reach), s.high = std::min(s.high, s.shown_high + reach);
    if (!(s.low < s.high)) s.low = s.shown_low, s.high = s.shown_high;
    return s;
}

std::uint32_t scalar_step(float value, const Spans& s) {
    if (!std::isfinite(value)) return no_scalar;
    const double part = (static_cast<double>(value) - s.low) / (s.high - s.low);
    return static_cast<std::uint32_t>(std::lround((no_scalar - 1) * std::clamp(part, 0.0, 1.0)));
}

std::uint32_t category(float value) {
    const bool good = value >= 0 && value < no_category && value == std::floor(value);
    return good ? static_cast<std::uint32_t>(value) : no_category;
}

std::string property_json(const PageProperty& p, const std::vector<std::uint32_t>& order) {
    std::string json =
        fmt::format(R"({{"key":{},"name":{},"unit":{},"help":{},"kind":"{}","colormap":{})",
                    json_string(p.key), json_string(p.name), json_string(p.unit), json_string(p.help),
                    p.category ? "category" : "scalar", json_string(p.colormap));
    const Spans s = p.category ? Spans{} : spans_of(p);
    std::vector<std::uint32_t> values;
    values.reserve(order.size());
    for (const std::uint32_t i : order)
        values.push_back(p.category ? category(p.values[i]) : scalar_step(p.values[i], s));
    if (p.category) {
        json += R"(,"classes":[)";
        for (const auto& [value, name] : p.classes)
            json += fmt::format(R"({}{{"value":{},"name":{}}})", json.back() == '[' ? "" : ",", value,
                                json_string(name));
        json += "]";
    } else {
        json += fmt::format(R"(,"low":{},"high":{},"range":[{},{}])", json_number(s.low), json_number(s.high),
                            json_number(s.shown_low), json_number(s.shown_high));
    }
    return json + fmt::format(R"(,"values":{}}})", packed_array(values, p.category ? 8 : 16));
}

std::string mesh_json(const char* kind, const Elements& mesh, const Points& points, std::uint64_t full,
                      const std::vector<PageProperty>& properties, bool of_vertices) {
    const Ordered o = Walk(mesh, points.size()).run();
    Points used;
    used.reserve(o.vertices.size());
    for (const VertexId v : o.vertices) used.push_back(points[v]);
    std::string json =
        fmt::format(R"({{"vertices":{},"{}":{},"{}_full":{},{},"index":{},"properties":[)", used.size(), kind,
                    o.elements.size(), kind, full, positions_json(used), packed_index(o.corners));
    const std::size_t values = of_vertices ? points.size() : mesh.count();
    for (const PageProperty& p : properties) {
        if (p.values.size() != values)
            throw InvalidInput(
                fmt::format("property {} has {} values, not {}", p.key, p.values.size(), values));
        if (json.back() != '[') json += ',';
        json += property_json(p, of_vertices ? o.vertices : o.elements);
    }
    return json + "]}";
}

}  // namespace

std::string packed_array(const std::vector<std::uint32_t>& values, int bits, int components) {
    if (bits != 8 && bits != 16 && bits != 32)
        throw InvalidInput(fmt::format("an array has 8, 16 or 32 bits, not {}", bits));
    if (components < 1 || values.size() % static_cast<std::size_t>(components) != 0)
        throw InvalidInput(fmt::format("{} values are no {} of each", values.size(), components));
    const std::size_t count = values.size() / static_cast<std::size_t>(components);
    std::vector<std::uint32_t> differences(values);
    for (std::size_t i = values.size(); i-- > 1;)
        if (i % count != 0) differences[i] -= values[i - 1];
    return fmt::format(R"({{"bits":{},"components":{},"count":{},"data":"{}"}})", bits, components, count,
                       in_planes(differences, bits / 8));
}

std::string packed_index(const std::vector<VertexId>& corners) {
    std::vector<std::uint32_t> codes;
    codes.reserve(corners.size());
    VertexId next = 0;
    for (const VertexId v : corners) {
        if (v > next) throw InvalidInput(fmt::format("vertex {} comes up before vertex {}", v, next));
        codes.push_back(next - v);
        if (v == next) ++next;
    }
    return fmt::format(R"({{"count":{},"data":"{}"}})", corners.size(), in_planes(codes, 4));
}

std::string packed_surface(const TriMesh& mesh, const std::vector<PageProperty>& properties,
                           std::uint64_t faces_full) {
    check(mesh, "surface");
    Elements faces;
    faces.corners.reserve(3 * mesh.triangles.size());
    for (const Triangle& t : mesh.triangles) faces.corners.insert(faces.corners.end(), t.begin(), t.end());
    Points points;
    points.reserve(mesh.points.size());
    for (const Vec3f& p : mesh.points) points.push_back(p.cast<double>());
    return mesh_json("faces", faces, points, faces_full, properties, true);
}

std::string packed_tets(const TetMesh& mesh, const std::vector<PageProperty>& properties,
                        std::uint64_t tets_full) {
    check(mesh, "tetrahedra");
    Elements tets;
    tets.each = 4;
    tets.corners.reserve(4 * mesh.tets.size());
    for (const Tetrahedron& t : mesh.tets) tets.corners.insert(tets.corners.end(), t.begin(), t.end());
    return mesh_json("tets", tets, {mesh.points.begin(), mesh.points.end()}, tets_full, properties, false);
}

}  // namespace vdbgeo
