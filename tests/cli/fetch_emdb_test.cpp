// The script that downloads EMDB entries, on an archive in a folder and with a curl that only notes what is
// asked.
#include <cstdlib>

#include "tests/cli/cli_test.h"
#include "tests/support/mrc_bytes.h"
#include "tests/support/pack.h"

using namespace vdbgeo::test;

namespace {

namespace fs = std::filesystem;

const std::string json_list = R"({"emdb_id": "EMD-1080", "admin": {"title": "GroEL at 11.5 A"}, "map": {
    "contour_list": {"contour": [{"primary": false, "level": 9.5, "source": "EMDB"},
                                 {"primary": true, "level": 0.7, "source": "AUTHOR"}]}}})";
const std::string json_single =
    R"({"admin": {"title": "t"}, "map": {"contour_list": {"contour": {"primary": true, "level": "0.25"}}}})";
const std::string json_without =
    R"({"admin": {"title": "from the record"}, "map": {"contour_list": {"contour": []}}})";
const std::string xml_new = R"(<?xml version="1.0" encoding="UTF-8"?>
<emd emdb_id="EMD-1080" version="3.0.1.9"><admin><title>Über GroEL</title></admin><map><contour_list>
<contour primary="false"><level>3</level></contour><contour primary="true"><level>1.5</level><source>AUTHOR</source>
</contour></contour_list></map></emd>)";
const std::string xml_old = R"(<?xml version="1.0" encoding="UTF-8"?>
<emdEntry accessCode="1080" version="1.9.6"><deposition><title>GroEL</title></deposition>
<map><contourLevel source="author">-2.5e-3</contourLevel></map></emdEntry>)";

class FetchEmdb : public Cli {
 protected:
    void SetUp() override {
        if (run({"/bin/sh", "-c", "command -v curl python3"}).code != 0)
            GTEST_SKIP() << "NOT TESTED: curl or python3 is not installed";
    }

    /// A file of the archive in the folder `root`, by its path there.
    void put(const std::string& path, const std::string& content) const {
        fs::create_directories((folder_ / path).parent_path());
        make(path, content);
    }
    void put_map(const std::string& root, const std::string& id, const std::string& content) const {
        put(root + "/EMD-" + id + "/map/emd_" + id + ".map.gz", content);
    }
    void put_header(const std::string& root, const std::string& id, const std::string& content) const {
        put(root + "/EMD-" + id + "/header/emd-" + id + ".xml", content);
    }
    void put_record(const std::string& id, const std::string& content) const {
        put("api/EMD-" + id, content);
    }

    static std::string map_file() {
        MrcBytes map;
        map.voxel = {1.5, 1.5, 2};
        map.axes = {3, 2, 1};
        return gzip(map.str());
    }

    /// The script with two archives, `a` and `b`, in the test's folder; files go to `got`.
    Ended fetch(const Words& ids) const {
        Words words{FETCH_EMDB_SCRIPT,
                    "-o",
                    at("got"),
                    "--archive",
                    "file://" + at("a"),
                    "--archive",
                    "file://" + at("b"),
                    "--api",
                    "file://" + at("api"),
                    "--retries",
                    "0"};
        words.insert(words.end(), ids.begin(), ids.end());
        return run(words);
    }

    std::set<std::string> got() const {
        std::set<std::string> names;
        if (!fs::exists(folder_ / "got")) return names;
        for (const auto& entry : fs::directory_iterator(folder_ / "got"))
            names.insert(entry.path().filename());
        return names;
    }

    Json record(const std::string& id) const { return Json::parse(bytes("got/emd_" + id + ".json")); }
};

}  // namespace

