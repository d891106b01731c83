// Maps from the wild: each reads with the size and the values it is known to have, or is refused by its
// fault. The numbers were computed by another program from the same files.
#include <Eigen/LU>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "converters/mrc.h"
#include "converters/running_statistics.h"
#include "tests/support/data.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using test::data_folder;

namespace {

/// A map read whole, in x, y, z order.
struct Volume {
    explicit Volume(const std::filesystem::path& path, const MrcReadOptions& options = {}) {
        MrcReader reader(path, options);
        header = reader.header();
        order = reader.order();
        rule = reader.origin_rule();
        frame = reader.frame();
        values.resize(static_cast<std::size_t>(frame.size[0]) * static_cast<std::size_t>(frame.size[1]) *
                      static_cast<std::size_t>(frame.size[2]));
        reader.read_sections(values.data(), reader.sections_left());
        warnings = reader.warnings();
    }
    float at(int x, int y, int z) const {
        const Vec3i index(x, y, z);
        const std::int64_t c = index[order[0]], r = index[order[1]], s = index[order[2]];
        return values[static_cast<std::size_t>((s * frame.size[order[1]] + r) * frame.size[order[0]] + c)];
    }
    /// Trilinear, at an index inside the box.
    double interpolate(const Vec3d& index) const {
        const Vec3i low = index.array().floor().cast<int>().min(frame.size.array() - 2).max(0);
        const Vec3d t = index - low.cast<double>();
        double sum = 0;
        for (int corner = 0; corner < 8; ++corner) {
            const int i = corner & 1, j = corner >> 1 & 1, k = corner >> 2;
            sum += (i ? t[0] : 1 - t[0]) * (j ? t[1] : 1 - t[1]) * (k ? t[2] : 1 - t[2]) *
                   at(low[0] + i, low[1] + j, low[2] + k);
        }
        return sum;
    }
    bool warns(const std::string& about) const {
        return std::any_of(warnings.begin(), warnings.end(),
                           [&](const auto& line) { return line.find(about) != std::string::npos; });
    }

