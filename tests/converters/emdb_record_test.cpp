// The recommended contour, in each form in which EMDB has told it.
#include "converters/emdb_record.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using test::TempFolder;
using test::write_bytes;

namespace {

double contour(const std::string& content) {
    const TempFolder folder;
    write_bytes(folder / "record", content);
    return recommended_contour(folder / "record");
}

std::string refusal(const std::string& content) {
    const TempFolder folder;
    write_bytes(folder / "record", content);
    try {
        recommended_contour(folder / "record");
    } catch (const InvalidInput& error) {
        const std::string prefix = (folder / "record").string() + ": ", text = error.what();
        EXPECT_EQ(text.substr(0, prefix.size()), prefix);
        return text.substr(prefix.size());
    }
    return "(not refused)";
}

const std::string xml = R"(<?xml version="1.0" encoding="UTF-8"?>
<emd emdb_id="EMD-1080" version="3.0.9.1"><admin><title>GroEL</title></admin>
<!-- <contour primary="true"><level>7</level></contour> -->
<map format="CCP4"><contour_list>
<contour primary="false"><level>3</level></contour>
<contour
   primary = 'true'>
  <level>
    0.8 </level><source>AUTHOR</source></contour>
<contour primary="true"><level>5</level></contour></contour_list></map></emd>)";

}  // namespace

TEST(EmdbRecord, Json) {
    EXPECT_EQ(contour(R"({"emdb_id": "EMD-1080", "map": {"contour_list": {"contour": [
        {"primary": false, "level": 9.5, "source": "EMDB"}, {"primary": true, "level": 0.8, "source": "AUTHOR"},
        {"primary": true, "level": 4}]}}})"),
              0.8);
    EXPECT_EQ(contour(R"({"map": {"contour_list": {"contour": {"primary": true, "level": "-2.5e-3"}}}})"),
              -0.0025);
    EXPECT_EQ(contour(R"({"map": {"contour_list": {"contour": [{"level": 2}, {"level": 3}]}}})"), 2);
    EXPECT_EQ(
        contour(
            R"({"map": {"contour_list": {"contour": [{"level": "high", "primary": true}, {"level": 3}]}}})"),
        3);
    EXPECT_EQ(contour(R"( {"id": "EMD-1080", "title": "t", "contour": 0.7, "size": [2, 3, 4]})"), 0.7);
}

TEST(EmdbRecord, Xml) {
    EXPECT_EQ(contour(xml), 0.8);
    EXPECT_EQ(contour("\xEF\xBB\xBF" + xml), 0.8);
    EXPECT_EQ(
        contour("<emdEntry><map><contourLevel source=\"author\">-2.5e-3</contourLevel></map></emdEntry>"),
        -0.0025);
    EXPECT_EQ(contour("<e:emd><e:contour><e:level>+1.5</e:level></e:contour></e:emd>"), 1.5);
}

TEST(EmdbRecord, WithoutALevelItIsRefused) {
    const std::string none = "the record holds no recommended contour level";
    for (const char* record :
         {"{}", "[]", R"({"contour": null})", R"({"map": []})",
          R"({"map": {"contour_list": {"contour": [3, "x"]}}})",
          R"({"map": {"contour_list": {"contour": []}}})", "<emd></emd>",
          "<emd><contour/><level>3</level></emd>", "<contour><level>high</level></contour>",
          "<contour><level>inf</level></contour>", "<contour><level>3",
          "<!-- <contour><level>3</level></contour>", "<"})
        EXPECT_EQ(refusal(record), none) << record;
    for (const char* record : {"", "  ", "hello"})
        EXPECT_EQ(refusal(record), "not a record of the EMDB: neither JSON nor XML") << record;
    EXPECT_EQ(refusal(R"({"map": )"), "byte 9: not a whole JSON record");
    EXPECT_EQ(refusal(R"({"contour": 1e999})"), "a number of the JSON record is out of range");
    const TempFolder folder;
    EXPECT_THROW(recommended_contour(folder / "none"), IoError);
}

TEST(EmdbRecord, DamageIsReadOrRefused) {
    const std::string json = R"({"map": {"contour_list": {"contour": [{"primary": true, "level": 0.8}]}}})";
    std::mt19937 random(3);
    int refused = 0;
    for (int i = 0; i < 400; ++i) {
        std::string bad = i % 2 ? xml : json;
        bad.resize(1 + random() % bad.size());
        bad[random() % bad.size()] ^= static_cast<char>(1 << random() % 8);
        try {
            EXPECT_TRUE(std::isfinite(contour(bad)));
        } catch (const InvalidInput&) {
            ++refused;
        }
    }
    EXPECT_GT(refused, 100);
}
