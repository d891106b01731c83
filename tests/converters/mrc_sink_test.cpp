// Sections into a map file: as they come, compressed, scaled.
#include "converters/mrc_sink.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "converters/byte_source.h"
#include "tests/support/maps.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using test::noise;
using test::read_bytes;
using test::TempFolder;
using test::write_bytes;
using Scaling = MrcWriteOptions::Scaling;

namespace {

const Vec3i box_size(37, 29, 21);

std::vector<float> box_noise(double factor = 1, double offset = 0) {
    std::vector<float> values = noise(37 * 29 * 21, 5);
    for (float& v : values) v = static_cast<float>(factor * static_cast<double>(v) + offset);
    return values;
}

std::vector<float> values_of(const std::filesystem::path& path) {
    MrcReader reader(path);
    const Vec3i size = reader.frame().size;
    std::vector<float> values(static_cast<std::size_t>(size.prod()));
    reader.read_sections(values.data(), reader.sections_left());
    return values;
}

std::string label_of(const std::filesystem::path& path) {
    const MrcReader reader(path);
    for (const std::string& label : reader.header().labels)
        if (label.rfind("vdbgeo: density = ", 0) == 0) return label;
    return "";
}

/// All bytes of a file, unpacked where it is compressed.
std::string unpacked(const std::filesystem::path& path) {
    const auto source = ByteSource::open(path);
    std::string bytes(1 << 24, '\0');
    bytes.resize(source->read(bytes.data(), bytes.size()));
    EXPECT_FALSE(source->cut_off());
    return bytes;
}

class Sink : public testing::Test {
 protected:
    std::filesystem::path out() const { return folder_ / "out.mrc"; }

    /// Writes `values` in pieces of these numbers of sections, over and over.
    MrcWriteReport write(const std::filesystem::path& path, const std::vector<float>& values,
                         const MrcWriteOptions& options = {}, const std::vector<int>& pieces = {8},
                         const std::optional<Statistics>& known = {}) {
        Frame frame;
        frame.size = box_size;
        MrcSink sink(path, frame, Vec3i::Zero(), {}, options, known);
        passes_ = sink.passes();
        EXPECT_EQ(sink.needs_statistics(), passes_ > 1);
        for (int pass = 0; pass < passes_; ++pass)
            for (int section = 0, k = 0; section < box_size.z(); ++k) {
                const int count =
                    std::min(pieces[static_cast<std::size_t>(k) % pieces.size()], box_size.z() - section);
                sink.write(values.data() + section * box_size.x() * box_size.y(), count);
                section += count;
            }
        return sink.finish();
    }

    int passes_ = 0;
    TempFolder folder_;
};

MrcWriteOptions mode(int number, Scaling scaling = Scaling::none, MrcScaling given = {}) {
    MrcWriteOptions options;
    options.mode = number;
    options.scaling = scaling;
    options.given = given;
    return options;
}

}  // namespace

TEST_F(Sink, AnyPiecesGiveTheSameBytesAndOnePassIsEnough) {
    write(out(), box_noise());
    EXPECT_EQ(passes_, 1);
    const std::string first = read_bytes(out());
    EXPECT_EQ(values_of(out()), box_noise());
    for (const std::string& line : validate_mrc(out())) ADD_FAILURE() << line;
    for (const std::vector<int>& pieces : {std::vector<int>{1}, {21}, {5, 1, 3}, {8, 2}}) {
        write(out(), box_noise(), {}, pieces);
        EXPECT_TRUE(read_bytes(out()) == first) << pieces.front();
    }
}

TEST_F(Sink, ADirectTargetGetsTheSameBytesInTwoPasses) {
    for (const int number : {2, 12}) {
        write(out(), box_noise(), mode(number));
        // A file that is there, opened as a device: /dev/stdout would be one.
        const auto fifo = folder_ / "fifo";
        ASSERT_EQ(std::system(("mkfifo " + fifo.string() + " && (cat " + fifo.string() + " > " +
                               (folder_ / "copy.mrc").string() + " &)")
                                  .c_str()),
                  0);
        write(fifo, box_noise(), mode(number));
        EXPECT_EQ(passes_, 2);
        for (int i = 0; i < 200 && read_bytes(folder_ / "copy.mrc").size() < read_bytes(out()).size(); ++i)
            ::usleep(10000);
        EXPECT_TRUE(read_bytes(folder_ / "copy.mrc") == read_bytes(out())) << number;
        std::filesystem::remove(fifo);
    }
}