    MrcHeader header;
    std::array<int, 3> order{};
    std::string rule;
    Frame frame;
    Array<float> values;
    std::vector<std::string> warnings;
};

void expect_near(const Vec3d& found, const Vec3d& expected, double tolerance) {
    EXPECT_LT((found - expected).norm(), tolerance)
        << "found " << found.transpose() << ", expected " << expected.transpose();
}

struct Known {
    const char* file;
    std::array<int, 3> size;  // columns, rows, sections
    int mode;
    double min, max, mean;
};

// clang-format off
const std::vector<Known> known_maps{
    {"multifit_groel/groel-11.5A.mrc", {100, 100, 100}, 2, -1.3411558866500854, 2.3650290966033936, 0.08132880901149356},
    {"mainmastseg/MAP_m4A.mrc.gz", {220, 220, 220}, 2, -1.787139892578125, 3.5708298683166504, 0.006365250513544697},
    {"mainmastseg/region0.mrc.gz", {440, 440, 440}, 2, 0.0, 3.5708298683166504, 0.0011072017623057029},
    {"sfftk/emd_1832.map", {64, 64, 64}, 2, -0.15937988460063934, 2.052330493927002, -0.0024537900722124417},
    {"sfftk/emd_5625.map", {56, 56, 56}, 2, -1.4999780654907227, 7.940685272216797, 0.2521620413958749},
    {"npc2018/emd_5556.map", {80, 80, 80}, 2, -0.06163037568330765, 0.15343110263347626, 0.0021327359540265945},
    {"diffmodeler/6824.mrc", {70, 70, 70}, 2, -3.20186710357666, 9.416099548339844, -8.075548064047824e-09},
    {"powerfit/1997.map", {100, 100, 100}, 2, -2.2886924743652344, 3.467029094696045, 0.06064205617618188},
    {"moorhen/low-res-emd-32143.map", {100, 100, 100}, 2, -0.0363752543926239, 0.07981668412685394, 0.0005232831494470052},
    {"ngl/betaGal.mrc", {100, 100, 100}, 2, -0.05296945199370384, 0.19695799052715302, -6.782992400585911e-05},
    {"ngl/localResolution.mrc", {100, 100, 100}, 2, 7.239999771118164, 13.960000038146973, 8.863673205364227},
    {"deepmainmast/emd_1461.mrc", {75, 80, 96}, 2, -2.1649858951568604, 3.1114537715911865, 0.05255306768011377},
    {"daq/2566_3J6B_9.mrc", {35, 52, 47}, 2, -0.3863585889339447, 0.8640021085739136, 0.014420190393256026},
    {"daq/2566_3J6B_9_new.mrc", {46, 69, 62}, 2, -0.2989257276058197, 0.7048949599266052, 0.015050053463524515},
    {"gorgon/densityMap.mrc", {80, 80, 80}, 2, -12.71805191040039, 33.07460403442383, 0.2101772167619856},
    {"gorgon/gorgon-skeletonizebinary.mrc", {80, 80, 80}, 2, 0.0, 1.0, 0.000771484375},
    {"gorgon/vp6-96o.mrc", {96, 96, 96}, 2, -0.5256927609443665, 1.3229899406433105, 0.011594493896606852},
    {"cylindra/beta-tubulin.mrc", {20, 20, 20}, 2, -1.0822834968566895, 7.637046813964844, 0.060288116603673475},
    {"relion/ref_model.mrc", {100, 100, 100}, 2, -0.00013568540452979505, 0.0010828839149326086, 1.3283128236030572e-05},
    {"pymol/emd_1155.ccp4", {141, 91, 281}, 0, -128.0, 127.0, 5.038940388754881},
    {"visfd/test_image_membrane.rec", {16, 16, 16}, 1, -1656.0, 2388.0, 337.5751953125},
    {"visfd/test_blob_detect_mask.rec", {22, 32, 27}, 0, 0.0, 1.0, 0.8992529461279462},
    {"mrcfile/EMD-3197.map", {20, 20, 20}, 2, -4.1337456703186035, 5.576736927032471, 0.7836120336436434},
    {"pycurv/t2_ny01_lbl.labels_FILLEDpeak.mrc", {31, 21, 31}, 0, 0.0, 3.0, 1.0446955056736535},
    {"pycurv/t2_ny01_lbl.labels_FILLEDpeakplus.mrc", {41, 61, 41}, 0, 0.0, 3.0, 0.6887781472776743},
    {"pycurv/t74_vesicle3_bin6.Labels.mrc", {100, 100, 50}, 0, 0.0, 1.0, 0.011346},
    {"pyto/labels.mrc", {155, 155, 60}, 0, 0.0, 74.0, 4.768013180714534},
    {"pyto/layers.mrc", {155, 155, 60}, 1, 0.0, 100.0, 26.41011307665626},
    {"pyto/tomo.mrc", {155, 155, 60}, 1, 0.0, 105.0, 1.1620374609781479},
    {"pyseg/tomo22_z50_ves_4_seg.mrc", {166, 166, 50}, 0, 0.0, 3.0, 2.7309275656844245},
    {"mrcfile/EMD-3001.map", {73, 43, 25}, 2, -0.3681429624557495, 0.7216102480888367, 0.0005329666822949868},
    {"mrcfile/emd_3001.map.gz", {73, 43, 25}, 2, -0.3681429624557495, 0.7216102480888367, 0.0005329666822949868},
    {"mrcfile/EMD-3001.map.bz2", {73, 43, 25}, 2, -0.3681429624557495, 0.7216102480888367, 0.0005329666822949868},
    {"mrcfile/float16.mrc", {64, 64, 1}, 12, -4.33984375, 3.8203125, 0.041134231723845005},
    {"mrcfile_jl/emd_3001_f16.mrc", {73, 43, 25}, 12, -0.3681640625, 0.7216796875, 0.0005252015936256936},
    {"mrcfile_jl/emd_3197_f16.mrc", {20, 20, 20}, 12, -4.1328125, 5.578125, 0.784110263466835},
    {"gemmi/5i55_tiny.ccp4", {8, 6, 10}, 2, -0.5310382843017578, 2.3988280296325684, 0.347120486261944},
    {"gemmi/iota_yzx.ccp4.gz", {1, 2, 4}, 2, 60.0, 187.0, 123.5},
    {"gemmi/1pfe_asu.msk.gz", {49, 50, 49}, 0, 0.0, 1.0, 0.27977509371095377},
    {"ngl/3pqr.ccp4", {69, 100, 59}, 2, -0.5163028240203857, 0.9091418981552124, -0.002583154533393553},
    {"ngl/3nzd.ccp4.gz", {100, 105, 103}, 2, -1.0586318969726562, 4.1327362060546875, -0.007966638980151753},
    {"ngl/JMJD2DA-x336_event2.ccp4.gz", {137, 152, 147}, 2, -0.8568897843360901, 2.5261342525482178, -0.012571990291368521},
    {"pymol/h2o-elf-nstart-origin.mrc", {40, 40, 40}, 2, -0.015081999823451042, 0.9963099956512451, 0.06915449449316034},
    {"pymol/h2o-elf-nstart-skwtrn.ccp4", {40, 40, 40}, 2, -0.015081999823451042, 0.9963099956512451, 0.06915449449316034},
    {"pymol/h2o-elf-nstart.ccp4", {40, 40, 40}, 2, -0.015081999823451042, 0.9963099956512451, 0.06915449449316034},
    {"pymol_open_source/map.ccp4", {61, 88, 67}, 2, -0.9107361435890198, 2.312191963195801, 0.0009873893247518068},
    {"npc2018/All_COMBINED.mrc.gz", {100, 100, 100}, 2, 0.0, 1.0, 0.03939110294009745},
    {"npc2018/C8_Gle1.mrc", {143, 144, 39}, 2, -4.736951818785278e-16, 1.0010329484939575, 0.004259129609529122},
    {"pyto/swapped_byte_order.mrc", {10, 2, 1}, 2, -21.38633918762207, 0.7819682955741882, -7.701193065941334},
    {"pyto/big_head.mrc", {100, 100, 100}, 1, -32768.0, 32767.0, 143.3208},
    {"pyto/new-head_int16.mrc", {40, 30, 20}, 1, -27.0, 23.0, -0.631125},
    {"cctbx/non_zero_origin_map.ccp4", {32, 40, 30}, 2, 0.0, 0.4961644113063812, 0.012709128830213844},
    {"cctbx/ccp4_20_21_22_to_30_40_50.ccp4", {29, 20, 11}, 2, -0.371725857257843, 26.211641311645508, -0.01678292689279243},
    {"cctbx/tst_input.map", {16, 16, 8}, 2, -0.422722190618515, 0.3356039524078369, 5.570655048359185e-10},
    {"sfftk/test_unfixable_mask.map", {46, 46, 46}, 2, 0.0, 1.0, 0.023434293717091072},
    {"sfftk/test_data_multi0.map", {32, 30, 36}, 0, 0.0, 1.0, 0.6820023148148148},
    {"sfftk/merged_mask.mrc", {10, 10, 10}, 1, 0.0, 7.0, 1.642},
    {"sfftk/tiny1.map", {3, 3, 3}, 0, 0.0, 9.0, 4.185185185185185},
    {"imp/mini.mrc", {8, 10, 8}, 2, 0.0, 1.1721653938293457, 0.020969321727534407},
    {"imp/1z5s_10.imp.mrc", {97, 105, 84}, 2, 0.0, 0.6868842244148254, 0.015819951830571197},
    {"rosettasciio/HAADFscan.mrc", {16, 16, 1}, 6, 3923.0, 9399.0, 6066.19921875},
    {"pytom/human_ribo_mask_32_8_5.mrc", {32, 32, 32}, 2, 0.0, 1.0, 0.09027417082052125},
    {"cryodrgn/50S-vol.mrc", {32, 32, 128}, 2, -8.874208450317383, 3.565645456314087, -1.0065459576935609e-10},
    {"clipper_chimerax/3io0_real_space.ccp4", {71, 80, 86}, 2, -5.752608299255371, 9.194721221923828, -0.00835595282724579},
    {"hetchallenge/test_mask_dilated_wide.mrc", {16, 16, 16}, 2, -0.10566534847021103, 1.2055681943893433, 0.06720060015008125},
    {"aspire/rln_proj_64_centered.mrcs", {64, 64, 4}, 2, -0.005392493214458227, 0.009289249777793884, 8.800793678641675e-05},
};
// clang-format on

struct Refused {
    const char* file;
    const char* text;
};

const std::vector<Refused> refused_files{
    {"ngl/3str-2fofc.dsn6", "is a DSN6 map, expected an MRC/CCP4 map"},
    {"cctbx/map.mrc", "is text, expected an MRC/CCP4 map"},
    {"sfftk/test_data_corrupt_header.map", "the file is cut off: expected 34280108 bytes"},
    {"sfftk/empty1.map", "the file is empty"},
    {"imod/headerTest.st", "the file is cut off: expected 526336 bytes"},
    {"imp/invalid_axes.mrc", "(words 17-19) are 10, 11, 12, expected 1, 2, 3"},
    {"imp/prot_gmm.mrc", "the file is cut off: expected 1023712 bytes"},
    {"imp/mini.map", "is text, expected an MRC/CCP4 map"},
    {"rosettasciio/Custom_movie.mrc", "the cell length (word 11) is negative: -160"},
    {"rosettasciio/test.seq.dark.mrc", "the file is cut off: expected 536839168 bytes"},
    {"pytom/human_ribo_mask_32_8_5_Mirrored.emformat.mrc", "is an EM-format file, expected an MRC/CCP4 map"},
    {"aspire/falcon_2012_06_12-14_33_35_0.mrc", "is text, expected an MRC/CCP4 map"},
    {"mjurczyk_openvdb/sphere.vdb", "is an OpenVDB file, expected an MRC/CCP4 map"},
    {"surface_morphometrics/examples.tar.gz", "is a tar archive inside gzip"},
};

std::string test_name(const std::string& file) {
    std::string name = file;
    for (char& c : name)
        if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
    return name;
}

class KnownMap : public testing::TestWithParam<Known> {};
class RefusedFile : public testing::TestWithParam<Refused> {};

/// Unpacks one member of an archive; null where that fails.
std::filesystem::path unpack(const test::TempFolder& folder, const std::string& archive,
                             const std::string& member) {
    const std::string command = "tar -xzf '" + (data_folder() / archive).string() + "' -C '" +
                                folder.path().string() + "' '" + member + "' 2>/dev/null";
    if (std::system(command.c_str()) != 0) return {};
    return folder / member;
}

}  // namespace

