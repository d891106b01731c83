// Damaged VDB files: each is loaded or refused; none crashes, hangs or takes memory that the file does not
// warrant. OpenVDB's own reader writes beyond its buffers on many of these.
#include <gtest/gtest.h>
#include <openvdb/io/Stream.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <functional>
#include <random>

#include "converters/vdb_file.h"
#include "converters/vdb_sections.h"
#include "tests/support/data.h"
#include "tests/support/maps.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using openvdb::Coord;
using test::read_bytes;
using test::TempFolder;
using test::write_bytes;
using Compression = VdbWriteOptions::Compression;

namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool sanitized = true;  // shadow memory does not fit under a limit of addresses
#else
constexpr bool sanitized = false;
#endif

enum Outcome { loaded, refused, crashed };

void read_all(const std::filesystem::path& file) { read_vdb(file); }

/// Tries each text in a child process of its own kind: one child works through many and tells its progress,
/// and a new one goes on behind a text that ended it.
std::vector<Outcome> outcomes(const std::filesystem::path& file, const std::vector<std::string>& texts,
                              const std::function<void(const std::filesystem::path&)>& reading = read_all) {
    std::vector<Outcome> result;
    while (result.size() < texts.size()) {
        int ends[2];
        if (pipe(ends) != 0) throw std::runtime_error("pipe");
        const pid_t child = fork();
        if (child == 0) {
            const rlimit seconds{60, 60}, bytes{rlim_t(1) << 30, rlim_t(1) << 30};
            setrlimit(RLIMIT_CPU, &seconds);
            if (!sanitized) setrlimit(RLIMIT_AS, &bytes);
            alarm(300);
            // The parent's threads are not here.
            tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
            for (std::size_t i = result.size(); i < texts.size(); ++i) {
                char outcome = loaded;
                write_bytes(file, texts[i]);
                try {
                    reading(file);
                } catch (const InvalidInput&) {
                    outcome = refused;
                } catch (const IoError&) {
                    outcome = refused;
                } catch (...) {
                    _exit(1);
                }
                if (write(ends[1], &outcome, 1) != 1) _exit(1);
            }
            _exit(0);
        }
        close(ends[1]);
        for (char outcome; read(ends[0], &outcome, 1) == 1;) result.push_back(static_cast<Outcome>(outcome));
        close(ends[0]);
        int status = 0;
        waitpid(child, &status, 0);
        if (result.size() < texts.size()) result.push_back(crashed);
    }
    return result;
}

openvdb::FloatGrid::Ptr small_grid() {
    SparsifyOptions band;
    band.threshold = 5;
    band.band = 2;
    DensityMap map = test::map_from_function(
        Vec3i(27, 24, 21), {}, [](const Vec3d& p) { return 12 - (p - Vec3d(13, 12, 10)).norm(); }, band);
    return map.grid;
}

std::string small_file(Compression compression, bool halves = false) {
    TempFolder folder;
    VdbWriteOptions options;
    options.compression = compression;
    options.half = halves;
    write_vdb({small_grid()}, folder / "a.vdb", options);
    std::string bytes = read_bytes(folder / "a.vdb");
    // Another file's checksum is passed over: what is asked here is what the format itself tells.
    bytes[bytes.find("xxh3-128") + 9] ^= 1;
    return bytes;
}

/// Where the voxels of the only grid begin, out of its descriptor.
std::size_t block_at(const std::string& bytes) {
    const std::size_t type = bytes.find("Tree_float_5_4_3");
    std::uint32_t length;
    std::memcpy(&length, bytes.data() + type - 4, 4);
    std::uint64_t offset;
    std::memcpy(&offset, bytes.data() + type + length + 4 + 8, 8);
    return offset;
}

