// Reads Gmsh's mesh files of versions 2 and 4.1, text and binary.
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <numeric>
#include <string_view>
#include <utility>

#include "converters/gmsh_source.h"
#include "converters/tet_formats.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::tet_formats {
namespace {

/// A kind of elements, by its number in the format. The first nodes are the corners.
struct Element {
    int type, dimension;
    std::uint64_t nodes;
    std::string_view name;
    bool tetrahedron() const { return name == "tetrahedron"; }
};
constexpr Element elements[] = {
    {1, 1, 2, "line"},          {2, 2, 3, "triangle"},      {3, 2, 4, "quadrangle"},
    {4, 3, 4, "tetrahedron"},   {5, 3, 8, "hexahedron"},    {6, 3, 6, "prism"},
    {7, 3, 5, "pyramid"},       {8, 1, 3, "line"},          {9, 2, 6, "triangle"},
    {10, 2, 9, "quadrangle"},   {11, 3, 10, "tetrahedron"}, {12, 3, 27, "hexahedron"},
    {13, 3, 18, "prism"},       {14, 3, 14, "pyramid"},     {15, 0, 1, "point"},
    {16, 2, 8, "quadrangle"},   {17, 3, 20, "hexahedron"},  {18, 3, 15, "prism"},
    {19, 3, 13, "pyramid"},     {20, 2, 9, "triangle"},     {21, 2, 10, "triangle"},
    {22, 2, 12, "triangle"},    {23, 2, 15, "triangle"},    {24, 2, 15, "triangle"},
    {25, 2, 21, "triangle"},    {26, 1, 4, "line"},         {27, 1, 5, "line"},
    {28, 1, 6, "line"},         {29, 3, 20, "tetrahedron"}, {30, 3, 35, "tetrahedron"},
    {31, 3, 56, "tetrahedron"}, {92, 3, 64, "hexahedron"},  {93, 3, 125, "hexahedron"}};

/// Nodes by their tags, which may be any numbers: vertices are numbered in rising order of tags.
class NodeTags {
 public:
    /// Sorts the points by their tags. Returns a tag that stands there twice, 0 (which is none) otherwise.
    std::uint64_t set(Array<std::uint64_t> tags, Array<Vec3d>& points) {
        if (!std::is_sorted(tags.begin(), tags.end())) {
            Array<std::uint32_t> order(tags.size());
            std::iota(order.begin(), order.end(), 0u);
            std::sort(order.begin(), order.end(), [&](auto a, auto b) { return tags[a] < tags[b]; });
            Array<std::uint64_t> sorted_tags(tags.size());
            Array<Vec3d> sorted(points.size());
            for (std::size_t i = 0; i < order.size(); ++i) {
                sorted_tags[i] = tags[order[i]];
                sorted[i] = points[order[i]];
            }
            tags.swap(sorted_tags);
            points.swap(sorted);
        }
        tags_ = std::move(tags);
        const auto twice = std::adjacent_find(tags_.begin(), tags_.end());
        return twice == tags_.end() ? 0 : *twice;
    }

    static constexpr VertexId none = 0xFFFFFFFFu;
    VertexId find(std::uint64_t tag) const {
        if (tags_.empty()) return none;
        // most files count their nodes without gaps
        if (const std::uint64_t i = tag - tags_[0]; i < tags_.size() && tags_[i] == tag)
            return static_cast<VertexId>(i);
        const auto place = std::lower_bound(tags_.begin(), tags_.end(), tag);
        return place == tags_.end() || *place != tag ? none : static_cast<VertexId>(place - tags_.begin());
    }

 private:
    Array<std::uint64_t> tags_;
};

class Reader {
 public:
    Reader(const MappedFile& file, const Progress& progress) : in_(file), progress_(progress) {}

    TetSoup read() {
        for (std::string_view name = in_.section(); !name.empty(); name = in_.section()) {
            const bool four = in_.version() > 3;
            if (name == "Nodes") {
                if (std::exchange(nodes_, true)) in_.fail("a second section $Nodes");
                four ? nodes_4() : nodes_2();
            } else if (name == "Elements") {
                if (!nodes_) in_.fail("$Elements before $Nodes");
                if (std::exchange(elements_, true)) in_.fail("a second section $Elements");
                four ? elements_4() : elements_2();
            } else if (name == "Entities" && four) {
                entities();
            } else {
                in_.pass_over_section(name);
                continue;
            }
            in_.end_section(name);
        }
        if (!nodes_ || !elements_) in_.fail(fmt::format("no section ${}", nodes_ ? "Elements" : "Nodes"));
        sort_by_tag();
        set_labels();
        return std::move(soup_);
    }

 private:
    void report(std::uint64_t i) const {
        if (i % report_every == 0) progress_.report(in_.fraction());
    }

    // Entities of version 4.1: what physical groups the volumes are in

