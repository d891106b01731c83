#include "converters/mrc_layout.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "converters/mrc_header.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {

namespace {

constexpr std::uint64_t too_many = std::numeric_limits<std::uint64_t>::max();
constexpr const char* axis_names = "XYZ";

// An NSYMBT up to this size may be a promise that was not kept; beyond it is junk.
constexpr std::uint64_t largest_absent_header = 1 << 24;

std::uint64_t product(std::uint64_t a, std::uint64_t b) {
    std::uint64_t result = 0;
    return __builtin_mul_overflow(a, b, &result) ? too_many : result;
}

std::uint64_t sum(std::uint64_t a, std::uint64_t b) {
    std::uint64_t result = 0;
    return __builtin_add_overflow(a, b, &result) ? too_many : result;
}

SampleType stored_type(const MrcHeader& h, const MrcReadOptions& options) {
    using Mode0 = MrcReadOptions::Mode0;
    const bool imod_unsigned = h.imod_stamp == imod_stamp_value && (h.imod_flags & 1) == 0;
    return sample_type(
        h.mode, options.mode0 == Mode0::as_unsigned || (options.mode0 == Mode0::automatic && imod_unsigned));
}

/// Works the layout out, step by step; each step may warn.
class Interpreter {
 public:
    Interpreter(const MrcHeader& header, const MrcReadOptions& options, const std::string& file)
        : h_(header), options_(options), file_(file) {}

    MrcLayout run(std::optional<std::uint64_t> length, std::uint64_t bound) {
        out_.type = stored_type(h_, options_);
        out_.columns = static_cast<std::uint64_t>(h_.nx);
        out_.rows = static_cast<std::uint64_t>(h_.ny);
        out_.row_bytes = row_bytes(out_.type, out_.columns);
        out_.section_bytes = product(out_.row_bytes, out_.rows);
        out_.order = {h_.mapc - 1, h_.mapr - 1, h_.maps - 1};
        find_data(length, bound);
        scaled_bytes();
        stack();
        voxel_size();
        warn_of_images();
        skew();
        origin();
        return std::move(out_);
    }

 private:
    template <class... Args>
    void warn(const char* format, const Args&... args) {
        out_.warnings.push_back(fmt::format(fmt::runtime(format), args...));
    }
    template <class... Args>
    [[noreturn]] void refuse(const char* format, const Args&... args) const {
        throw InvalidInput(file_ + ": " + fmt::format(fmt::runtime(format), args...));
    }

    void find_data(std::optional<std::uint64_t> length, std::uint64_t bound) {
        const std::uint64_t extended = static_cast<std::uint64_t>(h_.nsymbt);
        const std::uint64_t data = product(out_.section_bytes, static_cast<std::uint64_t>(h_.nz));
        const std::uint64_t promised = promised_bytes(h_);
        const std::string size = fmt::format("{} x {} x {} samples of mode {}", h_.nx, h_.ny, h_.nz, h_.mode);
        out_.data_start = mrc_header_bytes + extended;
        out_.data_end = promised;
        if (length && *length < promised && extended > 0 && extended <= largest_absent_header &&
            *length == sum(mrc_header_bytes, data)) {
            warn(
                "NSYMBT (word 24) promises an extended header of {} bytes that is not there; "
                "the data starts at byte 1024",
                extended);
            out_.data_start = mrc_header_bytes;
            out_.data_end = *length;
        } else if (length && *length < mrc_header_bytes + extended) {
            refuse(
                "the extended header reaches past the end of the file: NSYMBT (word 24) is {}, "
                "expected at most {}",
                extended, *length - mrc_header_bytes);
        } else if (length && *length < promised) {
            refuse(
                "the file is cut off: expected {} bytes for {} (words 1-4) behind {} bytes of header "
                "(NSYMBT, word 24), found {}",
                promised, size, out_.data_start, *length);
        } else if (promised > bound) {
            refuse(
                "the file is cut off: expected {} bytes for {} (words 1-4), but its compressed data can hold "
                "at most {}",
                promised, size, bound);
        }
        if (length && *length > out_.data_end)
            warn("{} bytes follow the data: expected {} bytes (words 1-4 and 24), found {}",
                 *length - out_.data_end, out_.data_end, *length);
    }