std::vector<std::string> flipped_bytes(const std::string& bytes, std::size_t begin, std::size_t end,
                                       int count, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::vector<std::string> texts;
    for (int i = 0; i < count; ++i) {
        std::string text = bytes;
        const std::size_t at = begin + random() % (end - begin);
        text[at] = static_cast<char>(text[at] ^ static_cast<char>(1 + random() % 255));
        texts.push_back(text);
    }
    return texts;
}

void expect_no_crash(const std::vector<std::string>& texts, std::size_t least_refused,
                     const std::function<void(const std::filesystem::path&)>& reading = read_all) {
    TempFolder folder;
    const std::vector<Outcome> all = outcomes(folder / "a.vdb", texts, reading);
    std::size_t refusals = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
        EXPECT_NE(all[i], crashed) << "text " << i;
        refusals += all[i] == refused;
    }
    EXPECT_GE(refusals, least_refused);
    std::cout << refusals << " of " << all.size() << " refused\n";
}

std::string refusal(const std::string& bytes) {
    TempFolder folder;
    write_bytes(folder / "a.vdb", bytes);
    try {
        read_vdb(folder / "a.vdb");
    } catch (const InvalidInput& e) {
        return e.what();
    }
    return "";
}

void expect_refusal(const std::string& bytes, const std::string& part) {
    const std::string message = refusal(bytes);
    EXPECT_NE(message.find(part), std::string::npos) << "'" << message << "' does not tell: " << part;
    EXPECT_EQ(message.find('\n'), std::string::npos);
}

template <class T>
std::string with(std::string bytes, std::size_t at, T value) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
    return bytes;
}

}  // namespace

TEST(VdbDamage, TheWholeFileLoads) {
    TempFolder folder;
    for (const auto c : {Compression::none, Compression::zip, Compression::blosc})
        EXPECT_EQ(outcomes(folder / "a.vdb", {small_file(c)}), std::vector<Outcome>{loaded});
}

TEST(VdbDamage, TruncatedAnywhere) {
    const std::string whole = small_file(Compression::blosc);
    std::vector<std::string> texts;
    for (std::size_t i = 0; i < 64; ++i) texts.push_back(whole.substr(0, whole.size() * i / 64));
    for (std::size_t i = 1; i <= 16; ++i) texts.push_back(whole.substr(0, whole.size() - i));
    expect_no_crash(texts, texts.size());
}

TEST(VdbDamage, MoreBytesThanThereShouldBe) {
    expect_refusal(small_file(Compression::none) + "x", "1 bytes behind the last grid");
}

TEST(VdbDamage, FlippedBytesInTheSkeleton) {
    const std::string bytes = small_file(Compression::blosc);
    const std::size_t nodes = bytes.find("ScaleMap");  // the end of header, descriptor, and metadata
    ASSERT_NE(nodes, std::string::npos);
    expect_no_crash(flipped_bytes(bytes, 0, nodes, 1000, 1), 200);
}

TEST(VdbDamage, FlippedBytesInTheNodes) {
    for (const auto c : {Compression::none, Compression::zip, Compression::blosc}) {
        const std::string bytes = small_file(c);
        expect_no_crash(flipped_bytes(bytes, bytes.find("ScaleMap"), block_at(bytes), 500, 2), 1);
    }
}

TEST(VdbDamage, FlippedBytesInTheVoxels) {
    for (const bool halves : {false, true})
        for (const auto c : {Compression::none, Compression::zip, Compression::blosc}) {
            const std::string bytes = small_file(c, halves);
            expect_no_crash(flipped_bytes(bytes, block_at(bytes), bytes.size(), 500, 3), 1);
        }
}

TEST(VdbDamage, FlippedBytesInAFileWrittenToAPipe) {
    std::ostringstream out;
    openvdb::io::Stream(out).write(openvdb::GridCPtrVec{small_grid(), small_grid()});
    expect_no_crash(flipped_bytes(out.str(), 0, out.str().size(), 500, 4), 100);
}