TEST_F(FetchEmdb, AMapAndItsContour) {
    put_map("a", "1080", map_file());
    put_record("1080", json_list);
    for (const char* id : {"1080", "EMD-1080", "emd_1080"}) {
        const Ended r = fetch({id});
        EXPECT_EQ(r.code, 0) << r.err;
        EXPECT_EQ(r.err, "");
        EXPECT_EQ(r.out, at("got/emd_1080.map.gz") + "\n");
        EXPECT_EQ(got(), (std::set<std::string>{"emd_1080.map.gz", "emd_1080.json"}));
        EXPECT_EQ(bytes("got/emd_1080.map.gz"), map_file());
        const Json j = record("1080");
        EXPECT_EQ(j["id"], "EMD-1080");
        EXPECT_EQ(j["title"], "GroEL at 11.5 A");
        EXPECT_EQ(j["contour"], 0.7);
        EXPECT_EQ(j["size"], (Json{2, 3, 4}));
        EXPECT_EQ(j["voxel_size_A"], (Json{1.5, 1.5, 2.0}));
        EXPECT_EQ(j["map"], "emd_1080.map.gz");
        EXPECT_EQ(j["url"], "file://" + at("a") + "/EMD-1080/map/emd_1080.map.gz");
        EXPECT_EQ(j["sha256"].get<std::string>().size(), 64u);
        const std::string first = bytes("got/emd_1080.json");
        fetch({id});
        EXPECT_EQ(bytes("got/emd_1080.json"), first);
        fs::remove_all(folder_ / "got");
    }
}

TEST_F(FetchEmdb, EveryShapeOfARecord) {
    put_map("a", "1080", map_file());
    put_record("1080", json_single);
    EXPECT_EQ(fetch({"1080"}).code, 0);
    EXPECT_EQ(record("1080")["contour"], 0.25);

    // No level in the record: the header has one. No record at all: the same.
    put_header("b", "1080", xml_new);
    put_record("1080", json_without);
    EXPECT_EQ(fetch({"1080"}).code, 0);
    EXPECT_EQ(record("1080")["contour"], 1.5);
    EXPECT_EQ(record("1080")["title"], "Über GroEL");
    fs::remove(folder_ / "api/EMD-1080");
    put_header("b", "1080", xml_old);
    EXPECT_EQ(fetch({"1080"}).code, 0);
    EXPECT_EQ(record("1080")["contour"], -0.0025);
    EXPECT_EQ(record("1080")["title"], "GroEL");

    // Nowhere a level.
    fs::remove_all(folder_ / "b");
    put_record("1080", json_without);
    const Ended r = fetch({"1080"});
    EXPECT_EQ(r.code, 0);
    EXPECT_NE(r.err.find("EMD-1080 has no recommended contour"), std::string::npos) << r.err;
    EXPECT_TRUE(record("1080")["contour"].is_null());
    EXPECT_EQ(record("1080")["title"], "from the record");
    for (const char* odd :
         {"{}", "[]", R"({"map": {"contour_list": {"contour": [{"level": "high"}, 3]}}})"}) {
        put_record("1080", odd);
        EXPECT_EQ(fetch({"1080"}).code, 0) << odd;
        EXPECT_TRUE(record("1080")["contour"].is_null()) << odd;
    }
}

TEST_F(FetchEmdb, TheNextArchiveWhereOneFails) {
    put_map("b", "1080", map_file());
    put_record("1080", json_list);
    Ended r = fetch({"1080"});
    EXPECT_EQ(r.code, 0);
    EXPECT_NE(r.err.find("EMD-1080: file://" + at("a")), std::string::npos) << r.err;
    put_map("a", "1080", map_file().substr(0, 100));
    r = fetch({"1080"});
    EXPECT_EQ(r.code, 0);
    EXPECT_NE(r.err.find("not a whole gzip file"), std::string::npos) << r.err;
    EXPECT_EQ(record("1080")["url"], "file://" + at("b") + "/EMD-1080/map/emd_1080.map.gz");
}

TEST_F(FetchEmdb, DamagedMapsAreThreeAndLeaveNothing) {
    put_record("1080", json_list);
    MrcBytes odd;
    odd.set(4, 77);
    const std::string whole = MrcBytes().str();
    const std::vector<std::pair<std::string, std::string>> damaged{
        {map_file().substr(0, 100), "not a whole gzip file"},
        {"<html>no such page</html>", "not a whole gzip file"},
        {gzip("<html>no such page</html>"), "expected a header of 1024 bytes, found 25"},
        {gzip(whole.substr(0, whole.size() - 1)), "truncated: expected 1120 bytes"},
        {gzip(odd.str()), "not an MRC header: size (4, 3, 2), mode 77"}};
    for (const auto& [content, text] : damaged) {
        put_map("a", "1080", content);
        const Ended r = fetch({"1080"});
        EXPECT_EQ(r.code, 3) << text;
        EXPECT_NE(r.err.find(text), std::string::npos) << r.err;
        EXPECT_EQ(r.out, "");
        EXPECT_TRUE(got().empty()) << text;
    }
    put_map("a", "1080", map_file());
    put_record("1080", "<html>down for maintenance<br>");
    const Ended r = fetch({"1080"});
    EXPECT_EQ(r.code, 3);
    EXPECT_NE(r.err.find("neither JSON nor XML"), std::string::npos) << r.err;
    EXPECT_TRUE(got().empty());
}

