// vdbgeo validate: the tables of the paper, rerun.
#include "tests/cli/cli_test.h"

using namespace vdbgeo::test;

namespace {

class Validate : public Cli {};

Json table_named(const Json& result, const std::string& name) {
    for (const Json& table : result["tables"])
        if (table["table"] == name) return table;
    return {};
}

}  // namespace

TEST_F(Validate, NoFigureIsWorseThanThePapers) {
    const Json j = json({"validate", "--quick"});
    EXPECT_TRUE(j["worse"].empty()) << j["worse"];
    ASSERT_EQ(j["tables"].size(), 8u);
    std::size_t judged = 0;
    for (const Json& table : j["tables"]) {
        EXPECT_FALSE(table["title"].get<std::string>().empty());
        EXPECT_FALSE(table["rows"].empty()) << table["table"];
        for (const Json& row : table["rows"])
            for (const Json& value : row["values"]) {
                EXPECT_TRUE(value["ours"].is_number()) << row;
                EXPECT_EQ(value["worse"], false) << row;
                judged += value.contains("paper");
            }
    }
    EXPECT_GT(judged, 40u);
}

TEST_F(Validate, SetsThePapersFiguresBesideOurs) {
    const Json j = json({"validate", "--quick", "--table", "2", "--table", "5"});
    ASSERT_EQ(j["tables"].size(), 2u);
    const Json area = table_named(j, "2")["rows"][0]["values"][0];
    EXPECT_EQ(area["name"], "area");
    EXPECT_EQ(area["paper"], 12.53);
    EXPECT_NEAR(area["ours"].get<double>(), 12.53, 0.005);
    EXPECT_NEAR(area["theory"].get<double>(), 12.5664, 1e-4);
    const Json rows = table_named(j, "5")["rows"];
    EXPECT_EQ(rows[0]["subject"], "peak, edges 0.1");
    EXPECT_FALSE(rows[0]["values"][0].contains("order"));
    EXPECT_EQ(rows[1]["values"][1]["paper"], 1.149e-3);
    EXPECT_EQ(rows[1]["values"][1]["paper_order"], 2.07);
    EXPECT_NEAR(rows[1]["values"][1]["order"].get<double>(), 2, 0.05);
}

TEST_F(Validate, PrintsTablesToRead) {
    const Ended r = good({"validate", "--quick", "--table", "4", "--quiet"});
    for (const char* text :
         {"Table 4: ", "K mean: theory", "paper", "ours", "radius √3", "0.577343", "no figure is worse"})
        EXPECT_NE(r.out.find(text), std::string::npos) << text << "\n" << r.out;
    EXPECT_EQ(r.out.find("WORSE"), std::string::npos);
}

TEST_F(Validate, TheSameForAnyNumberOfThreads) {
    const Words words{"validate", "--quick", "--table", "5", "--table", "maps", "--quiet", "--threads"};
    Words one = words, two = words;
    one.push_back("1");
    two.push_back("2");
    EXPECT_EQ(good(one).out, good(two).out);
}

TEST_F(Validate, RefusesTablesThatThereAreNot) {
    expect_error(vdbgeo({"validate", "--table", "7"}), 2, "--table", "7");
}