    // Bytes made of floats by the tool mapmode2to0: -128 stands for DMIN and 127 for DMAX.
    void scaled_bytes() {
        if (out_.type != SampleType::int8 || h_.imod_flags != -128 || h_.word41 != 127) return;
        if (!std::isfinite(h_.dmin) || !std::isfinite(h_.dmax) || h_.dmin >= h_.dmax) {
            warn(
                "words 40 and 41 mark the bytes as scaled, but DMIN and DMAX (words 20, 21) are {} and {}; "
                "bytes are read as they are",
                h_.dmin, h_.dmax);
            return;
        }
        out_.byte_scaled = true;
        out_.scale = (h_.dmax - h_.dmin) / 255;
        out_.shift = (h_.dmin + h_.dmax + out_.scale) / 2;
        warn("words 40 and 41 mark the bytes as scaled: value = {} * byte + {}", out_.scale, out_.shift);
    }

    void stack() {
        const bool declared = h_.ispg >= 401 && h_.ispg <= 630;
        if ((h_.ispg < 0 || h_.ispg > 230) && !declared)
            warn("ISPG (word 23) is {}, expected 0-230 or 401-630; read as one volume", h_.ispg);
        out_.sections = h_.nz;
        if (declared && (h_.maps != 3 || h_.mz <= 0 || h_.nz % h_.mz != 0)) {
            warn(
                "ISPG (word 23) {} declares a stack of volumes, but MZ (word 10) {} does not divide NZ (word "
                "3) {} "
                "along the sections; read as one volume",
                h_.ispg, h_.mz, h_.nz);
        } else if (declared) {
            out_.volumes = h_.nz / h_.mz;
            out_.sections = h_.mz;
            if (out_.volumes > 1)
                warn("the file is a stack of {} volumes (ISPG {}); this is volume {}", out_.volumes, h_.ispg,
                     options_.volume);
        }
        if (options_.volume >= out_.volumes)
            refuse("there is no volume {}: expected 0 to {} (ISPG, word 23, is {}, MZ, word 10, is {})",
                   options_.volume, out_.volumes - 1, h_.ispg, h_.mz);
        out_.last_volume = options_.volume == out_.volumes - 1;
        out_.data_start += static_cast<std::uint64_t>(options_.volume) *
                           product(out_.section_bytes, static_cast<std::uint64_t>(out_.sections));
        out_.frame.size[out_.order[0]] = h_.nx;
        out_.frame.size[out_.order[1]] = h_.ny;
        out_.frame.size[out_.order[2]] = out_.sections;
    }

    void check_cell() const {
        for (int a = 0; a < 3; ++a) {
            const float length = h_.cell[static_cast<std::size_t>(a)];
            if (!std::isfinite(length))
                refuse(
                    "the cell length (word {}) is {}, expected a number of angstroms; a voxel size can be "
                    "given",
                    11 + a, length);
            if (length < 0)
                refuse(
                    "the cell length (word {}) is negative: {}, expected a number of angstroms; a voxel size "
                    "can be given",
                    11 + a, length);
        }
    }

    // Cell over M, or over the number of samples on an axis where only that agrees with the other axes.
    void voxel_size() {
        const Vec3i m(h_.mx, h_.my, h_.mz), n = out_.frame.size;
        Vec3d voxel;
        if (options_.voxel_size_A) {
            voxel = *options_.voxel_size_A;
            out_.sampling = m.minCoeff() > 0 ? m : n;
        } else {
            check_cell();
            const Vec3d cell(h_.cell[0], h_.cell[1], h_.cell[2]);
            out_.sampling = choose_sampling(cell, m, n);
            voxel = cell.cwiseQuotient(out_.sampling.cast<double>());
            for (int a = 0; a < 3; ++a) {
                if (voxel[a] > 1e-4) continue;
                warn("the cell length {} along {} (word {}) gives no voxel size; 1 A is taken", cell[a],
                     axis_names[a], 11 + a);
                voxel[a] = 1;
                out_.sampling[a] = n[a];
            }
        }
        const std::optional<Mat3d> directions = cell_directions({h_.angles[0], h_.angles[1], h_.angles[2]});
        if (!directions)
            warn("the cell angles (words 14-16) {}, {}, {} make no cell; 90 degrees are taken", h_.angles[0],
                 h_.angles[1], h_.angles[2]);
        out_.frame.axes = directions.value_or(Mat3d::Identity()) * voxel.asDiagonal();
    }

