#include <Eigen/LU>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "converters/dense_sections.h"
#include "converters/mrc.h"
#include "converters/mrc_header.h"
#include "converters/mrc_layout.h"
#include "converters/mrc_metadata.h"
#include "converters/running_statistics.h"
#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {

namespace {

constexpr const char* own_label = "Written by vdbgeo";

/// The part of the grid that is written.
struct Box {
    Vec3i first, size;
};

Box box_of(const DensityMap& map) {
    if (map.frame.bounded()) return {Vec3i::Zero(), map.frame.size};
    const openvdb::CoordBBox box = map.grid->evalActiveVoxelBoundingBox();
    if (box.empty()) throw InvalidInput("the map has neither a box nor an active voxel");
    Box result;
    for (int a = 0; a < 3; ++a) {
        const std::int64_t extent = std::int64_t(box.max()[a]) - box.min()[a] + 1;
        if (extent > std::numeric_limits<std::int32_t>::max())
            throw InvalidInput(
                fmt::format("the map has {} samples along one axis, an MRC file at most 2^31 - 1", extent));
        result.first[a] = box.min()[a];
        result.size[a] = static_cast<int>(extent);
    }
    return result;
}

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

MrcHeader make_header(const DensityMap& map, const MrcRecord& record, const Box& box, int mode,
                      bool unsigned_bytes) {
    MrcHeader h;
    const auto& order = record.order;
    h.nx = box.size[order[0]], h.ny = box.size[order[1]], h.nz = box.size[order[2]];
    h.mapc = order[0] + 1, h.mapr = order[1] + 1, h.maps = order[2] + 1;
    h.mode = mode;
    set_cell(h, map.frame.axes, sampling_of(record, map.frame.voxel_size(), box.size));
    set_position(h, record, map.frame.axes, map.frame.to_world(box.first.cast<double>()), box.first);
    h.ispg = space_group(record, h);
    h.nversion = 20141;
    h.map = {'M', 'A', 'P', ' '};
    if (unsigned_bytes) h.imod_stamp = imod_stamp_value;
    h.labels = labels_of(record);
    return h;
}

void set_statistics(MrcHeader& h, const Statistics& s) {
    if (s.count == s.non_finite) return;  // the values that mean "not determined" stay
    h.dmin = static_cast<float>(s.min);
    h.dmax = static_cast<float>(s.max);
    h.dmean = static_cast<float>(s.mean);
    h.rms = static_cast<float>(s.rms);
}

/// Packs sections of floats into the samples of a file.
class Packer {
 public:
    Packer(SampleType type, const MrcHeader& header, const Box& box, const std::array<int, 3>& order)
        : type_(type),
          box_(box),
          order_(order),
          mode_(header.mode),
          columns_(static_cast<std::size_t>(header.nx)),
          rows_(static_cast<std::size_t>(header.ny)),
          row_bytes_(row_bytes(type, columns_)) {}

    const Array<char>& pack(const float* values, int section, int count) {
        const std::size_t rows = rows_ * static_cast<std::size_t>(count);
        packed_.resize(rows * row_bytes_);
        bad_.assign(rows, columns_);
        parallel_for(rows, 16, [&](std::size_t row) {
            bad_[row] = floats_to_samples(type_, values + row * columns_, packed_.data() + row * row_bytes_,
                                          columns_);
        });
        for (std::size_t row = 0; row < rows; ++row)
            if (bad_[row] < columns_) refuse(values[row * columns_ + bad_[row]], section, row, bad_[row]);
        return packed_;
    }

    /// The values as a reader of the file will see them.
    void unpack(float* values) const {
        const std::size_t rows = bad_.size();
        parallel_for(rows, 16, [&](std::size_t row) {
            samples_to_float(type_, false, packed_.data() + row * row_bytes_, values + row * columns_,
                             columns_);
        });
    }