    void entities() {
        std::uint64_t counts[4];
        for (std::uint64_t& n : counts) {
            n = in_.size("count of entities");
            in_.need_room(n, 1, 4, "entities");
        }
        for (int dimension = 0; dimension < 4; ++dimension)
            for (std::uint64_t i = 0; i < counts[dimension]; ++i) entity(dimension);
    }

    void entity(int dimension) {
        const std::int32_t tag = in_.integer("entity");
        in_.pass_over(dimension == 0 ? 3 : 6, 8, "box of an entity");
        const std::uint64_t groups = in_.size("count of physical groups");
        if (groups > 0) {
            const std::int32_t group = in_.integer("physical group");
            if (dimension == 3) group_of_[tag] = std::abs(std::int64_t(group));  // negative: turned over
            in_.pass_over(groups - 1, 4, "physical groups");
        }
        if (dimension > 0) in_.pass_over(in_.size("boundary of an entity"), 4, "boundary of an entity");
    }

    // Nodes

    void add_node(std::uint64_t tag, const Vec3d& point) {
        tags_.push_back(tag);
        soup_.points.push_back(point);
        report(tags_.size());
    }
    Vec3d point() {
        const double x = in_.real("coordinate"), y = in_.real("coordinate"), z = in_.real("coordinate");
        return {x, y, z};
    }
    void reserve_nodes(std::uint64_t n) {
        in_.need_room(n, 4, in_.version() > 3 ? (in_.size_bytes() + 24) / 4 : 7, "nodes");
        if (n > TriMesh::max_vertices) in_.fail(fmt::format("{} nodes, more than 2^32-1", n));
        tags_.reserve(n);
        soup_.points.reserve(n);
    }
    void set_nodes() {
        if (const std::uint64_t twice = node_.set(std::move(tags_), soup_.points))
            in_.fail(fmt::format("node {} is there twice", twice));
    }

    void nodes_2() {
        const std::uint64_t n = in_.count_line("count of nodes");
        reserve_nodes(n);
        for (std::uint64_t i = 0; i < n; ++i) {
            const std::uint64_t tag = node_tag(in_.integer("tag of a node"));
            add_node(tag, point());
        }
        set_nodes();
    }

    std::uint64_t node_tag(std::int64_t tag) const {
        if (tag < 1) in_.fail(fmt::format("node {}: expected 1 or more", tag));
        return static_cast<std::uint64_t>(tag);
    }

    void nodes_4() {
        const std::uint64_t blocks = in_.size("count of blocks"), n = in_.size("count of nodes");
        in_.pass_over(2, in_.size_bytes(), "range of the nodes");
        reserve_nodes(n);
        for (std::uint64_t b = 0; b < blocks; ++b) {
            const std::int32_t dimension = in_.integer("dimension");
            in_.integer("entity");
            const bool parametric = in_.integer("parametric") != 0;
            const std::uint64_t own = in_.size("nodes of a block"), first = tags_.size();
            if (dimension < 0 || dimension > 3) in_.fail(fmt::format("an entity of dimension {}", dimension));
            if (own > n - first) in_.fail(fmt::format("more than the {} nodes that are announced", n));
            for (std::uint64_t i = 0; i < own; ++i) tags_.push_back(in_.size("tag of a node"));
            for (std::uint64_t i = 0; i < own; ++i) {
                if (tags_[first + i] < 1) in_.fail("node 0: expected 1 or more");
                soup_.points.push_back(point());
                if (parametric)
                    in_.pass_over(static_cast<std::uint64_t>(dimension), 8, "parameters of a node");
                report(i);
            }
        }
        if (tags_.size() != n) in_.fail(fmt::format("{} nodes, {} are announced", tags_.size(), n));
        set_nodes();
    }

    // Elements

    const Element& element(std::int32_t type) const {
        const auto* const found = std::find_if(std::begin(elements), std::end(elements),
                                               [&](const Element& e) { return e.type == type; });
        if (found == std::end(elements)) in_.fail(fmt::format("elements of type {} are not known", type));
        if (found->dimension == 3 && !found->tetrahedron())
            in_.fail(fmt::format("a {}: only tetrahedra are read", found->name));
        return *found;
    }

    VertexId vertex(std::uint64_t tag) const {
        const VertexId v = node_.find(tag);
        if (v == NodeTags::none) in_.fail(fmt::format("an element names node {}, which is not there", tag));
        return v;
    }

    /// Takes the nodes of a tetrahedron; next() is the tag of the next one.
    template <class Next>
    void add_tetrahedron(std::uint64_t tag, std::int64_t group, std::int32_t entity, const Element& kind,
                         const Next& next) {
        Tetrahedron t;
        for (VertexId& v : t) v = vertex(next());
        for (std::uint64_t k = 4; k < kind.nodes; ++k) soup_.add_middle(vertex(next()));
        soup_.tets.push_back(t);
        element_tags_.push_back(tag);
        groups_.push_back(static_cast<double>(group));
        entities_.push_back(entity);
        report(soup_.tets.size());
    }