    Vec3i choose_sampling(const Vec3d& cell, const Vec3i& m, const Vec3i& n) {
        const Vec3i usable = (m.array() > 0).select(m, n);
        const Vec3d by_m = cell.cwiseQuotient(usable.cast<double>());
        const Vec3d by_n = cell.cwiseQuotient(n.cast<double>());
        Vec3i chosen = usable;
        for (int a = 0; a < 3; ++a) {
            const double p = by_m[(a + 1) % 3], q = by_m[(a + 2) % 3];
            const double others = std::max(p, q), least = std::min(p, q);
            const bool far_off = least > 0 && by_m[a] > 10 * others;
            const bool agrees = by_n[a] <= 2 * others && by_n[a] >= least / 2;
            if (m[a] <= 0 || (far_off && agrees)) {
                chosen[a] = n[a];
                warn(
                    "M{0} (word {1}) is {2} for {3} samples along {0}; the voxel size there is the cell over "
                    "{3}",
                    axis_names[a], 8 + a, m[a], n[a]);
            }
        }
        if (m[0] != m[1] && m[0] == n[1] && m[1] == n[0])
            warn(
                "MX and MY (words 8, 9) are {} and {}, swapped against the numbers of samples {} and {}; "
                "the voxel size is the cell over M",
                m[0], m[1], n[0], n[1]);
        return chosen;
    }

    void warn_of_images() {
        const bool images = h_.ispg == 0 && h_.nz > 1 && h_.maps == 3 && h_.mz == 1 && out_.sampling[2] == 1;
        if (images)
            warn("the file is a stack of {} images, not a volume: ISPG (word 23) is 0 and MZ (word 10) is 1",
                 h_.nz);
    }

    // Words 25-37 of CCP4 files before MRC2014: map = S (world - t).
    void skew() {
        const bool version = h_.nversion == 20140 || h_.nversion == 20141;
        if (h_.lskflg != 1 || version || h_.imod_stamp == imod_stamp_value) return;
        if (Vec3d(h_.origin[0], h_.origin[1], h_.origin[2]) != Vec3d::Zero()) {
            warn(
                "LSKFLG (word 25) is 1 but ORIGIN (words 50-52) is set; the skew transformation is not used");
            return;
        }
        Mat3d s;
        for (int i = 0; i < 9; ++i) s(i / 3, i % 3) = h_.skwmat[static_cast<std::size_t>(i)];
        const Vec3d t(h_.skwtrn[0], h_.skwtrn[1], h_.skwtrn[2]);
        if (!t.allFinite() || !s.allFinite() || (s * s.transpose() - Mat3d::Identity()).norm() > 0.01) {
            warn("LSKFLG (word 25) is 1 but words 26-37 are no rotation and translation; they are not used");
            return;
        }
        turn_ = s.inverse();
        shift_ = t;
    }

    double longest_edge() const {
        return out_.frame.voxel_size().cwiseProduct(out_.frame.size.cast<double>()).maxCoeff();
    }

    std::optional<Vec3d> origin_words(bool any) {
        const Vec3d words(h_.origin[0], h_.origin[1], h_.origin[2]);
        if (any) {
            if (!words.allFinite())
                refuse("ORIGIN (words 50-52) is {}, {}, {}, expected numbers", words[0], words[1], words[2]);
            return words;
        }
        if (words == Vec3d::Zero()) return std::nullopt;
        const double limit = 10 * longest_edge();
        if (words.allFinite() && words.cwiseAbs().maxCoeff() <= limit) return words;
        warn("ORIGIN (words 50-52) {}, {}, {} is not within ten boxes ({} A) and is not used", words[0],
             words[1], words[2], limit);
        return std::nullopt;
    }

    std::optional<Vec3d> nstart_words(bool any) {
        const std::array<std::int32_t, 3> start{h_.nxstart, h_.nystart, h_.nzstart};
        Vec3d steps;
        for (std::size_t i = 0; i < 3; ++i) {
            const int axis = out_.order[i];
            steps[axis] = start[i];
            const double most = 10.0 * std::max(out_.frame.size[axis], out_.sampling[axis]);
            if (any || std::abs(steps[axis]) <= most) continue;
            warn("NSTART (word {}) is {} for {} samples and is not used", 5 + i, start[i],
                 out_.frame.size[axis]);
            return std::nullopt;
        }
        if (!any && steps == Vec3d::Zero()) return std::nullopt;
        return out_.frame.axes * steps;
    }

