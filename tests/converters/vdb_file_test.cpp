// VDB files: the bytes are OpenVDB's own, and what was written is read back.
#include "converters/vdb_file.h"

#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <openvdb/io/Stream.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>

#include "converters/self_writing_grid.h"
#include "tests/support/data.h"
#include "tests/support/maps.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using openvdb::Coord;
using openvdb::FloatGrid;
using test::read_bytes;
using test::TempFolder;
using Compression = VdbWriteOptions::Compression;

namespace {

constexpr std::size_t identifier_at = 21, identifier_bytes = 36;

FloatGrid::Ptr noise_grid() {
    SparsifyOptions some;
    some.threshold = 0.2f;
    DensityMap map = test::map_from_values(Vec3i(50, 41, 33), test::noise(50 * 41 * 33, 7), {}, some);
    map.grid->insertMeta("note", openvdb::StringMetadata("of noise"));
    return map.grid;
}

FloatGrid::Ptr band_grid() {  // two inactive values in a leaf, and tiles of both kinds
    SparsifyOptions band;
    band.threshold = 20;
    band.band = 3;
    DensityMap map = test::map_from_function(
        Vec3i(90, 80, 70), {}, [](const Vec3d& p) { return 40 - (p - Vec3d(40, 40, 35)).norm(); }, band);
    map.grid->setName("band");
    return map.grid;
}

FloatGrid::Ptr sphere() {
    auto grid = openvdb::tools::createLevelSetSphere<FloatGrid>(20, openvdb::Vec3f(1, 2, 3), 1);
    grid->setName("sphere");
    return grid;
}

FloatGrid::Ptr tiles_only() {
    auto grid = FloatGrid::create(-1);
    grid->setName("tiles");
    grid->tree().addTile(3, Coord(-4096, 0, 0), 2, true);
    grid->tree().addTile(2, Coord(128, 0, 0), 3, true);
    grid->tree().addTile(1, Coord(8, 8, 8), 4, false);
    return grid;
}

FloatGrid::Ptr empty_grid() {
    auto grid = FloatGrid::create(5);
    grid->setName("empty");
    return grid;
}

openvdb::GridBase::Ptr vectors() {
    auto grid = openvdb::Vec3SGrid::create(openvdb::Vec3f(1, 2, 3));
    grid->setName("vectors");
    for (int i = 0; i < 100; ++i) grid->tree().setValue(Coord(i, -i, 3 * i), openvdb::Vec3f(float(i)));
    return grid;
}

openvdb::GridBase::Ptr whole_numbers() {
    auto grid = openvdb::Int32Grid::create(0);
    grid->setName("whole");
    for (int i = 0; i < 3000; ++i) grid->tree().setValue(Coord(i % 40, i / 40, i % 7), i);
    return grid;
}

openvdb::GridCPtrVec all_grids() {
    return {noise_grid(), band_grid(), sphere(), tiles_only(), empty_grid(), vectors(), whole_numbers()};
}

std::uint32_t flags_of(Compression c) {
    std::uint32_t flags = openvdb::io::COMPRESS_ACTIVE_MASK;
    if (c == Compression::zip) flags |= openvdb::io::COMPRESS_ZIP;
    if (c == Compression::blosc) flags |= openvdb::io::COMPRESS_BLOSC;
    return flags;
}

/// The metadata of a whole file: in ours, the checksum.
openvdb::MetaMap file_metadata(const std::filesystem::path& path) {
    openvdb::io::File file(path.string());
    file.open(false);
    return *file.getMetadata();
}

/// A grid whose nodes and leaves OpenVDB writes, as it would those of any, but without notes for delayed
/// loading.
struct PlainGrid : SelfWritingGrid {
    explicit PlainGrid(const FloatGrid& grid)
        : SelfWritingGrid(std::const_pointer_cast<openvdb::FloatTree>(grid.constTreePtr())) {
        static_cast<openvdb::MetaMap&>(*this) = grid;
        setTransform(std::const_pointer_cast<openvdb::math::Transform>(grid.constTransformPtr()));
    }
    void write_nodes(std::ostream& os) const override { FloatGrid::writeTopology(os); }
    void writeBuffers(std::ostream& os) const override {
        ++calls;
        FloatGrid::writeBuffers(os);
    }
    mutable int calls = 0;
};

/// What OpenVDB's own writer makes of the grids, given the metadata of the file.
std::string reference_bytes(const openvdb::GridCPtrVec& grids, const std::filesystem::path& path,
                            const VdbWriteOptions& options, const openvdb::MetaMap& metadata) {
    openvdb::GridCPtrVec copies;
    for (const auto& grid : grids) {
        const auto floats = openvdb::GridBase::grid<FloatGrid>(grid);
        const auto copy = floats ? openvdb::GridBase::Ptr(std::make_shared<PlainGrid>(*floats))
                                 : std::const_pointer_cast<openvdb::GridBase>(grid->copyGrid());
        if (options.half) copy->setSaveFloatAsHalf(true);
        copies.push_back(copy);
    }
    openvdb::io::File file(path.string());
    file.setCompression(flags_of(options.compression));
    file.write(copies, metadata);
    file.close();
    return read_bytes(path);
}

std::string without_identifier(std::string bytes) {
    return bytes.replace(identifier_at, identifier_bytes, identifier_bytes, '-');
}

template <class Tree>
::testing::AssertionResult same_tree(const Tree& a, const Tree& b) {
    if (!a.hasSameTopology(b)) return ::testing::AssertionFailure() << "topologies differ";
    if (a.background() != b.background()) return ::testing::AssertionFailure() << "backgrounds differ";
    auto p = a.cbeginValueAll(), q = b.cbeginValueAll();
    for (; p && q; ++p, ++q)
        if (p.getCoord() != q.getCoord() || p.isValueOn() != q.isValueOn() || *p != *q)
            return ::testing::AssertionFailure() << "values differ at " << p.getCoord();
    if (p || q) return ::testing::AssertionFailure() << "one has more values";
    return ::testing::AssertionSuccess();
}

std::string refusal(const std::filesystem::path& path, const std::optional<std::string>& name = {}) {
    try {
        read_vdb(path, name);
    } catch (const InvalidInput& e) {
        return e.what();
    }
    return "";
}

bool contains(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
}

const VdbWriteOptions all_options[] = {{Compression::none, false},  {Compression::zip, false},
                                       {Compression::blosc, false}, {Compression::none, true},
                                       {Compression::zip, true},    {Compression::blosc, true}};

std::string name_of(const ::testing::TestParamInfo<VdbWriteOptions>& test) {
    const char* names[] = {"none", "zip", "blosc"};
    return std::string(names[static_cast<int>(test.param.compression)]) + (test.param.half ? "_half" : "");
}

class VdbWrite : public ::testing::TestWithParam<VdbWriteOptions> {};

}  // namespace