INSTANTIATE_TEST_SUITE_P(Maps, KnownMap, testing::ValuesIn(known_maps),
                         [](const auto& map) { return test_name(map.param.file); });

TEST_P(KnownMap, ReadsWhole) {
    const Known& known = GetParam();
    VDBGEO_NEEDS_DATA(known.file);
    const Volume map(data_folder() / known.file);
    EXPECT_EQ((std::array<int, 3>{map.header.nx, map.header.ny, map.header.nz}), known.size);
    EXPECT_EQ(map.header.mode, known.mode);
    RunningStatistics running;
    running.add(map.values.data(), map.values.size());
    const Statistics s = running.result();
    EXPECT_EQ(s.non_finite, 0u);
    EXPECT_EQ(s.min, known.min);
    EXPECT_EQ(s.max, known.max);
    EXPECT_NEAR(s.mean, known.mean, 1e-9 * std::max(std::abs(known.min), std::abs(known.max)));
}

TEST_P(KnownMap, CanBeValidated) {
    const Known& known = GetParam();
    VDBGEO_NEEDS_DATA(known.file);
    for (const std::string& line : validate_mrc(data_folder() / known.file)) {
        EXPECT_EQ(line.find('\n'), std::string::npos);
        EXPECT_NE(line.find_first_of("0123456789"), std::string::npos) << line;
    }
}