TEST(VdbDamage, FaultsAreNamed) {
    const std::string bytes = small_file(Compression::none);
    expect_refusal("", "not a VDB file");
    expect_refusal("hello, this is text", "not a VDB file");
    expect_refusal(with(bytes, 8, std::uint32_t(221)), "file format version 221, 222 to 224 can be read");
    expect_refusal(with(bytes, 8, std::uint32_t(225)), "file format version 225");
    expect_refusal(with(bytes, 20, char(7)), "the flag for grid offsets is 7");
    expect_refusal(with(bytes, 57, std::uint32_t(1u << 31)), "2147483648 metadata entries");
    const std::size_t grids = bytes.find("xxh3-128") + 78;  // behind the file's metadata
    expect_refusal(with(bytes, grids, std::int32_t(-1)), "-1 grids");
    expect_refusal(with(bytes, grids + 4, std::uint32_t(4000000000u)),
                   "grid number 1: the file ends inside: name (4000000000 bytes needed)");
    const std::size_t offsets = bytes.find("Tree_float_5_4_3") + 16 + 4;
    expect_refusal(with(bytes, offsets + 16, std::uint64_t(1) << 60), "grid 'density': it claims bytes");
    expect_refusal(with(bytes, offsets + 24, std::uint32_t(64)), "compression 0x40 is not known");
    const std::size_t box = bytes.find("file_bbox_max") + 13 + 4 + 5;
    expect_refusal(with(bytes, box, std::uint32_t(11)),
                   "metadata 'file_bbox_max' of type vec3i has 11 bytes");
    expect_refusal(with(bytes, box + 4, std::int32_t(25)), "do not fill the bounding box");
    const std::size_t count = bytes.find("file_voxel_count") + 16 + 4 + 5 + 4;
    expect_refusal(with(bytes, count, std::int64_t(12)), "not the 12 of its metadata");
    const std::size_t scale = bytes.find("UniformScaleMap") + 15;
    ASSERT_LT(scale, block_at(bytes));
    expect_refusal(with(bytes, scale, 2.0), "its transform contradicts itself (scale 2 along x)");
    expect_refusal(with(bytes, scale - 2, 'q'), "a transform of type 'UniformScaleMqp' is not known");
    const std::size_t root = scale + 15 * 8;
    expect_refusal(with(bytes, root, 2), "2 buffers a leaf");
    expect_refusal(with(bytes, root + 8, 1u << 31), "2147483648 tiles");
    expect_refusal(with(bytes, root + 12, 2), "nodes out of order");
    expect_refusal(with(bytes, root + 16, 8), "a node at 8, which is not a multiple of 4096");
    expect_refusal(with(bytes, block_at(bytes), ~*(bytes.data() + block_at(bytes))),
                   "two masks of active voxels are not the same");
    expect_refusal(with(bytes, block_at(bytes) + 64, char(9)), "a node's values are of kind 9");
}

namespace {

/// Reads a file both ways; the voxels of a corner of it are decoded from the file.
void read_both_ways(const std::filesystem::path& file) {
    const auto grid = read_vdb(file);
    const VdbSections source(file);
    const auto& box = source.active_box();
    if (source.active_voxels() != grid->activeVoxelCount() || box != grid->evalActiveVoxelBoundingBox())
        throw std::runtime_error("the two readers differ");
    Vec3i first, size;
    for (int a = 0; a < 3; ++a) {
        first[a] = box.min()[a];
        size[a] =
            static_cast<int>(std::clamp<std::int64_t>(std::int64_t(box.max()[a]) - first[a] + 1, 1, 40));
    }
    const DenseSections there(*grid, first, size, {0, 1, 2}), here = source.sections(first, size, {0, 1, 2});
    std::vector<float> a(there.largest_piece()), b = a;
    for (int section = 0; section < size.z(); section += there.piece(section)) {
        there.fill(section, a.data());
        here.fill(section, b.data());
        if (std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) != 0)
            throw std::runtime_error("the two readers differ");
    }
}