 private:
    [[noreturn]] void refuse(float value, int section, std::size_t row, std::size_t column) const {
        Vec3i index = box_.first;
        index[order_[0]] += static_cast<int>(column);
        index[order_[1]] += static_cast<int>(row % rows_);
        index[order_[2]] += section + static_cast<int>(row / rows_);
        const char* range = "";
        switch (type_) {
            case SampleType::int8:
                range = "whole numbers from -128 to 127";
                break;
            case SampleType::uint8:
                range = "whole numbers from 0 to 255";
                break;
            case SampleType::int16:
                range = "whole numbers from -32768 to 32767";
                break;
            case SampleType::uint16:
                range = "whole numbers from 0 to 65535";
                break;
            case SampleType::uint4:
                range = "whole numbers from 0 to 15";
                break;
            default:
                range = "numbers from -65504 to 65504";
                break;
        }
        throw InvalidInput(
            fmt::format("the value {} at voxel ({}, {}, {}) does not fit into mode {}, expected {}; "
                        "mode 2 holds every value",
                        value, index[0], index[1], index[2], mode_, range));
    }

    SampleType type_;
    Box box_;
    std::array<int, 3> order_;
    int mode_;
    std::size_t columns_, rows_, row_bytes_;
    Array<char> packed_;
    std::vector<std::size_t> bad_;
};

void write_checked(const DensityMap& map, const std::filesystem::path& path, const MrcWriteOptions& options,
                   const Progress& progress) {
    const MrcRecord record = recall_mrc_metadata(*map.grid);
    const Box box = box_of(map);
    const int mode = options.mode.value_or(record.mode.value_or(2));
    const bool unsigned_bytes = mode == 0 && !options.mode && record.unsigned_bytes;
    MrcHeader header = make_header(map, record, box, mode, unsigned_bytes);
    const SampleType type = sample_type(mode, unsigned_bytes);
    const DenseSections sections(*map.grid, box.first, box.size, record.order);
    Packer packer(type, header, box, record.order);
    Array<float> values(sections.largest_piece());

    const auto each_piece = [&](const Progress& part, const auto& body) {
        for (int section = 0; section < header.nz;) {
            const int count = sections.piece(section);
            sections.fill(section, values.data());
            body(section, count,
                 values.size() / static_cast<std::size_t>(std::min(8, header.nz)) *
                     static_cast<std::size_t>(count));
            section += count;
            part.report(static_cast<double>(section) / header.nz);
        }
    };
    RunningStatistics statistics;
    each_piece(progress.part(0, 0.4), [&](int section, int count, std::size_t samples) {
        if (type != SampleType::float32) {
            packer.pack(values.data(), section, count);
            packer.unpack(values.data());
        }
        statistics.add(values.data(), samples);
    });
    set_statistics(header, statistics.result());

    AtomicFile file(path);
    const MrcHeaderBytes bytes = encode_mrc_header(header);
    file.write(bytes.data(), bytes.size());
    each_piece(progress.part(0.4, 1), [&](int section, int count, std::size_t samples) {
        if (type == SampleType::float32) {
            file.write(values.data(), samples * sizeof(float));
        } else {
            const Array<char>& packed = packer.pack(values.data(), section, count);
            file.write(packed.data(), packed.size());
        }
    });
    file.commit();
}

}  // namespace

void MrcWriteOptions::check() const {
    if (mode && !readable_mode(*mode))
        throw InvalidInput(fmt::format("mode {} cannot be written, expected 0, 1, 2, 6, 12 or 101", *mode));
}

void write_mrc(const DensityMap& map, const std::filesystem::path& path, const MrcWriteOptions& options,
               const Progress& progress) {
    options.check();
    if (!map.grid) throw InvalidInput(path.string() + ": there is no grid to write");
    try {
        write_checked(map, path, options, progress);
    } catch (const InvalidInput& error) {
        throw InvalidInput(path.string() + ": " + error.what());
    }
}

}  // namespace vdbgeo