TEST_P(VdbWrite, BytesAreThoseOfOpenVdbButForTheIdentifier) {
    TempFolder folder;
    for (const auto& grid : all_grids()) {
        write_vdb({grid}, folder / "ours.vdb", GetParam());
        const std::string ours = read_bytes(folder / "ours.vdb");
        const std::string theirs =
            reference_bytes({grid}, folder / "theirs.vdb", GetParam(), file_metadata(folder / "ours.vdb"));
        EXPECT_EQ(ours.size(), theirs.size()) << grid->getName();
        EXPECT_TRUE(without_identifier(ours) == without_identifier(theirs)) << grid->getName();
    }
    write_vdb(all_grids(), folder / "ours.vdb", GetParam());
    EXPECT_TRUE(without_identifier(read_bytes(folder / "ours.vdb")) ==
                without_identifier(reference_bytes(all_grids(), folder / "theirs.vdb", GetParam(),
                                                   file_metadata(folder / "ours.vdb"))));
}

TEST_P(VdbWrite, SameBytesForAnyNumberOfThreadsAndEveryTime) {
    TempFolder folder;
    std::string first;
    for (const std::size_t threads : {1, 2, 7, 7}) {
        tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        write_vdb(all_grids(), folder / "a.vdb", GetParam());
        if (first.empty()) first = read_bytes(folder / "a.vdb");
        EXPECT_TRUE(read_bytes(folder / "a.vdb") == first) << threads << " threads";
    }
}

TEST_P(VdbWrite, WhatWasWrittenIsReadBack) {
    TempFolder folder;
    write_vdb(all_grids(), folder / "a.vdb", GetParam());
    openvdb::io::File file((folder / "a.vdb").string());
    file.open(false);
    for (const auto& grid : all_grids()) {
        const auto floats = openvdb::GridBase::grid<FloatGrid>(grid);
        if (!floats) continue;
        const FloatGrid::Ptr read = read_vdb(folder / "a.vdb", grid->getName());
        const auto theirs = openvdb::GridBase::grid<FloatGrid>(file.readGrid(grid->getName()));
        EXPECT_TRUE(same_tree(theirs->tree(), read->tree())) << grid->getName();
        if (!GetParam().half) {
            EXPECT_TRUE(same_tree(floats->tree(), read->tree())) << grid->getName();
        }
        EXPECT_EQ(read->transform(), grid->transform());
        for (auto it = grid->beginMeta(); it != grid->endMeta(); ++it)
            if (it->first != openvdb::GridBase::META_SAVE_HALF_FLOAT) {
                EXPECT_EQ(it->second->str(), (*read)[it->first]->str()) << it->first;
            }
        EXPECT_EQ(static_cast<const openvdb::MetaMap&>(*theirs), *read) << grid->getName();
    }
}

