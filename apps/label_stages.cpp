#include "apps/label_stages.h"

#include <fmt/format.h>

#include <charconv>

#include "apps/session.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::app {

std::vector<std::int64_t> parse_labels(const std::string& text) {
    std::vector<std::int64_t> labels;
    if (text == "all") return labels;
    const char *at = text.data(), *end = text.data() + text.size();
    for (bool more = true; more;) {
        std::int64_t label = 0;
        const auto [rest, error] = std::from_chars(at, end, label);
        more = rest != end && *rest == ',';
        if (error != std::errc() || (rest != end && !more))
            throw UsageError(fmt::format("--labels: '{}' is neither all nor a list such as 1,2,5", text));
        labels.push_back(label);
        at = rest + 1;
    }
    return labels;
}

void need_labels(const std::string& file, const DensityMap& map) {
    if (!is_label_map(map))
        throw InvalidInput(fmt::format(
            "{}: not a segmentation: its samples are not whole numbers, or there are too many different ones",
            file));
}

TriMesh join_labels(const std::vector<LabelSurface>& surfaces, const std::string& file) {
    TriMesh all;
    MeshProperty label{"label", 1, {}};
    for (const LabelSurface& s : surfaces) {
        if (all.points.size() + s.mesh.points.size() > TriMesh::max_vertices)
            throw InvalidInput(
                fmt::format("{}: the labels' surfaces have more than 2^32-1 vertices together", file));
        const auto first = static_cast<VertexId>(all.points.size());
        all.points.insert(all.points.end(), s.mesh.points.begin(), s.mesh.points.end());
        for (const Triangle& t : s.mesh.triangles)
            all.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
        label.values.resize(all.triangles.size(), static_cast<float>(s.label));
    }
    all.face_properties.push_back(std::move(label));
    return all;
}

}  // namespace vdbgeo::app