    void elements_4() {
        const std::uint64_t blocks = in_.size("count of blocks"), n = in_.size("count of elements"),
                            bytes = in_.size_bytes();
        in_.pass_over(2, bytes, "range of the elements");
        std::uint64_t seen = 0;
        for (std::uint64_t b = 0; b < blocks; ++b) {
            in_.integer("dimension");
            const std::int32_t entity = in_.integer("entity");
            const Element& kind = element(in_.integer("type of the elements"));
            const std::uint64_t own = in_.size("elements of a block");
            if (own > n - seen) in_.fail(fmt::format("more than the {} elements that are announced", n));
            seen += own;
            in_.need_room(own, 1 + kind.nodes, bytes, "elements");
            if (!kind.tetrahedron()) {
                in_.pass_over(own * (1 + kind.nodes), bytes, "elements");
                soup_.surfaces += kind.dimension == 2 ? own : 0;
                continue;
            }
            const auto group = group_of_.find(entity);
            for (std::uint64_t i = 0; i < own; ++i) {
                const std::uint64_t tag = in_.size("tag of an element");
                add_tetrahedron(tag, group == group_of_.end() ? 0 : group->second, entity, kind,
                                [&] { return in_.size("node of an element"); });
            }
        }
        if (seen != n) in_.fail(fmt::format("{} elements, {} are announced", seen, n));
    }

    void elements_2() {
        const std::uint64_t n = in_.count_line("count of elements");
        in_.need_room(n, 3, 4, "elements");
        std::uint64_t seen = 0;
        while (seen < n) {
            std::int32_t number = in_.binary() ? 0 : in_.integer("number of an element");
            const Element& kind = element(in_.integer("type of an element"));
            const std::uint64_t own =
                in_.binary() ? static_cast<std::uint64_t>(in_.integer("elements that follow")) : 1;
            const std::int32_t tags = in_.integer("count of tags");
            if (tags < 0 || own < 1 || own > n - seen)
                in_.fail(fmt::format("{} of {} elements, {} tags", std::int64_t(own), n - seen, tags));
            in_.need_room(own, static_cast<std::uint64_t>(tags) + kind.nodes, 4, "elements");
            for (std::uint64_t i = 0; i < own; ++i) {
                if (in_.binary()) number = in_.integer("number of an element");
                element_2(number, kind, static_cast<std::uint64_t>(tags));
            }
            seen += own;
        }
    }

    void element_2(std::int32_t number, const Element& kind, std::uint64_t tags) {
        if (!kind.tetrahedron()) {
            soup_.surfaces += kind.dimension == 2;
            return in_.pass_over(tags + kind.nodes, 4, "element");
        }
        const std::int32_t group = tags > 0 ? in_.integer("physical group") : 0;
        const std::int32_t entity = tags > 1 ? in_.integer("entity") : 0;
        in_.pass_over(tags - std::min<std::uint64_t>(tags, 2), 4, "tags");
        add_tetrahedron(static_cast<std::uint64_t>(number), std::abs(std::int64_t(group)), entity, kind,
                        [&] { return node_tag(in_.integer("node of an element")); });
    }

    // The whole

    /// Elements come in blocks of an entity each; their tags tell the order that they had.
    void sort_by_tag() {
        if (std::is_sorted(element_tags_.begin(), element_tags_.end())) return;
        Array<std::size_t> order(element_tags_.size());
        std::iota(order.begin(), order.end(), std::size_t(0));
        std::stable_sort(order.begin(), order.end(),
                         [&](auto a, auto b) { return element_tags_[a] < element_tags_[b]; });
        const auto sorted = [&](const auto& from) {
            auto to = from;
            for (std::size_t i = 0; i < order.size(); ++i) to[i] = from[order[i]];
            return to;
        };
        soup_.tets = sorted(soup_.tets);
        groups_ = sorted(groups_);
        entities_ = sorted(entities_);
    }

    /// Regions are the physical groups, or the entities where no tetrahedron is in a group.
    void set_labels() {
        const bool grouped = std::any_of(groups_.begin(), groups_.end(), [](double g) { return g != 0; });
        soup_.labels = std::move(groups_);
        if (!grouped) std::copy(entities_.begin(), entities_.end(), soup_.labels.begin());
    }

    GmshSource in_;
    const Progress& progress_;
    bool nodes_ = false, elements_ = false;
    TetSoup soup_;
    std::map<std::int32_t, std::int64_t> group_of_;  // the first physical group of a volume
    Array<std::uint64_t> tags_, element_tags_;
    NodeTags node_;
    Array<double> groups_;
    Array<std::int32_t> entities_;
};

}  // namespace

TetSoup read_gmsh(const std::filesystem::path& path, const Progress& progress) {
    const MappedFile file(path);
    return Reader(file, progress).read();
}

}  // namespace vdbgeo::tet_formats
