// Gmsh's mesh files of version 4.1, binary: nodes and elements in blocks, one for each volume and surface.
#include <Eigen/Geometry>
#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "converters/tet_formats.h"

namespace vdbgeo::tet_formats {
namespace {

using mesh_formats::put;

/// Numbers 0 … n−1 sorted by the bins they are in, in their order within each.
struct Bins {
    Array<std::uint32_t> sorted;
    std::vector<std::size_t> ends;  ///< of each bin

    template <class BinOf>
    Bins(std::size_t n, std::size_t bins, const BinOf& bin_of) : sorted(n), ends(bins + 1, 0) {
        for (std::size_t i = 0; i < n; ++i) ++ends[bin_of(i) + 1];
        std::partial_sum(ends.begin(), ends.end(), ends.begin());
        for (std::size_t i = 0; i < n; ++i) sorted[ends[bin_of(i)]++] = static_cast<std::uint32_t>(i);
        ends.pop_back();
    }
    std::size_t begin(std::size_t bin) const { return bin == 0 ? 0 : ends[bin - 1]; }
    std::size_t size(std::size_t bin) const { return ends[bin] - begin(bin); }
    std::size_t used() const {
        std::size_t n = 0;
        for (std::size_t b = 0; b < ends.size(); ++b) n += size(b) > 0;
        return n;
    }
};

class Writer {
 public:
    explicit Writer(const TetOutput& out)
        : out_(out),
          mesh_(out.mesh),
          surfaces_(out.groups.size()),
          regions_(regions_of(mesh_)),
          tets_(mesh_.tets.size(), regions_.size(),
                [this](std::size_t t) { return volume(mesh_.region(t)); }),
          faces_(mesh_.faces.size(), surfaces_,
                 [this](std::size_t f) { return out_.groups.of(mesh_.face_regions[f]); }),
          file_(out.path) {}

    void write() {
        file_.write("$MeshFormat\n4.1 1 8\n");
        Buffer one;
        put(one, std::int32_t(1));
        flush(one);
        file_.write("\n$EndMeshFormat\n");
        names();
        entities();
        nodes();
        elements();
        file_.commit();
    }

 private:
    static std::vector<std::int32_t> regions_of(const TetMesh& mesh) {
        std::vector<std::int32_t> all;
        for (std::size_t t = 0; t < mesh.tets.size(); ++t)
            if (all.empty() || all.back() != mesh.region(t)) all.push_back(mesh.region(t));
        std::sort(all.begin(), all.end());
        all.erase(std::unique(all.begin(), all.end()), all.end());
        if (all.empty() && !mesh.points.empty()) all.push_back(1);  // points have to be in something
        return all;
    }
    std::size_t volume(std::int32_t region) const {
        return static_cast<std::size_t>(std::lower_bound(regions_.begin(), regions_.end(), region) -
                                        regions_.begin());
    }
    void flush(Buffer& buffer) {
        file_.write(buffer.data(), buffer.size());
        buffer.clear();
    }

    /// Physical groups: a surface's number is that of its group of faces, a volume's that of its region.
    void names() {
        std::string text = fmt::format("$PhysicalNames\n{}\n", surfaces_ + regions_.size());
        for (std::size_t g = 0; g < surfaces_; ++g)
            text += fmt::format("2 {} \"{}\"\n", g + 1, out_.groups.name(g));
        for (const std::int32_t region : regions_)
            text += fmt::format("3 {} \"region_{}\"\n", region, region);
        file_.write(text + "$EndPhysicalNames\n");
    }

    /// Tag, box and physical group of an entity; both numbers are the same.
    template <class Element>
    void put_entity(Buffer& buffer, std::int32_t tag, const Bins& bins, std::size_t bin,
                    const Array<Element>& all) const {
        Eigen::AlignedBox3d box;
        for (std::size_t i = bins.begin(bin); i < bins.ends[bin]; ++i)
            for (const VertexId v : all[bins.sorted[i]]) box.extend(mesh_.points[v]);
        if (box.isEmpty()) box.extend(Vec3d(0, 0, 0));
        put(buffer, tag);
        for (const Vec3d& corner : {box.min(), box.max()})
            for (const double c : corner) put(buffer, c);
        put(buffer, std::uint64_t(1));
        put(buffer, tag);
    }

    void entities() {
        Buffer buffer;
        for (const std::size_t n : {std::size_t(0), std::size_t(0), surfaces_, regions_.size()})
            put(buffer, static_cast<std::uint64_t>(n));
        std::vector<std::vector<std::int32_t>> boundary(regions_.size());
        for (std::size_t g = 0; g < surfaces_; ++g) {
            const auto [inside, outside] = out_.groups.regions(g);
            const auto tag = static_cast<std::int32_t>(g + 1);
            boundary[volume(inside)].push_back(tag);
            if (outside != 0) boundary[volume(outside)].push_back(-tag);
            put_entity(buffer, tag, faces_, g, mesh_.faces);
            put(buffer, std::uint64_t(0));  // curves
        }
        for (std::size_t r = 0; r < regions_.size(); ++r) {
            put_entity(buffer, regions_[r], tets_, r, mesh_.tets);
            put(buffer, static_cast<std::uint64_t>(boundary[r].size()));
            for (const std::int32_t tag : boundary[r]) put(buffer, tag);
        }
        file_.write("$Entities\n");
        flush(buffer);
        file_.write("\n$EndEntities\n");
    }