INSTANTIATE_TEST_SUITE_P(Files, RefusedFile, testing::ValuesIn(refused_files),
                         [](const auto& file) { return test_name(file.param.file); });

TEST_P(RefusedFile, NamesTheFault) {
    VDBGEO_NEEDS_DATA(GetParam().file);
    try {
        MrcReader reader(data_folder() / GetParam().file);
        FAIL() << "was opened";
    } catch (const InvalidInput& error) {
        EXPECT_NE(std::string(error.what()).find(GetParam().text), std::string::npos) << error.what();
    }
}

TEST(MrcFiles, NegativeVoxelsAreReadWhenAVoxelSizeIsGiven) {
    VDBGEO_NEEDS_DATA("rosettasciio/Custom_movie.mrc");
    MrcReadOptions options;
    options.voxel_size_A = Vec3d(10, 10, 1);
    const Volume map(data_folder() / "rosettasciio/Custom_movie.mrc", options);
    EXPECT_EQ(*std::min_element(map.values.begin(), map.values.end()), 682);
    EXPECT_EQ(*std::max_element(map.values.begin(), map.values.end()), 1596);
}

TEST(MrcFiles, CornersThatPyMolExpects) {
    VDBGEO_NEEDS_DATA("pymol/h2o-elf-nstart.ccp4");
    const auto corner = [](const char* name) { return Volume(data_folder() / "pymol" / name).frame; };
    const Frame nstart = corner("h2o-elf-nstart.ccp4");
    expect_near(nstart.origin, Vec3d(0.6, 0.45, 0.75), 1e-6);
    expect_near(nstart.axes * (nstart.size.cast<double>() - Vec3d::Ones()), Vec3d(5.85, 5.85, 5.85), 1e-5);
    expect_near(corner("h2o-elf-nstart-skwtrn.ccp4").origin, Vec3d(1.8, 3.85, 6.35), 1e-6);
    expect_near(corner("h2o-elf-nstart-origin.mrc").origin, Vec3d(1.2, 3.4, 5.6), 1e-6);
    // The fourth of that series: translation alone.
    test::TempFolder folder;
    std::string bytes = test::read_bytes(data_folder() / "pymol/h2o-elf-nstart-skwtrn.ccp4");
    std::fill_n(bytes.begin() + 16, 12, '\0');
    test::write_bytes(folder / "a.ccp4", bytes);
    const Volume skwtrn(folder / "a.ccp4");
    EXPECT_EQ(skwtrn.rule, "skwtrn");
    expect_near(skwtrn.frame.origin, Vec3d(1.2, 3.4, 5.6), 1e-6);
}