TEST_F(Sink, KnownStatisticsSpareThePassesThatFindThem) {
    const MrcWriteReport plain = write(out(), box_noise(), mode(1, Scaling::automatic));
    EXPECT_EQ(passes_, 2);
    Statistics known;
    known.count = box_noise().size();
    const auto values = box_noise();
    known.min = *std::min_element(values.begin(), values.end());
    known.max = *std::max_element(values.begin(), values.end());
    const std::string bytes = read_bytes(out());
    const MrcWriteReport again = write(out(), box_noise(), mode(1, Scaling::automatic), {3}, known);
    EXPECT_EQ(passes_, 1);
    EXPECT_TRUE(read_bytes(out()) == bytes);
    EXPECT_EQ(plain.largest_error, again.largest_error);
    write("/dev/null", box_noise(), {}, {8}, known);
    EXPECT_EQ(passes_, 1);
    write("/dev/null", box_noise(), mode(12), {8}, known);
    EXPECT_EQ(passes_, 2) << "halves have statistics of their own";
}

TEST_F(Sink, MissingAndSuperfluousSectionsAreErrors) {
    Frame frame;
    frame.size = box_size;
    write_bytes(out(), "old");
    const auto values = box_noise();
    {
        MrcSink sink(out(), frame, Vec3i::Zero(), {});
        sink.write(values.data(), 20);
        EXPECT_THROW(sink.finish(), InvalidInput);
    }
    {
        MrcSink sink(out(), frame, Vec3i::Zero(), {});
        sink.write(values.data(), 21);
        EXPECT_THROW(sink.write(values.data(), 1), InvalidInput);
    }
    EXPECT_EQ(read_bytes(out()), "old");
    frame.size = Vec3i::Zero();
    EXPECT_THROW(MrcSink(out(), frame, Vec3i::Zero(), {}), InvalidInput);
}

TEST_F(Sink, GzipHoldsThePlainFile) {
    std::vector<float> large(200 * 200 * 120);
    for (std::size_t i = 0; i < large.size(); ++i) large[i] = static_cast<float>(i * i % 1013);
    DensityMap map = test::map_from_values(Vec3i(200, 200, 120), large);
    write_mrc(map, out());
    std::string first;
    for (const std::size_t threads : {1, 2, 5}) {
        tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        write_mrc(map, folder_ / "out.mrc.gz");
        const std::string bytes = read_bytes(folder_ / "out.mrc.gz");
        if (first.empty()) first = bytes;
        EXPECT_TRUE(bytes == first) << threads << " threads";
    }
    EXPECT_LT(first.size(), std::filesystem::file_size(out()) / 2);
    EXPECT_TRUE(unpacked(folder_ / "out.mrc.gz") == unpacked(out()));
    MrcWriteOptions gz;
    gz.compress = MrcWriteOptions::Compress::gz;
    write_mrc(map, folder_ / "out.map", gz);
    EXPECT_TRUE(read_bytes(folder_ / "out.map") == first);
    EXPECT_EQ(std::system(("gzip -t < " + (folder_ / "out.mrc.gz").string()).c_str()), 0);
    for (const std::string& line : validate_mrc(folder_ / "out.mrc.gz")) ADD_FAILURE() << line;
}

TEST_F(Sink, AutomaticScalingFillsTheRangeAndSaysSo) {
    const auto values = box_noise(1.7, 40);
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    const double range = static_cast<double>(*high) - static_cast<double>(*low);
    const std::array<std::array<int, 3>, 4> modes{
        {{0, -128, 127}, {1, -32768, 32767}, {6, 0, 65535}, {101, 0, 15}}};
    for (const auto& [number, first, last] : modes) {
        const MrcWriteReport r = write(out(), values, mode(number, Scaling::automatic));
        ASSERT_TRUE(r.scaling);
        const auto stored = values_of(out());
        EXPECT_EQ(*std::min_element(stored.begin(), stored.end()), static_cast<float>(first));
        EXPECT_EQ(*std::max_element(stored.begin(), stored.end()), static_cast<float>(last));
        EXPECT_NEAR(r.scaling->factor, range / (last - first), 1e-12 * range);
        double worst = 0;
        for (std::size_t i = 0; i < values.size(); ++i)
            worst = std::max(
                worst, std::abs(static_cast<double>(values[i]) -
                                (r.scaling->factor * static_cast<double>(stored[i]) + r.scaling->offset)));
        EXPECT_EQ(r.largest_error, worst);
        EXPECT_LE(worst, 0.5 * r.scaling->factor * (1 + 1e-9));
        EXPECT_GT(worst, 0.4 * r.scaling->factor);
        double factor = 0, offset = 0;
        ASSERT_EQ(
            std::sscanf(label_of(out()).c_str(), "vdbgeo: density = %lf * stored + %lf", &factor, &offset), 2)
            << label_of(out());
        EXPECT_EQ(factor, r.scaling->factor);
        EXPECT_EQ(offset, r.scaling->offset);
        for (const std::string& line : validate_mrc(out())) ADD_FAILURE() << line;
    }
}