    void origin() {
        Frame& frame = out_.frame;
        switch (options_.origin) {
            case OriginRule::given:
                place(options_.origin_A, "given");
                return;
            case OriginRule::zero:
                place(Vec3d::Zero(), "zero");
                return;
            case OriginRule::header:
                place(*origin_words(true), "header");
                return;
            case OriginRule::nstart:
                place(turn_ * *nstart_words(true), "nstart");
                return;
            case OriginRule::automatic:
                break;
        }
        if (const auto words = origin_words(false)) {
            place(*words, "header");
            return;
        }
        const auto start = nstart_words(false);
        frame.origin = start ? Vec3d(turn_ * *start) : Vec3d(0, 0, 0);
        if (shift_ != Vec3d::Zero())
            place(frame.origin + shift_, start ? "nstart+skwtrn" : "skwtrn");
        else
            place(frame.origin, start ? "nstart" : "zero");
    }

    void place(const Vec3d& origin, const char* rule) {
        out_.frame.origin = origin;
        out_.frame.axes = turn_ * out_.frame.axes;
        out_.origin_rule = rule;
    }

    const MrcHeader& h_;
    const MrcReadOptions& options_;
    const std::string& file_;
    MrcLayout out_;
    Mat3d turn_ = Mat3d::Identity();
    Vec3d shift_ = Vec3d::Zero();
};

}  // namespace

std::optional<Mat3d> cell_directions(const Vec3d& angles) {
    if (!(angles.minCoeff() > 0 && angles.maxCoeff() < 180)) return std::nullopt;
    const auto cosine = [&](int i) { return angles[i] == 90 ? 0.0 : std::cos(angles[i] * M_PI / 180); };
    const double ca = cosine(0), cb = cosine(1), cg = cosine(2);
    const double sg = std::sqrt(1 - cg * cg);
    const double cy = (ca - cb * cg) / sg, height = 1 - cb * cb - cy * cy;
    if (!(sg > 1e-2 && height > 1e-4)) return std::nullopt;
    Mat3d directions;
    directions << 1, cg, cb,  //
        0, sg, cy,            //
        0, 0, std::sqrt(height);
    return directions;
}

std::uint64_t promised_bytes(const MrcHeader& h) {
    const SampleType type = stored_type(h, {});
    const std::uint64_t section =
        product(row_bytes(type, static_cast<std::uint64_t>(h.nx)), static_cast<std::uint64_t>(h.ny));
    const std::uint64_t data = product(section, static_cast<std::uint64_t>(h.nz));
    return sum(mrc_header_bytes + static_cast<std::uint64_t>(h.nsymbt), data);
}

void check_mrc_header(const MrcHeader& h, const std::string& file) {
    const auto refuse = [&](const std::string& what) { throw InvalidInput(file + ": " + what); };
    if (h.mode == 3 || h.mode == 4)
        refuse(fmt::format(
            "mode {} (word 4) is a transform of complex numbers ({}), expected mode 0, 1, 2, 6, 12 "
            "or 101",
            h.mode, h.mode == 3 ? "16-bit integers" : "32-bit floats"));
    if (!readable_mode(h.mode))
        refuse(fmt::format("the mode (word 4) is {}, expected 0, 1, 2, 6, 12 or 101; is it an MRC/CCP4 map?",
                           h.mode));
    const std::array<std::int32_t, 3> size{h.nx, h.ny, h.nz};
    for (std::size_t i = 0; i < 3; ++i)
        if (size[i] <= 0)
            refuse(fmt::format("the number of {} (word {}) is {}, expected at least 1",
                               std::array{"columns", "rows", "sections"}[i], i + 1, size[i]));
    std::array<std::int32_t, 3> axes{h.mapc, h.mapr, h.maps};
    std::sort(axes.begin(), axes.end());
    if (axes != std::array<std::int32_t, 3>{1, 2, 3})
        refuse(fmt::format(
            "the axes MAPC, MAPR, MAPS (words 17-19) are {}, {}, {}, expected 1, 2, 3 in some order", h.mapc,
            h.mapr, h.maps));
    if (h.nsymbt < 0)
        refuse(fmt::format("the size of the extended header NSYMBT (word 24) is {}, expected 0 or more",
                           h.nsymbt));
}

MrcLayout lay_out(const MrcHeader& header, const MrcReadOptions& options, const std::string& file,
                  std::optional<std::uint64_t> length, std::uint64_t bound) {
    return Interpreter(header, options, file).run(length, bound);
}

}  // namespace vdbgeo