TEST(MrcFiles, Emd1155HasItsMxAndMySwapped) {
    VDBGEO_NEEDS_DATA("pymol/emd_1155.ccp4");
    const Volume map(data_folder() / "pymol/emd_1155.ccp4");
    EXPECT_EQ(map.frame.size, Vec3i(141, 91, 281));
    expect_near(map.frame.voxel_size(), Vec3d(16.4, 16.4, 16.4), 1e-4);
    EXPECT_TRUE(map.warns("MX and MY"));
    RunningStatistics running;
    running.add(map.values.data(), map.values.size());
    EXPECT_NEAR(running.result().rms, 12.4, 0.001);
}

TEST(MrcFiles, AValueInASkewedCellThatGemmiInterpolates) {
    VDBGEO_NEEDS_DATA("gemmi/5i55_tiny.ccp4");
    const Volume map(data_folder() / "gemmi/5i55_tiny.ccp4");
    EXPECT_EQ((Vec3i(map.header.mx, map.header.my, map.header.mz)), Vec3i(60, 24, 60));
    Vec3d index = map.frame.axes.inverse() * (Vec3d(19.4, 3, 21) - map.frame.origin);
    const Vec3i cell(60, 24, 60);  // the map repeats with the crystal's cell
    for (int a = 0; a < 3; ++a) index[a] -= cell[a] * std::floor(index[a] / cell[a]);
    ASSERT_TRUE((index.array() < map.frame.size.cast<double>().array() - 1).all()) << index.transpose();
    EXPECT_NEAR(map.interpolate(index), 2.15437984, 2e-5);
}