TEST_F(Sink, HalvesAreScaledOnlyWhereTheyMustBe) {
    const MrcWriteReport fits = write(out(), box_noise(1000), mode(12, Scaling::automatic));
    EXPECT_FALSE(fits.scaling);
    EXPECT_GT(fits.largest_error, 0.1);
    EXPECT_LE(fits.largest_error, 0.25) << "half a unit in the last place below 1024";
    EXPECT_EQ(label_of(out()), "");
    const MrcWriteReport scaled = write(out(), box_noise(1e6), mode(12, Scaling::automatic));
    ASSERT_TRUE(scaled.scaling);
    EXPECT_LE(scaled.largest_error, 1e6 * 0x1p-11);
    EXPECT_EQ(values_of(out()).size(), box_noise().size());
    EXPECT_THROW(write(out(), box_noise(1e6), mode(12)), InvalidInput);
}

TEST_F(Sink, AGivenScalingIsKeptToAndCanBeTooNarrow) {
    const MrcWriteReport r = write(out(), box_noise(10), mode(1, Scaling::given, {0.001, 2}));
    EXPECT_LE(r.largest_error, 0.0005001);
    EXPECT_EQ(label_of(out()), "vdbgeo: density = 0.001 * stored + 2");
    EXPECT_EQ(values_of(out())[7], std::nearbyint((static_cast<double>(box_noise(10)[7]) - 2) / 0.001));
    EXPECT_THROW(write(out(), box_noise(10), mode(0, Scaling::given, {0.001, 0})), InvalidInput);
    EXPECT_THROW(write(out(), box_noise(), mode(2, Scaling::given, {0.5, 0})), InvalidInput);
    EXPECT_THROW(write(out(), box_noise(), mode(1, Scaling::given, {0, 0})), InvalidInput);
    EXPECT_THROW(write(out(), box_noise(), mode(1, Scaling::given, {NAN, 0})), InvalidInput);
    MrcWriteOptions without_mode = mode(1, Scaling::given, {0.5, 0});
    without_mode.mode.reset();
    EXPECT_THROW(write(out(), box_noise(), without_mode), InvalidInput) << "it is mode 2";
}

TEST_F(Sink, OneValueOnlyAndNoneThatIsFinite) {
    const std::vector<float> ones(box_noise().size(), 3.25f);
    const MrcWriteReport r = write(out(), ones, mode(0, Scaling::automatic));
    EXPECT_EQ(r.largest_error, 0);
    EXPECT_EQ(values_of(out())[0], 0);
    EXPECT_EQ(label_of(out()), "vdbgeo: density = 1 * stored + 3.25");
    const std::vector<float> nothing(ones.size(), NAN);
    EXPECT_THROW(write(out(), nothing, mode(1, Scaling::automatic)), InvalidInput);
    EXPECT_FALSE(write(out(), nothing, mode(2, Scaling::automatic)).scaling);
}

TEST_F(Sink, TheLongestLabelFitsAndTenStayTen) {
    MrcRecord record;
    for (int i = 0; i < 10; ++i) record.labels.push_back("label " + std::to_string(i));
    Frame frame;
    frame.size = box_size;
    const MrcScaling widest{-1.2345678901234567e-201, -2.2345678901234566e-203};
    MrcSink sink(out(), frame, Vec3i::Zero(), record, mode(1, Scaling::given, widest));
    const std::vector<float> zeros(box_noise().size(), 0);
    sink.write(zeros.data(), box_size.z());
    sink.finish();
    const auto labels = MrcReader(out()).header().labels;
    ASSERT_EQ(labels.size(), 10u);
    EXPECT_EQ(labels.front(), "label 0");
    EXPECT_GT(labels.back().size(), 70u);
    double factor = 0, offset = 0;
    ASSERT_EQ(std::sscanf(labels.back().c_str(), "vdbgeo: density = %lf * stored + %lf", &factor, &offset),
              2);
    EXPECT_EQ(factor, widest.factor);
    EXPECT_EQ(offset, widest.offset);
}
