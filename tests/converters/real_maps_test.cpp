// Every real map: there and back with nothing lost, flawless for others' readers, where others say it lies.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>

#include "converters/map_file.h"
#include "converters/vdb_file.h"
#include "converters/vdb_sections.h"
#include "tests/support/data.h"
#include "tests/support/mrc_bytes.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using openvdb::FloatGrid;
using test::data_folder;
using test::read_bytes;
using test::TempFolder;
namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t most_bytes = 60'000'000;  // as floats; the largest would take a minute each

/// Every map in the folder of real files that can be read and is not too large.
std::vector<fs::path> real_maps() {
    std::vector<fs::path> maps;
    for (const auto& entry : fs::recursive_directory_iterator(data_folder())) {
        if (!entry.is_regular_file() || !is_map_ending(entry.path())) continue;
        try {
            const MrcReader reader(entry.path());
            if (reader.frame().size.cast<double>().prod() * 4 > double(most_bytes)) continue;
            maps.push_back(entry.path());
        } catch (const InvalidInput&) {  // those that are refused have tests of their own
        }
    }
    std::sort(maps.begin(), maps.end());
    return maps;
}

std::vector<float> samples(const fs::path& path) {
    MrcReader reader(path);
    std::vector<float> values(static_cast<std::size_t>(reader.frame().size.cast<std::int64_t>().prod()));
    reader.read_sections(values.data(), reader.sections_left());
    return values;
}

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

/// The bytes behind the header of a plain file; empty where they cannot be compared.
std::string plain_data(const fs::path& path) {
    const MrcReader reader(path);
    if (reader.header().swapped || reader.volumes() > 1 || reader.value_type() == "int8 scaled") return "";
    const std::string bytes = read_bytes(path);
    if (bytes.size() < 1024 || bytes.compare(208, 3, "MAP") != 0)
        return "";  // compressed, or older than the word
    const std::size_t begin = 1024 + static_cast<std::size_t>(reader.header().nsymbt);
    const std::string written = begin < bytes.size() ? bytes.substr(begin) : "";
    const bool whole = reader.warnings().empty();
    return whole ? written : "";
}

void expect_same_frame(const Frame& a, const Frame& b) {
    EXPECT_EQ(a.size, b.size);
    EXPECT_LT((a.axes - b.axes).norm(), 1e-6 * a.axes.norm());
    EXPECT_LT((a.origin - b.origin).norm(), 1e-6 * (a.axes.norm() * a.size.maxCoeff() + a.origin.norm()));
}

void expect_same_grid(const FloatGrid& a, const FloatGrid& b) {
    ASSERT_TRUE(a.constTree().hasSameTopology(b.constTree()));
    auto p = a.cbeginValueAll(), q = b.cbeginValueAll();
    for (; p && q; ++p, ++q) {
        const float v = *p, w = *q;
        ASSERT_EQ(p.getCoord(), q.getCoord());
        ASSERT_EQ(std::memcmp(&v, &w, sizeof v), 0) << p.getCoord();
    }
}

const std::string python = "/usr/bin/python3 ";

bool has_python(const std::string& module) {
    return std::system((python + "-c 'import " + module + "' 2>/dev/null").c_str()) == 0;
}

}  // namespace

TEST(RealMaps, ToVdbAndBackWithNothingLost) {
    if (data_folder().empty()) GTEST_SKIP() << "needs real maps in the folder VDBGEO_DATA";
    TempFolder folder;
    const fs::path a = folder / "a.vdb", b = folder / "b.mrc", c = folder / "c.vdb", d = folder / "d.mrc";
    int with_bytes = 0;
    const auto maps = real_maps();
    for (const fs::path& path : maps) {
        SCOPED_TRACE(path.string());
        const MapFile map = read_map(path);
        write_vdb({map.map.grid}, a);
        write_mrc(VdbSections(a), b);
        const MrcReader before(path), after(b);
        expect_same_frame(before.frame(), after.frame());
        EXPECT_EQ(before.order(), after.order());
        EXPECT_TRUE(same_bits(samples(path), samples(b)));
        // What departs from the format is what departed before: a sampling is kept as it was.
        const std::vector<std::string> before_lines = validate_mrc(path);
        for (const std::string& line : validate_mrc(b))
            EXPECT_EQ(std::count(before_lines.begin(), before_lines.end(), line), 1) << line;
        const std::string data = plain_data(path);
        if (!data.empty()) {
            ++with_bytes;
            EXPECT_TRUE(data == plain_data(b));
        }
        // And the other way round: grid → map → grid → map.
        write_vdb({read_map(b).map.grid}, c);
        const auto first = read_vdb(a), second = read_vdb(c);
        expect_same_grid(*first, *second);
        expect_same_frame(map_from_grid(first).frame, map_from_grid(second).frame);
        write_mrc(VdbSections(c), d);
        EXPECT_TRUE(read_bytes(b) == read_bytes(d));
    }
    std::cout << maps.size() << " maps, " << with_bytes << " of them compared byte by byte\n";
    EXPECT_GE(maps.size(), 50u);
    EXPECT_GE(with_bytes, 25);
}