INSTANTIATE_TEST_SUITE_P(Compressions, VdbWrite, ::testing::ValuesIn(all_options), name_of);

TEST(VdbFile, HalfFloatsAreWithinHalfAUnitOfTheirLastPlace) {
    TempFolder folder;
    const auto grid = noise_grid();
    VdbWriteOptions halves;
    halves.half = true;
    write_vdb({grid}, folder / "a.vdb", halves);
    const auto read = read_vdb(folder / "a.vdb");
    ASSERT_EQ(read->activeVoxelCount(), grid->activeVoxelCount());
    for (auto it = grid->cbeginValueOn(); it; ++it)
        ASSERT_NEAR(read->tree().getValue(it.getCoord()), *it, std::abs(*it) * 0x1p-11);
}

TEST(VdbFile, AGridReadAsHalfIsWrittenWholeAgainWhereAskedFor) {
    TempFolder folder;
    VdbWriteOptions halves;
    halves.half = true;
    write_vdb({noise_grid()}, folder / "half.vdb", halves);
    const auto once = read_vdb(folder / "half.vdb");
    once->tree().setValue(Coord(1, 2, 3), 0.1f);
    write_vdb({once}, folder / "whole.vdb");
    EXPECT_EQ(read_vdb(folder / "whole.vdb")->tree().getValue(Coord(1, 2, 3)), 0.1f);
}

TEST(VdbFile, OddValuesKeepEveryBit) {
    const float odd[] = {std::numeric_limits<float>::quiet_NaN(), -0.0f, 1e-45f,
                         std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()};
    auto grid = FloatGrid::create(0);
    grid->setName("odd");
    for (int i = 0; i < 5; ++i) grid->tree().setValue(Coord(i, 0, 0), odd[i]);
    TempFolder folder;
    for (const auto compression : {Compression::none, Compression::zip, Compression::blosc}) {
        VdbWriteOptions options;
        options.compression = compression;
        write_vdb({grid}, folder / "a.vdb", options);
        const auto read = read_vdb(folder / "a.vdb");
        for (int i = 0; i < 5; ++i) {
            const float value = read->tree().getValue(Coord(i, 0, 0));
            EXPECT_EQ(std::memcmp(&value, &odd[i], 4), 0) << i;
        }
    }
}

TEST(VdbFile, GridsThatShareATreeAreReadEach) {
    TempFolder folder;
    const auto first = noise_grid();
    const auto second =
        openvdb::GridBase::grid<FloatGrid>(std::const_pointer_cast<openvdb::GridBase>(first->copyGrid()));
    second->setName("moved");
    second->setTransform(openvdb::math::Transform::createLinearTransform(2.5));
    write_vdb({first, second}, folder / "a.vdb");
    write_vdb({first}, folder / "one.vdb");
    EXPECT_LT(std::filesystem::file_size(folder / "a.vdb"),
              std::filesystem::file_size(folder / "one.vdb") + 2000);
    const auto read = read_vdb(folder / "a.vdb", "moved");
    EXPECT_TRUE(same_tree(first->tree(), read->tree()));
    EXPECT_EQ(read->transform(), second->transform());
    EXPECT_EQ(list_vdb(folder / "a.vdb").size(), 2u);
}

TEST(VdbFile, NamesChooseTheGrid) {
    TempFolder folder;
    write_vdb({vectors(), sphere(), noise_grid(), whole_numbers()}, folder / "a.vdb");
    EXPECT_EQ(read_vdb(folder / "a.vdb")->getName(), "density");
    EXPECT_EQ(read_vdb(folder / "a.vdb", "sphere")->getGridClass(), openvdb::GRID_LEVEL_SET);
    EXPECT_TRUE(contains(refusal(folder / "a.vdb", "vectors"), "Tree_vec3s_5_4_3, not floats"));
    const std::string none = refusal(folder / "a.vdb", "nothing");
    EXPECT_TRUE(contains(none, "no grid 'nothing' among") && contains(none, "'sphere'")) << none;
    write_vdb({vectors(), sphere()}, folder / "b.vdb");
    EXPECT_EQ(read_vdb(folder / "b.vdb")->getName(), "sphere");
    write_vdb({vectors()}, folder / "c.vdb");
    EXPECT_TRUE(contains(refusal(folder / "c.vdb"), "no grid of floats"));
}