TEST(MrcFiles, IndexOrderOfAYzxMap) {
    VDBGEO_NEEDS_DATA("gemmi/iota_yzx.ccp4.gz");
    const Volume map(data_folder() / "gemmi/iota_yzx.ccp4.gz");
    EXPECT_EQ(map.frame.size, Vec3i(4, 1, 2));
    // The whole cell of 5 x 6 x 7 samples counts up, z fastest; this is the part [1:5, 2:3, 4:6] of it.
    for (int x = 0; x < 4; ++x)
        for (int z = 0; z < 2; ++z) EXPECT_EQ(map.at(x, 0, z), (x + 1) * 42 + 2 * 7 + z + 4);
    const Vec3d start = map.frame.axes.inverse() * map.frame.origin;  // one cell along y, minus one along z
    expect_near(start, Vec3d(1, 20, -3), 1e-6);
}

TEST(MrcFiles, ScaledBytesMatchTheirFloats) {
    VDBGEO_NEEDS_DATA("ngl/3pqr-mode0.ccp4");
    const Volume bytes(data_folder() / "ngl/3pqr-mode0.ccp4"), floats(data_folder() / "ngl/3pqr.ccp4");
    ASSERT_EQ(bytes.values.size(), floats.values.size());
    EXPECT_TRUE(bytes.warns("mark the bytes as scaled"));
    EXPECT_EQ(bytes.frame.axes, floats.frame.axes);
    EXPECT_EQ(bytes.frame.origin, floats.frame.origin);
    float worst = 0;
    for (std::size_t i = 0; i < bytes.values.size(); ++i)
        worst = std::max(worst, std::abs(bytes.values[i] - floats.values[i]));
    EXPECT_LT(worst, 0.00281f);
}

TEST(MrcFiles, LocalResolutionLiesOnItsMapWithTheVoxelSizeGiven) {
    VDBGEO_NEEDS_DATA("ngl/localResolution.mrc");
    MrcReadOptions options;
    options.voxel_size_A = Vec3d(3.54, 3.54, 3.54);
    const Volume map(data_folder() / "ngl/betaGal.mrc"),
        local(data_folder() / "ngl/localResolution.mrc", options);
    EXPECT_EQ(local.frame.size, map.frame.size);
    EXPECT_LT((local.frame.axes - map.frame.axes).norm(), 1e-5);
    EXPECT_EQ(local.frame.origin, map.frame.origin);
    EXPECT_FLOAT_EQ(*std::min_element(local.values.begin(), local.values.end()), 7.24f);
    EXPECT_FLOAT_EQ(*std::max_element(local.values.begin(), local.values.end()), 13.96f);
}

TEST(MrcFiles, Emd0093HasItsFourfoldAxis) {
    VDBGEO_NEEDS_DATA("mainmastseg/MAP_m4A.mrc.gz");
    const Volume map(data_folder() / "mainmastseg/MAP_m4A.mrc.gz");
    expect_near(map.frame.axes.inverse() * Vec3d(147.4, 147.4, 147.4), Vec3d(110, 110, 110), 1e-4);
    float worst = 0;
    for (int z = 0; z < 220; ++z)
        for (int y = 1; y < 220; ++y)
            for (int x = 1; x < 220; ++x)
                worst = std::max(worst, std::abs(map.at(x, y, z) - map.at(220 - y, x, z)));
    EXPECT_LT(worst, 1e-5f);
    // One of its four segments, on a grid twice as fine.
    VDBGEO_NEEDS_DATA("mainmastseg/region0.mrc.gz");
    const Volume region(data_folder() / "mainmastseg/region0.mrc.gz");
    int inside = 0, equal = 0;
    for (int z = 0; z < 220; ++z)
        for (int y = 0; y < 220; ++y)
            for (int x = 0; x < 220; ++x) {
                const float value = region.at(2 * x, 2 * y, 2 * z);
                if (value == 0) continue;
                ++inside;
                equal += value == map.at(x, y, z);
            }
    EXPECT_EQ(inside, 10319);
    EXPECT_EQ(equal, inside);
}

