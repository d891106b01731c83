#include "converters/mrc_new_header.h"

#include <Eigen/LU>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "converters/mrc_layout.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {

namespace {

constexpr const char* own_label = "Written by vdbgeo";

void set_cell(MrcHeader& h, const Mat3d& axes, const Vec3i& sampling) {
    const Vec3d voxel = axes.colwise().norm().transpose();
    if (!voxel.allFinite() || voxel.minCoeff() <= 0)
        throw InvalidInput("the voxel size is not positive along each axis");
    Vec3d angles;
    for (int a = 0; a < 3; ++a) {
        const int b = (a + 1) % 3, c = (a + 2) % 3;
        const double cosine = axes.col(b).dot(axes.col(c)) / (voxel[b] * voxel[c]);
        angles[a] = std::abs(cosine) < 1e-9 ? 90 : std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / M_PI;
    }
    const auto directions = cell_directions(angles);
    if (!directions || (*directions * voxel.asDiagonal() - axes).norm() > 1e-5 * voxel.maxCoeff())
        throw InvalidInput(
            "the axes of the map are turned or mirrored against x, y, z, which an MRC header cannot say");
    h.mx = sampling[0], h.my = sampling[1], h.mz = sampling[2];
    for (int a = 0; a < 3; ++a) {
        const std::size_t i = static_cast<std::size_t>(a);
        h.cell[i] = static_cast<float>(voxel[a] * sampling[a]);
        h.angles[i] = static_cast<float>(angles[a]);
    }
}

// The file's own M, where the map still has its voxels; on axes where M was the number of samples it stays
// so.
Vec3i sampling_of(const MrcRecord& record, const Vec3d& voxel, const Vec3i& size) {
    if (!record.sampling || !record.size || !record.voxel_size || record.sampling->minCoeff() <= 0)
        return size;
    if (!voxel.isApprox(*record.voxel_size, 1e-6)) return size;
    return (record.sampling->array() == record.size->array()).select(size, *record.sampling);
}

void set_position(MrcHeader& h, const MrcRecord& record, const Mat3d& axes, const Vec3d& origin,
                  const Vec3i& first) {
    if (!origin.allFinite()) throw InvalidInput("the position of the map is not finite");
    Vec3i start = Vec3i::Zero();
    const Vec3d steps = axes.inverse() * origin, whole = steps.array().round();
    const bool from_nstart =
        record.origin_rule == "nstart" && (steps - whole).norm() < 1e-4 && whole.cwiseAbs().maxCoeff() < 1e9;
    if (from_nstart) {
        start = whole.cast<int>();
    } else if (origin != Vec3d::Zero()) {  // readers look at NSTART only where ORIGIN is zero
        start = record.nstart + first;
        for (int a = 0; a < 3; ++a) h.origin[static_cast<std::size_t>(a)] = static_cast<float>(origin[a]);
    }
    h.nxstart = start[record.order[0]], h.nystart = start[record.order[1]],
    h.nzstart = start[record.order[2]];
}

int space_group(const MrcRecord& record, const MrcHeader& h) {
    if (record.ispg >= 1 && record.ispg <= 230) return record.ispg;
    if (record.ispg >= 401 && record.ispg <= 630) return record.ispg - 400;  // one volume of a stack
    return h.nz == 1 || h.mz == 1 ? 0 : 1;
}

std::vector<std::string> labels_of(const MrcRecord& record) {
    std::vector<std::string> labels;
    for (std::string label : record.labels) {
        label.resize(std::min<std::size_t>(label.size(), 80));
        for (char& c : label)
            if (static_cast<unsigned char>(c) < 32 || static_cast<unsigned char>(c) > 126) c = '?';
        if (label.find_first_not_of(' ') != std::string::npos && labels.size() < 10) labels.push_back(label);
    }
    if (labels.size() < 10 && std::find(labels.begin(), labels.end(), own_label) == labels.end())
        labels.push_back(own_label);
    return labels;
}

}  // namespace

MrcHeader new_mrc_header(const Frame& frame, const Vec3i& first, const MrcRecord& record, int mode,
                         bool unsigned_bytes) {
    MrcHeader h;
    const auto& order = record.order;
    h.nx = frame.size[order[0]], h.ny = frame.size[order[1]], h.nz = frame.size[order[2]];
    h.mapc = order[0] + 1, h.mapr = order[1] + 1, h.maps = order[2] + 1;
    h.mode = mode;
    set_cell(h, frame.axes, sampling_of(record, frame.voxel_size(), frame.size));
    set_position(h, record, frame.axes, frame.to_world(first.cast<double>()), first);
    h.ispg = space_group(record, h);
    h.nversion = 20141;
    h.map = {'M', 'A', 'P', ' '};
    if (unsigned_bytes) h.imod_stamp = imod_stamp_value;
    h.labels = labels_of(record);
    return h;
}

void state_scaling(MrcHeader& header, const MrcScaling& scaling) {
    constexpr const char* begin = "vdbgeo: density = ";
    std::vector<std::string>& labels = header.labels;
    labels.erase(std::remove_if(labels.begin(), labels.end(),
                                [&](const std::string& label) { return label.rfind(begin, 0) == 0; }),
                 labels.end());
    if (labels.size() == 10) labels.pop_back();
    // The shortest numbers that read back as the same doubles: 78 characters at most.
    labels.push_back(fmt::format("{}{} * stored + {}", begin, scaling.factor, scaling.offset));
}

}  // namespace vdbgeo