TEST(VdbFile, OfTwoGridsWithOneNameTheFirstOfFloatsIsRead) {
    TempFolder folder;
    const auto other = vectors(), second = whole_numbers();
    const auto floats = sphere(), more = band_grid();
    other->setName("same"), second->setName("same"), floats->setName("same"), more->setName("same");
    write_vdb({other, second, floats, more}, folder / "a.vdb");
    for (const VdbGridInfo& grid : list_vdb(folder / "a.vdb")) EXPECT_EQ(grid.name, "same");
    EXPECT_TRUE(same_tree(floats->tree(), read_vdb(folder / "a.vdb", "same")->tree()));
}

TEST(VdbFile, FilesWrittenToAPipeAreRead) {
    TempFolder folder;
    std::ofstream out(folder / "a.vdb", std::ios::binary);
    openvdb::io::Stream(out).write(openvdb::GridCPtrVec{vectors(), band_grid(), sphere(), tiles_only()});
    out.close();
    EXPECT_EQ(list_vdb(folder / "a.vdb").size(), 4u);
    EXPECT_TRUE(same_tree(sphere()->tree(), read_vdb(folder / "a.vdb", "sphere")->tree()));
    EXPECT_TRUE(same_tree(band_grid()->tree(), read_vdb(folder / "a.vdb")->tree()));
}

TEST(VdbFile, AChecksumTellsDamageThatNothingElseCan) {
    TempFolder folder;
    VdbWriteOptions plain;
    plain.compression = Compression::none;
    write_vdb({noise_grid()}, folder / "a.vdb", plain);
    const std::string good = read_bytes(folder / "a.vdb");
    EXPECT_EQ(refusal(folder / "a.vdb"), "");
    std::string bytes = good;
    bytes[bytes.size() - 5] ^= 1;  // of the last voxel
    test::write_bytes(folder / "a.vdb", bytes);
    EXPECT_TRUE(
        contains(refusal(folder / "a.vdb"), "a.vdb: its bytes are not those that were written (checksum "));
    EXPECT_THROW(list_vdb(folder / "a.vdb"), InvalidInput);
    bytes = good;
    bytes[identifier_at] ^= 1;  // another file's entry
    bytes[bytes.size() - 5] ^= 1;
    test::write_bytes(folder / "a.vdb", bytes);
    EXPECT_EQ(refusal(folder / "a.vdb"), "");
}

TEST(VdbFile, AFileThatAnotherProgramRewroteKeepsAStaleChecksumAndIsRead) {
    TempFolder folder;
    write_vdb({noise_grid()}, folder / "a.vdb");
    openvdb::io::File in((folder / "a.vdb").string()), out((folder / "b.vdb").string());
    in.open(false);
    const auto metadata = in.getMetadata();
    ASSERT_EQ(metadata->metaCount(), 1u);
    EXPECT_EQ(metadata->metaValue<std::string>("vdbgeo_checksum").size(), 78u);
    const auto grid = openvdb::GridBase::grid<FloatGrid>(in.readGrid("density"));
    grid->tree().setValue(Coord(1, 2, 3), 77);
    out.write({grid}, *metadata);
    out.close();
    EXPECT_EQ(read_vdb(folder / "b.vdb")->tree().getValue(Coord(1, 2, 3)), 77);
}

TEST(VdbFile, AGridThatWritesItselfIsLeftToDoSo) {
    TempFolder folder;
    const auto grid = std::make_shared<PlainGrid>(*noise_grid());
    write_vdb({grid}, folder / "a.vdb");
    EXPECT_EQ(grid->calls, 1);
    write_vdb({noise_grid()}, folder / "b.vdb");
    EXPECT_TRUE(read_bytes(folder / "a.vdb") == read_bytes(folder / "b.vdb"));
}