TEST(RealMaps, MrcfileAcceptsWhatIsWritten) {
    if (!has_python("mrcfile")) GTEST_SKIP() << "needs the Python package mrcfile (Debian: python3-mrcfile)";
    TempFolder folder;
    std::string files;
    const auto write = [&](const char* name, std::optional<int> mode, bool gzip) {
        MrcWriteOptions options;
        options.mode = mode;
        options.scaling = MrcWriteOptions::Scaling::automatic;
        const MapFile map = read_map(data_folder() / name);
        std::string out = std::string(name) + (mode ? "-" + std::to_string(*mode) : "");
        std::replace(out.begin(), out.end(), '/', '_');
        const fs::path path = folder / (out + (gzip ? ".mrc.gz" : ".mrc"));
        write_mrc(map.map, path, options);
        files += " " + path.string();
    };
    for (const char* name : {"mrcfile/EMD-3001.map",  // axes 3, 1, 2, a skewed cell, NSTART
                             "mrcfile/EMD-3197.map",  // NSTART
                             "hetchallenge/test_mask_dilated_wide.mrc",  // a stack of volumes
                             "pymol/h2o-elf-nstart-origin.mrc",          // ORIGIN too
                             "gemmi/1pfe_asu.msk.gz",                    // 120 degrees
                             "daq/2566_3J6B_9.mrc"}) {
        VDBGEO_NEEDS_DATA(name);
        for (const int mode : {0, 1, 2, 6, 12}) write(name, mode, false);
        write(name, 2, true);
        write(name, 1, true);
    }
    for (const char* name :
         {"aspire/rln_proj_64_centered.mrcs", "pyto/labels.mrc", "pyto/layers.mrc",
          "rosettasciio/HAADFscan.mrc", "mrcfile/float16.mrc", "visfd/test_image_membrane.rec"}) {
        VDBGEO_NEEDS_DATA(name);
        write(name, {}, false);
    }
    const std::string validate =
        python +
        "-c 'import mrcfile, sys; bad = [f for f in sys.argv[1:] if not mrcfile.validate(f)]; "
        "print(*bad); sys.exit(len(bad) > 0)'";
    EXPECT_EQ(std::system((validate + files).c_str()), 0);
    test::MrcBytes wrong;
    wrong.set(21, 99.f);
    test::write_bytes(folder / "wrong.mrc", wrong.str());
    EXPECT_NE(std::system((validate + " " + (folder / "wrong.mrc").string() + " > /dev/null").c_str()), 0)
        << "the check can fail";
}

TEST(RealMaps, MrcfileReadsGzipWithTheSameNumbers) {
    if (!has_python("mrcfile")) GTEST_SKIP() << "needs the Python package mrcfile (Debian: python3-mrcfile)";
    VDBGEO_NEEDS_DATA("multifit_groel/groel-11.5A.mrc");
    TempFolder folder;
    const fs::path path = data_folder() / "multifit_groel/groel-11.5A.mrc";
    write_mrc(read_map(path).map, folder / "a.mrc.gz");
    EXPECT_EQ(std::system((python +
                           "-W ignore -c 'import mrcfile, sys; a, b = (mrcfile.open(f, permissive=True) "
                           "for f in sys.argv[1:]); sys.exit(not (a.data == b.data).all())' " +
                           path.string() + " " + (folder / "a.mrc.gz").string())
                              .c_str()),
              0);
}

TEST(RealMaps, VoxelsLieWhereOthersSay) {
    if (data_folder().empty()) GTEST_SKIP() << "needs real maps in the folder VDBGEO_DATA";
    for (const char* module : {"gemmi", "numpy"})
        if (!has_python(module))
            GTEST_SKIP() << "needs the Python package " << module << " (Debian: python3-" << module << ")";
    TempFolder folder;
    std::string command = python + VDBGEO_TEST_FOLDER "/world_positions.py";
    for (const fs::path& path : real_maps()) command += " " + path.string();
    command += " > " + (folder / "told").string() + " 2> " + (folder / "gemmi").string();
    ASSERT_EQ(std::system(command.c_str()), 0) << read_bytes(folder / "gemmi");
    EXPECT_GE(std::atoi(read_bytes(folder / "gemmi").c_str()), 15) << "maps that gemmi agrees on";

    std::ifstream told(folder / "told");
    std::string last;
    FloatGrid::Ptr grid;
    Frame frame;
    int maps = 0, odd = 0;
    for (std::string line; std::getline(told, line);) {
        std::istringstream words(line);
        std::string path, number;
        Vec3i at;
        Vec3d position;
        words >> path >> at[0] >> at[1] >> at[2] >> position[0] >> position[1] >> position[2] >> number;
        const float value = std::strtof(number.c_str(), nullptr);
        if (path != last) {
            MapReadOptions options;
            // Bytes that a writer meant as unsigned are a matter of taste; the script takes them as signed.
            options.mrc.mode0 = MrcReadOptions::Mode0::as_signed;
            const DensityMap map = read_map(path, options).map;
            grid = map.grid;
            frame = map.frame;
            last = path;
            ++maps;
            const MrcReader reader(path);
            odd += reader.order() != std::array<int, 3>{0, 1, 2} || reader.origin_rule() != "zero" ||
                   !frame.axes.isDiagonal();
        }
        const double scale = frame.voxel_size().minCoeff();
        EXPECT_LT((frame.to_world(at.cast<double>()) - position).norm(),
                  1e-3 * scale + 2e-6 * position.norm())
            << line << "\nhere " << frame.to_world(at.cast<double>()).transpose();
        const float here = grid->tree().getValue({at[0], at[1], at[2]});
        EXPECT_TRUE(here == value || std::abs(here - value) <= 1e-6f * std::abs(value) ||
                    (std::isnan(here) && std::isnan(value)))
            << line << "\nhere " << here;
    }
    std::cout << maps << " maps, " << odd << " with odd axes, an origin or a skewed cell\n";
    EXPECT_GE(maps, 50);
    EXPECT_GE(odd, 30);
}
