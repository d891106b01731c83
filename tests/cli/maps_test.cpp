// Maps from the wild: `info` reads each, or refuses it in one line by its fault, with little memory.
#include <algorithm>
#include <cctype>

#include "tests/cli/cli_test.h"
#include "tests/cli/small_memory.h"
#include "tests/support/data.h"

using namespace vdbgeo::test;

namespace {

struct Known {
    const char* file;
    int x, y, z;
};

// Sizes along x, y, z as told by the list that came with the files.
// clang-format off
const std::vector<Known> good_maps{
    // single particles
    {"multifit_groel/groel-11.5A.mrc", 100, 100, 100},
    {"mainmastseg/MAP_m4A.mrc.gz", 220, 220, 220},
    {"mainmastseg/region0.mrc.gz", 440, 440, 440},
    {"sfftk/emd_1832.map", 64, 64, 64},
    {"sfftk/emd_5625.map", 56, 56, 56},
    {"npc2018/emd_5556.map", 80, 80, 80},
    {"diffmodeler/6824.mrc", 70, 70, 70},
    {"powerfit/1997.map", 100, 100, 100},
    {"moorhen/low-res-emd-32143.map", 100, 100, 100},
    {"ngl/betaGal.mrc", 100, 100, 100},
    {"ngl/localResolution.mrc", 100, 100, 100},
    {"deepmainmast/emd_1461.mrc", 75, 80, 96},
    {"daq/2566_3J6B_9.mrc", 35, 52, 47},
    {"daq/2566_3J6B_9_new.mrc", 46, 69, 62},
    {"gorgon/densityMap.mrc", 80, 80, 80},
    {"gorgon/gorgon-skeletonizebinary.mrc", 80, 80, 80},
    {"gorgon/vp6-96o.mrc", 96, 96, 96},
    {"cylindra/beta-tubulin.mrc", 20, 20, 20},
    {"relion/ref_model.mrc", 100, 100, 100},
    // tomograms, averages, labels
    {"pymol/emd_1155.ccp4", 141, 91, 281},
    {"visfd/test_image_membrane.rec", 16, 16, 16},
    {"visfd/test_blob_detect_mask.rec", 22, 32, 27},
    {"mrcfile/EMD-3197.map", 20, 20, 20},
    {"pycurv/t2_ny01_lbl.labels_FILLEDpeak.mrc", 31, 21, 31},
    {"pycurv/t2_ny01_lbl.labels_FILLEDpeakplus.mrc", 41, 61, 41},
    {"pycurv/t74_vesicle3_bin6.Labels.mrc", 100, 100, 50},
    {"pyto/labels.mrc", 155, 155, 60},
    {"pyto/layers.mrc", 155, 155, 60},
    {"pyto/tomo.mrc", 155, 155, 60},
    {"pyseg/tomo22_z50_ves_4_seg.mrc", 166, 166, 50},
    // odd and hard ones; the list has columns, rows, sections, which the axes put in order
    {"mrcfile/EMD-3001.map", 43, 25, 73},
    {"mrcfile/emd_3001.map.gz", 43, 25, 73},
    {"mrcfile/EMD-3001.map.bz2", 43, 25, 73},
    {"mrcfile/float16.mrc", 64, 64, 1},
    {"mrcfile_jl/emd_3001_f16.mrc", 73, 43, 25},
    {"mrcfile_jl/emd_3197_f16.mrc", 20, 20, 20},
    {"gemmi/5i55_tiny.ccp4", 6, 8, 10},
    {"gemmi/iota_yzx.ccp4.gz", 4, 1, 2},
    {"gemmi/1pfe_asu.msk.gz", 49, 49, 50},
    {"ngl/3pqr-mode0.ccp4", 100, 69, 59},
    {"ngl/3pqr.ccp4", 100, 69, 59},
    {"ngl/3nzd.ccp4.gz", 105, 100, 103},
    {"ngl/JMJD2DA-x336_event2.ccp4.gz", 147, 152, 137},
    {"pymol/h2o-elf-nstart-origin.mrc", 40, 40, 40},
    {"pymol/h2o-elf-nstart-skwtrn.ccp4", 40, 40, 40},
    {"pymol/h2o-elf-nstart.ccp4", 40, 40, 40},
    {"pymol_open_source/map.ccp4", 88, 61, 67},
    {"npc2018/All_COMBINED.mrc.gz", 100, 100, 100},
    {"npc2018/C8_Gle1.mrc", 143, 144, 39},
    {"pyto/swapped_byte_order.mrc", 10, 2, 1},
    {"pyto/big_head.mrc", 100, 100, 100},
    {"pyto/new-head_int16.mrc", 40, 30, 20},
    {"cctbx/non_zero_origin_map.ccp4", 30, 40, 32},
    {"cctbx/ccp4_20_21_22_to_30_40_50.ccp4", 11, 20, 29},
    {"cctbx/tst_input.map", 16, 8, 16},
    {"sfftk/test_unfixable_mask.map", 46, 46, 46},
    {"sfftk/test_data_multi0.map", 32, 30, 36},
    {"sfftk/merged_mask.mrc", 10, 10, 10},
    {"sfftk/tiny1.map", 3, 3, 3},
    {"imp/mini.mrc", 8, 10, 8},
    {"imp/1z5s_10.imp.mrc", 97, 105, 84},
    {"rosettasciio/HAADFscan.mrc", 16, 16, 1},
    {"pytom/human_ribo_mask_32_8_5.mrc", 32, 32, 32},
    {"cryodrgn/50S-vol.mrc", 32, 32, 128},
    {"clipper_chimerax/3io0_real_space.ccp4", 86, 80, 71},
    {"hetchallenge/test_mask_dilated_wide.mrc", 16, 16, 16},
    {"aspire/rln_proj_64_centered.mrcs", 64, 64, 4},
};
// clang-format on

struct Refused {
    const char* file;
    const char* text;
};

const std::vector<Refused> refused_files{
    {"ngl/3str-2fofc.dsn6", "is a DSN6 map"},
    {"cctbx/map.mrc", "is text"},
    {"sfftk/test_data_corrupt_header.map", "is cut off: expected 34280108 bytes"},
    {"sfftk/empty1.map", "is empty"},
    {"imod/headerTest.st", "is cut off: expected 526336 bytes"},
    {"imp/invalid_axes.mrc", "are 10, 11, 12"},
    {"imp/prot_gmm.mrc", "is cut off: expected 1023712 bytes"},
    {"imp/mini.map", "is text"},
    {"rosettasciio/Custom_movie.mrc", "(word 11) is negative"},
    {"rosettasciio/test.seq.dark.mrc", "is cut off: expected 536839168 bytes"},
    {"pytom/human_ribo_mask_32_8_5_Mirrored.emformat.mrc", "is an EM-format file"},
    {"aspire/falcon_2012_06_12-14_33_35_0.mrc", "is text"},
    {"surface_morphometrics/examples.tar.gz", "is a tar archive inside gzip"},
    {"oiio_damaged/bad-bbox-bomb.vdb", ""},
    {"oiio_damaged/bad-bbox-huge.vdb", ""},
    {"oiio_damaged/bad-bbox-inverted.vdb", ""},
    {"oiio_damaged/bad-bbox-overflow.vdb", ""},
    {"oiio_damaged/bad-bbox-roundup.vdb", ""},
    {"oiio_damaged/truncated.vdb", ""},
};

std::string test_name(std::string name) {
    for (char& c : name)
        if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
    return name;
}

template <class Table>
bool has(const Table& table, const std::string& file) {
    return std::any_of(table.begin(), table.end(), [&](const auto& row) { return row.file == file; });
}

class GoodMap : public Cli, public testing::WithParamInterface<Known> {};
class RefusedMap : public Cli, public testing::WithParamInterface<Refused> {};
class OtherMaps : public Cli {};

}  // namespace