TEST(VdbFile, ListsWithoutLoading) {
    TempFolder folder;
    write_vdb({noise_grid(), vectors()}, folder / "a.vdb");
    const auto grids = list_vdb(folder / "a.vdb");
    ASSERT_EQ(grids.size(), 2u);
    EXPECT_EQ(grids[0].name, "density");
    EXPECT_EQ(grids[0].type, "Tree_float_5_4_3");
    EXPECT_EQ(grids[0].metadata.metaValue<std::string>("note"), "of noise");
    EXPECT_EQ(grids[1].type, "Tree_vec3s_5_4_3");
    EXPECT_TRUE(is_vdb_file(folder / "a.vdb"));
    test::write_bytes(folder / "b.vdb", "not one");
    EXPECT_FALSE(is_vdb_file(folder / "b.vdb"));
    EXPECT_FALSE(is_vdb_file(folder / "none.vdb"));
    EXPECT_FALSE(is_vdb_file(folder.path()));
}

TEST(VdbFile, AFullDiskIsAnError) {
    EXPECT_THROW(write_vdb({noise_grid()}, "/dev/full"), IoError);
    EXPECT_THROW(write_vdb({empty_grid()}, "/dev/full"), IoError);
}

TEST(VdbFile, APipeIsRefusedBeforeAnythingIsWritten) {
    TempFolder folder;
    ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
    const pid_t reader = fork();
    if (reader == 0) _exit(read_bytes(folder / "pipe").empty() ? 0 : 1);
    EXPECT_THROW(write_vdb({noise_grid()}, folder / "pipe"), IoError);
    int status = 0;
    waitpid(reader, &status, 0);
    EXPECT_EQ(status, 0);
}

TEST(VdbFile, CancelledLeavesTheOldFile) {
    TempFolder folder;
    test::write_bytes(folder / "a.vdb", "old");
    for (const double at : {0.0, 0.5, 1.0}) {
        const Progress stop([at](double done) { return done < at; });
        EXPECT_THROW(write_vdb({noise_grid(), sphere()}, folder / "a.vdb", {}, stop), Cancelled) << at;
    }
    EXPECT_EQ(read_bytes(folder / "a.vdb"), "old");
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(VdbFile, ProgressGoesUpToOne) {
    TempFolder folder;
    double last = 0;
    write_vdb({noise_grid(), sphere()}, folder / "a.vdb", {}, Progress([&](double done) {
                  EXPECT_GE(done, last);
                  last = done;
                  return true;
              }));
    EXPECT_EQ(last, 1);
}

TEST(VdbFile, RealFilesAreReadAsOpenVdbReadsThem) {
    for (const char* name : {"mjurczyk_openvdb/cube.vdb", "mjurczyk_openvdb/smoke.vdb",
                             "mjurczyk_openvdb/sphere.vdb", "tinyvdbio/sphere-div1.vdb", "oiio/sphere.vdb"}) {
        VDBGEO_NEEDS_DATA(name);
        const auto path = test::data_folder() / name;
        const auto read = read_vdb(path);
        EXPECT_GT(read->activeVoxelCount(), 0u) << name;
        openvdb::io::File file(path.string());
        file.open(false);
        const auto theirs = openvdb::GridBase::grid<FloatGrid>(file.readGrid(read->getName()));
        EXPECT_TRUE(same_tree(theirs->tree(), read->tree())) << name;
        EXPECT_EQ(theirs->transform(), read->transform()) << name;
        EXPECT_EQ(static_cast<const openvdb::MetaMap&>(*theirs), *read) << name;
    }
}

TEST(VdbFile, ARealFileOfVectorsIsListedAndNotReadAsAMap) {
    VDBGEO_NEEDS_DATA("oiio/sphereCd.vdb");
    const auto path = test::data_folder() / "oiio/sphereCd.vdb";
    EXPECT_EQ(list_vdb(path).at(0).type, "Tree_vec3s_5_4_3");
    EXPECT_TRUE(contains(refusal(path), "no grid of floats"));
}

TEST(VdbFile, RealDamagedFilesAreRefusedByTheFault) {
    const std::pair<const char*, const char*> faults[] = {
        {"bad-bbox-bomb.vdb", "bounding box"},     {"bad-bbox-empty.vdb", "holds no voxel"},
        {"bad-bbox-huge.vdb", "bounding box"},     {"bad-bbox-inverted.vdb", "empty or inverted"},
        {"bad-bbox-overflow.vdb", "out of range"}, {"bad-bbox-roundup.vdb", "bounding box"},
        {"truncated.vdb", "the file ends inside"}};
    for (const auto& [name, fault] : faults) {
        VDBGEO_NEEDS_DATA(std::string("oiio_damaged/") + name);
        const std::string message = refusal(test::data_folder() / "oiio_damaged" / name);
        EXPECT_TRUE(contains(message, fault) && contains(message, name)) << name << ": " << message;
    }
}