    /// Of each point the entity it is in, surfaces first: the first surface that it is on, else the first
    /// volume that has it as a corner, else the first of all.
    Array<std::uint32_t> entity_of_points() const {
        constexpr std::uint32_t none = 0xFFFFFFFFu;
        Array<std::uint32_t> entity(mesh_.points.size());
        std::fill(entity.begin(), entity.end(), none);
        const auto take = [&](const Bins& bins, const auto& all, std::size_t first) {
            for (std::size_t bin = 0; bin < bins.ends.size(); ++bin)
                for (std::size_t i = bins.begin(bin); i < bins.ends[bin]; ++i)
                    for (const VertexId v : all[bins.sorted[i]])
                        entity[v] = std::min(entity[v], static_cast<std::uint32_t>(first + bin));
        };
        take(faces_, mesh_.faces, 0);
        take(tets_, mesh_.tets, surfaces_);
        std::replace(entity.begin(), entity.end(), none, static_cast<std::uint32_t>(surfaces_));
        return entity;
    }

    /// Dimension and number of an entity, surfaces first.
    void put_block(Buffer& buffer, std::size_t entity) const {
        const bool surface = entity < surfaces_;
        put(buffer, std::int32_t(surface ? 2 : 3));
        put(buffer, surface ? static_cast<std::int32_t>(entity + 1) : regions_[entity - surfaces_]);
    }

    void put_sizes(Buffer& buffer, std::size_t blocks, std::size_t count) const {
        for (const std::size_t n : {blocks, count, std::size_t(count > 0), count})
            put(buffer, static_cast<std::uint64_t>(n));
    }

    void nodes() {
        const Array<std::uint32_t> entity = entity_of_points();
        const Bins bins(entity.size(), surfaces_ + regions_.size(), [&](std::size_t v) { return entity[v]; });
        file_.write("$Nodes\n");
        Buffer buffer;
        put_sizes(buffer, bins.used(), entity.size());
        for (std::size_t bin = 0; bin < bins.ends.size(); ++bin) {
            const std::size_t n = bins.size(bin);
            if (n == 0) continue;
            const std::uint32_t* const own = &bins.sorted[bins.begin(bin)];
            put_block(buffer, bin);
            put(buffer, std::int32_t(0));
            put(buffer, static_cast<std::uint64_t>(n));
            flush(buffer);
            const Progress progress = out_.progress.part(0, 0.3);
            write_elements(file_, n, progress,
                           [&](std::size_t i, Buffer& b) { put(b, std::uint64_t(own[i]) + 1); });
            write_elements(file_, n, progress, [&](std::size_t i, Buffer& b) {
                for (const double c : mesh_.points[own[i]]) put(b, c);
            });
        }
        flush(buffer);
        file_.write("\n$EndNodes\n");
    }

    template <class Element>
    void put_elements(Buffer& buffer, const Bins& bins, std::size_t bin, std::size_t entity, int type,
                      const Array<Element>& all, std::uint64_t first_tag) {
        const std::size_t n = bins.size(bin);
        if (n == 0) return;
        const std::uint32_t* const own = &bins.sorted[bins.begin(bin)];
        put_block(buffer, entity);
        put(buffer, std::int32_t(type));
        put(buffer, static_cast<std::uint64_t>(n));
        flush(buffer);
        write_elements(file_, n, out_.progress.part(0.3, 1), [&](std::size_t i, Buffer& b) {
            put(b, first_tag + own[i]);
            for (const VertexId v : all[own[i]]) put(b, std::uint64_t(v) + 1);
        });
    }

    /// Tetrahedra have the first tags, in their order, and faces those behind them.
    void elements() {
        constexpr int triangle = 2, tetrahedron = 4;
        file_.write("$Elements\n");
        Buffer buffer;
        put_sizes(buffer, faces_.used() + tets_.used(), mesh_.faces.size() + mesh_.tets.size());
        for (std::size_t g = 0; g < surfaces_; ++g)
            put_elements(buffer, faces_, g, g, triangle, mesh_.faces, mesh_.tets.size() + 1);
        for (std::size_t r = 0; r < regions_.size(); ++r)
            put_elements(buffer, tets_, r, surfaces_ + r, tetrahedron, mesh_.tets, 1);
        flush(buffer);
        file_.write("\n$EndElements\n");
    }

    const TetOutput& out_;
    const TetMesh& mesh_;
    std::size_t surfaces_;
    std::vector<std::int32_t> regions_;
    Bins tets_, faces_;
    AtomicFile file_;
};

}  // namespace

void write_gmsh(const TetOutput& out) { Writer(out).write(); }

}  // namespace vdbgeo::tet_formats