INSTANTIATE_TEST_SUITE_P(Maps, GoodMap, testing::ValuesIn(good_maps),
                         [](const auto& map) { return test_name(map.param.file); });

TEST_P(GoodMap, IsDescribed) {
    const Known& known = GetParam();
    VDBGEO_NEEDS_DATA(known.file);
    const Json j = json({"info", (data_folder() / known.file).string()});
    EXPECT_EQ(j["kind"], "map");
    EXPECT_EQ(j["nx"], known.x);
    EXPECT_EQ(j["ny"], known.y);
    EXPECT_EQ(j["nz"], known.z);
    for (int a = 0; a < 3; ++a) {
        EXPECT_GT(j["voxel_size_A"][a], 0.0);
        EXPECT_TRUE(j["origin_A"][a].is_number());
    }
    EXPECT_LE(j["min"], j["mean"]);
    EXPECT_LE(j["mean"], j["max"]);
    EXPECT_GE(j["rms"], 0.0);
}

INSTANTIATE_TEST_SUITE_P(Maps, RefusedMap, testing::ValuesIn(refused_files),
                         [](const auto& map) { return test_name(map.param.file); });

TEST_P(RefusedMap, ByItsFault) {
    VDBGEO_NEEDS_DATA(GetParam().file);
    const std::string file = (data_folder() / GetParam().file).string();
    const Ended r = vdbgeo({"info", file, "--json", "--threads", "2"}, small_memory());
    expect_error(r, 3, file + ": ", GetParam().text);
    expect_small(r);
}

// A grid without a voxel is one, but nothing can be made of it.
TEST_F(OtherMaps, AnEmptyGridIsOnlyDescribed) {
    VDBGEO_NEEDS_DATA("oiio_damaged/bad-bbox-empty.vdb");
    const std::string grid = (data_folder() / "oiio_damaged/bad-bbox-empty.vdb").string();
    EXPECT_EQ(json({"info", grid})["active_voxels"], 0);
    EXPECT_EQ(vdbgeo({"convert", grid, at("a.mrc")}).code, 3);
    EXPECT_EQ(vdbgeo({"surface", grid, at("a.ply")}).code, 3);
    EXPECT_TRUE(listing().empty());
}

// Whatever else lies there under a map's name is read or refused, never a crash.
TEST_F(OtherMaps, AreReadOrRefused) {
    if (data_folder().empty()) GTEST_SKIP() << "needs the folder VDBGEO_DATA with real files";
    for (const auto& entry : std::filesystem::recursive_directory_iterator(data_folder())) {
        const std::string name = entry.path().lexically_relative(data_folder()).string();
        const std::string ending = entry.path().extension().string();
        const bool map =
            std::set<std::string>{".mrc", ".map", ".ccp4", ".rec", ".st", ".mrcs", ".vdb"}.count(ending);
        if (!entry.is_regular_file() || !map || has(good_maps, name) || has(refused_files, name)) continue;
        const Ended r = vdbgeo({"info", entry.path().string(), "--quiet"});
        EXPECT_TRUE(r.code == 0 || r.code == 3) << name << "\n" << r.err;
        if (r.code == 3) expect_error(r, 3, entry.path().string() + ": ");
    }
}