TEST(MrcFiles, ResampledCropsLieInTheSamePlace) {
    VDBGEO_NEEDS_DATA("daq/2566_3J6B_9_new.mrc");
    const Volume coarse(data_folder() / "daq/2566_3J6B_9.mrc"),
        fine(data_folder() / "daq/2566_3J6B_9_new.mrc");
    expect_near(coarse.frame.voxel_size(), Vec3d(1.34, 1.34, 1.34), 1e-5);
    expect_near(fine.frame.voxel_size(), Vec3d(1, 1, 1), 1e-6);
    expect_near(coarse.frame.origin, fine.frame.origin, 1e-3);
    double ab = 0, aa = 0, bb = 0;
    for (int z = 0; z < fine.frame.size[2]; ++z)
        for (int y = 0; y < fine.frame.size[1]; ++y)
            for (int x = 0; x < fine.frame.size[0]; ++x) {
                const Vec3d world = fine.frame.to_world(Vec3d(x, y, z));
                const Vec3d index = coarse.frame.axes.inverse() * (world - coarse.frame.origin);
                if (!(index.array() <= coarse.frame.size.cast<double>().array() - 1).all()) continue;
                const double a = coarse.interpolate(index), b = fine.at(x, y, z);
                ab += a * b, aa += a * a, bb += b * b;
            }
    EXPECT_GT(ab / std::sqrt(aa * bb), 0.995);
}

TEST(MrcFiles, HalfPrecisionTwins) {
    VDBGEO_NEEDS_DATA("mrcfile_jl/emd_3001_f16.mrc");
    // The program that wrote the twins doubles a few values that round up to a power of two.
    const auto doubled = [](const char* floats, const char* halves) {
        const Volume a(data_folder() / floats), b(data_folder() / halves);
        EXPECT_EQ(a.values.size(), b.values.size());
        int count = 0;
        for (std::size_t i = 0; i < a.values.size(); ++i) {
            const float x = a.values[i], y = b.values[i];
            if (std::abs(x - y) <= std::max(std::abs(x) / 2048, 6.2e-5f)) continue;
            EXPECT_NEAR(y / x, 2, 1e-3);
            ++count;
        }
        return count;
    };
    EXPECT_EQ(doubled("mrcfile/EMD-3001.map", "mrcfile_jl/emd_3001_f16.mrc"), 13);
    EXPECT_EQ(doubled("mrcfile/EMD-3197.map", "mrcfile_jl/emd_3197_f16.mrc"), 2);
}

TEST(MrcFiles, TheSameMapPlainGzippedAndBzipped) {
    VDBGEO_NEEDS_DATA("mrcfile/EMD-3001.map");
    const Volume plain(data_folder() / "mrcfile/EMD-3001.map");
    for (const char* name : {"mrcfile/emd_3001.map.gz", "mrcfile/EMD-3001.map.bz2"}) {
        const Volume packed(data_folder() / name);
        EXPECT_TRUE(packed.values == plain.values);
        EXPECT_EQ(packed.frame.axes, plain.frame.axes);
        EXPECT_EQ(packed.frame.origin, plain.frame.origin);
        EXPECT_TRUE(packed.warnings.empty());
    }
}

TEST(MrcFiles, RampBehindAnImodHeader) {
    VDBGEO_NEEDS_DATA("pyto/big_head.mrc");
    const Volume map(data_folder() / "pyto/big_head.mrc");
    EXPECT_EQ(map.rule, "header");
    expect_near(map.frame.origin, Vec3d(0, 0, -2744.9194), 1e-3);
    EXPECT_EQ(map.at(0, 0, 0), 0);
    EXPECT_EQ(map.at(3, 0, 0), 30000);
    EXPECT_EQ(map.at(4, 0, 0), 40000 - 65536);
}