TEST_F(FetchEmdb, AnEntryThatIsMissingDoesNotStopTheOthers) {
    for (const char* id : {"1048", "5119"}) {
        put_map("a", id, map_file());
        put_record(id, json_list);
    }
    put_map("a", "1265", map_file());  // no record
    const Ended r = fetch({"1048", "99999", "1265", "5119"});
    EXPECT_EQ(r.code, 4);
    EXPECT_EQ(r.out, at("got/emd_1048.map.gz") + "\n" + at("got/emd_5119.map.gz") + "\n");
    EXPECT_NE(r.err.find("error: 2 of 4 entries failed: EMD-99999 EMD-1265\n"), std::string::npos) << r.err;
    EXPECT_EQ(got(), (std::set<std::string>{"emd_1048.json", "emd_1048.map.gz", "emd_5119.json",
                                            "emd_5119.map.gz"}));
}

TEST_F(FetchEmdb, AnOldEntryStaysWhereTheNewOneFails) {
    put_map("a", "1080", map_file());
    put_record("1080", json_list);
    ASSERT_EQ(fetch({"1080"}).code, 0);
    const std::string map = bytes("got/emd_1080.map.gz"), record = bytes("got/emd_1080.json");
    put_map("a", "1080", map_file().substr(0, 60));
    EXPECT_EQ(fetch({"1080"}).code, 3);
    EXPECT_EQ(bytes("got/emd_1080.map.gz"), map);
    EXPECT_EQ(bytes("got/emd_1080.json"), record);
    EXPECT_EQ(got().size(), 2u);
}

TEST_F(FetchEmdb, Usage) {
    for (const Words& words : {Words{}, Words{"EMD-"}, Words{"12"}, Words{"1080x"}, Words{"--fast"},
                               Words{"-o"}, Words{"1080", "--retries", "many"}, Words{"../1080"}}) {
        Words command{FETCH_EMDB_SCRIPT};
        command.insert(command.end(), words.begin(), words.end());
        RunOptions options;
        options.folder = folder_.path();
        const Ended r = run(command, options);
        EXPECT_EQ(r.code, 2) << joined(words);
        EXPECT_EQ(r.out, "");
        EXPECT_EQ(r.err.rfind("fetch_emdb.sh: error: ", 0), 0u) << r.err;
    }
    EXPECT_EQ(listing().size(), 0u);
    const Ended help = run({FETCH_EMDB_SCRIPT, "--help"});
    EXPECT_EQ(help.code, 0);
    EXPECT_NE(help.out.find("usage: "), std::string::npos);
    make("file", "");
    const Ended blocked = run({FETCH_EMDB_SCRIPT, "-o", at("file"), "1080"});
    EXPECT_EQ(blocked.code, 4);
    EXPECT_NE(blocked.err.find(at("file") + ": cannot be made"), std::string::npos) << blocked.err;
}

TEST_F(FetchEmdb, AsksTheServersOfTheArchive) {
    put("bin/curl", "#!/bin/sh\nfor last; do :; done\necho \"$last\" >>'" + at("asked") + "'\nexit 22\n");
    fs::permissions(folder_ / "bin/curl", fs::perms(0755));
    const char* path = std::getenv("PATH");
    const Ended r = run({"/usr/bin/env", "PATH=" + at("bin") + ":" + (path ? path : "/usr/bin:/bin"),
                         FETCH_EMDB_SCRIPT, "-o", at("got"), "paper"});
    EXPECT_EQ(r.code, 4);
    EXPECT_NE(r.err.find("6 of 6 entries failed: EMD-1048 EMD-1129 EMD-1265 EMD-1590 EMD-1617 EMD-5119"),
              std::string::npos)
        << r.err;
    EXPECT_TRUE(got().empty());
    EXPECT_EQ(bytes("asked").rfind(
                  "https://files.wwpdb.org/pub/emdb/structures/EMD-1048/map/emd_1048.map.gz\n"
                  "https://ftp.ebi.ac.uk/pub/databases/emdb/structures/EMD-1048/map/emd_1048.map.gz\n",
                  0),
              0u)
        << bytes("asked");
}