/// Throws where what is read is neither refused nor exactly `good`.
void expect_exactly(const openvdb::FloatGrid& good, const std::filesystem::path& file) {
    read_both_ways(file);
    const auto grid = read_vdb(file);
    if (!grid->constTree().hasSameTopology(good.constTree()) || grid->transform() != good.transform() ||
        static_cast<const openvdb::MetaMap&>(*grid) != static_cast<const openvdb::MetaMap&>(good) ||
        grid->background() != good.background())
        throw std::runtime_error("not what was written");
    auto p = good.cbeginValueAll(), q = grid->cbeginValueAll();
    for (; p && q; ++p, ++q)
        if (p.getCoord() != q.getCoord() || *p != *q) throw std::runtime_error("not what was written");
}

}  // namespace

TEST(VdbDamage, AFileOfOursIsRefusedOrExactlyWhatWasWritten) {
    TempFolder folder;
    VdbWriteOptions plain;
    for (const auto c : {Compression::none, Compression::zip, Compression::blosc}) {
        plain.compression = c;
        write_vdb({small_grid()}, folder / "good.vdb", plain);
        const std::string bytes = read_bytes(folder / "good.vdb");
        const auto good = read_vdb(folder / "good.vdb");
        // Half of them anywhere, half where the fewest bytes have the most to say.
        std::vector<std::string> texts = flipped_bytes(bytes, 0, bytes.size(), 350, 11);
        const auto head = flipped_bytes(bytes, 0, bytes.find("ScaleMap") + 140, 300, 12);
        texts.insert(texts.end(), head.begin(), head.end());
        std::mt19937_64 random(13);
        for (int i = 0; i < 50; ++i) texts.push_back(bytes.substr(0, random() % bytes.size()));
        // Loaded is nearly nothing: the identifier's bytes, and the name of the checksum.
        expect_no_crash(texts, texts.size() * 85 / 100,
                        [&](const std::filesystem::path& file) { expect_exactly(*good, file); });
    }
}

TEST(VdbDamage, AFileOfAnotherProgramNeverCrashesAReader) {
    VDBGEO_NEEDS_DATA("tinyvdbio/sphere-div1.vdb");
    const std::string bytes = read_bytes(test::data_folder() / "tinyvdbio/sphere-div1.vdb");
    expect_no_crash(flipped_bytes(bytes, 0, bytes.size(), 400, 14), 1, read_both_ways);
    expect_no_crash(flipped_bytes(bytes, 0, 2000, 200, 15), 1, read_both_ways);
    std::mt19937_64 random(16);
    std::vector<std::string> cut;
    for (int i = 0; i < 50; ++i) cut.push_back(bytes.substr(0, random() % bytes.size()));
    expect_no_crash(cut, cut.size(), read_both_ways);
}

TEST(VdbDamage, EveryRealDamagedFileIsRefused) {
    VDBGEO_NEEDS_DATA("oiio_damaged");
    int files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(test::data_folder() / "oiio_damaged")) {
        if (entry.path().extension() != ".vdb") continue;
        EXPECT_THROW(read_vdb(entry.path()), InvalidInput) << entry.path();
        EXPECT_THROW(VdbSections source(entry.path()), InvalidInput) << entry.path();
        ++files;
    }
    EXPECT_GE(files, 7);
}

TEST(VdbDamage, LengthsOfBlocksAreChecked) {
    for (const auto c : {Compression::zip, Compression::blosc}) {
        const std::string bytes = small_file(c);
        const std::size_t root = bytes.find("UniformScaleMap") + 15 + 15 * 8;
        const std::size_t block = root + 4 + 4 + 8 + 12 + 2 * 4096 + 1;  // of the upper node: no active value
        expect_refusal(with(bytes, block, std::int64_t(-4096)), "a block of -4096 bytes where 0 belong");
        expect_refusal(with(bytes, block, std::int64_t(1) << 40), "the file ends inside: compressed values");
    }
}