TEST(MrcFiles, FramesOfOddHeaders) {
    VDBGEO_NEEDS_DATA("multifit_groel/groel-11.5A.mrc");
    struct Expected {
        const char* file;
        const char* rule;
        Vec3d voxel, start;  // the origin in voxels
    };
    const double tetragonal = 91.144 / 128, far = 173.41 / 240;
    for (const Expected& e : {
             Expected{"multifit_groel/groel-11.5A.mrc", "nstart", {2.7, 2.7, 2.7}, {-50, -50, -50}},
             {"relion/ref_model.mrc", "header", {3.54, 3.54, 3.54}, {-1, -1, -1}},
             {"mrcfile/EMD-3001.map", "nstart", {17.93 / 40, 4.71 / 12, 33.03 / 72}, {-21, -12, 0}},
             {"ngl/JMJD2DA-x336_event2.ccp4.gz", "zero", {0.5, 0.5, 0.5}, {0, 0, 0}},
             {"pymol_open_source/map.ccp4", "nstart", {tetragonal, tetragonal, 45.856 / 64}, {-26, 13, -22}},
             {"cctbx/non_zero_origin_map.ccp4",
              "nstart",
              {149.407 / 200, 144.615 / 200, 147.488 / 200},
              {100, 100, 100}},
             {"cctbx/ccp4_20_21_22_to_30_40_50.ccp4",
              "nstart",
              {24.531 / 55, 24.62 / 59, 26.457 / 61},
              {20, 21, 22}},
             {"clipper_chimerax/3io0_real_space.ccp4", "nstart", {far, far, far}, {70, 74, 51}},
             {"npc2018/C8_Gle1.mrc", "header", {5, 5, 5}, {-70.8, -71, 23.2}},
             {"pyto/swapped_byte_order.mrc", "zero", {1, 1, 1}, {0, 0, 0}},
             {"sfftk/test_data_multi0.map", "zero", {14.5, 550. / 30, 622. / 36}, {0, 0, 0}},
             {"hetchallenge/test_mask_dilated_wide.mrc", "zero", {1, 1, 1}, {0, 0, 0}},
             {"deepmainmast/emd_1461.mrc", "header", {1.23, 1.23, 1.23}, {44, -33, 183}},
         }) {
        VDBGEO_NEEDS_DATA(e.file);
        const MrcReader reader(data_folder() / e.file);
        EXPECT_EQ(reader.origin_rule(), e.rule) << e.file;
        SCOPED_TRACE(e.file);
        expect_near(reader.frame().voxel_size(), e.voxel, 2e-5);
        expect_near(reader.frame().axes.inverse() * reader.frame().origin, e.start, 1e-3);
    }
}

TEST(MrcFiles, AStackOfImages) {
    VDBGEO_NEEDS_DATA("aspire/rln_proj_64_centered.mrcs");
    EXPECT_TRUE(Volume(data_folder() / "aspire/rln_proj_64_centered.mrcs").warns("a stack of 4 images"));
}

TEST(MrcFiles, TomogramsWhoseMzIsOne) {
    VDBGEO_NEEDS_DATA("surface_morphometrics/examples.tar.gz");
    const test::TempFolder folder;
    struct Expected {
        const char* name;
        Vec3i size;
        double voxel;
    };
    for (const Expected& e :
         {Expected{"TE1.mrc", {960, 928, 312}, 12.44}, {"TF1.mrc", {928, 960, 350}, 13.4}}) {
        const auto path = unpack(folder, "surface_morphometrics/examples.tar.gz", e.name);
        ASSERT_FALSE(path.empty());
        const Volume map(path);
        EXPECT_EQ(map.frame.size, e.size);
        expect_near(map.frame.voxel_size(), Vec3d(e.voxel, e.voxel, e.voxel), 1e-3);
        EXPECT_TRUE(map.warns("MZ (word 10) is 1"));
        EXPECT_FALSE(map.warns("stack of"));
        std::filesystem::remove(path);
    }
}

TEST(MrcFiles, AWholeTomogramOfLabels) {
    const std::string name = "20170217_FIB112_G1_l2_t6_dimifilt_lbl.GolgiFilled.mrc";
    VDBGEO_NEEDS_DATA("pycurv/" + name + ".tar.gz");
    const test::TempFolder folder;
    const auto path = unpack(folder, "pycurv/" + name + ".tar.gz", name);
    ASSERT_FALSE(path.empty());
    const Volume map(path);
    EXPECT_EQ(map.frame.size, Vec3i(928, 928, 250));
    EXPECT_EQ(*std::min_element(map.values.begin(), map.values.end()), 0);
    EXPECT_EQ(*std::max_element(map.values.begin(), map.values.end()), map.header.dmax);
}
