#include "vdbgeo/volume/isovalue.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using Rule = Isovalue::Rule;

TEST(Isovalue, ParsesNumbersSigmasAndAuto) {
    const auto expect = [](const std::string& text, Rule rule, double number) {
        const Isovalue iso = Isovalue::parse(text);
        EXPECT_EQ(iso.rule, rule) << text;
        EXPECT_EQ(iso.number, number) << text;
    };
    expect("auto", Rule::automatic, 0);
    expect("0.7", Rule::value, 0.7);
    expect("-1e-3", Rule::value, -1e-3);
    expect("0", Rule::value, 0);
    expect(".5", Rule::value, 0.5);
    expect("3sigma", Rule::sigma, 3);
    expect("-2.5sigma", Rule::sigma, -2.5);
    expect("1e1sigma", Rule::sigma, 10);
}

TEST(Isovalue, RefusesAnythingElse) {
    for (const char* text : {"", " ", "auto ", "Auto", "sigma", "3 sigma", "3sigmas", "3s", "0.7x", "0,7",
                             "nan", "inf", "-inf", "1e999", "infsigma", "nansigma", "0x10", "--1", "3sigma3"})
        EXPECT_THROW(Isovalue::parse(text), InvalidInput) << "'" << text << "'";
}

TEST(Isovalue, TextIsParsedBackToTheSame) {
    for (const double number : {0.0, 0.1, -1e-300, 1e20, 1.0 / 3, 123456789.0, 5e-324, 1.7e308})
        for (const Rule rule : {Rule::value, Rule::sigma}) {
            const Isovalue iso{rule, number};
            const Isovalue back = Isovalue::parse(iso.text());
            EXPECT_EQ(back.rule, rule) << iso.text();
            EXPECT_EQ(back.number, number) << iso.text();
        }
    EXPECT_EQ(Isovalue().text(), "auto");
    EXPECT_EQ((Isovalue{Rule::sigma, 3}.text()), "3sigma");
    EXPECT_EQ(Isovalue::parse("auto").rule, Rule::automatic);
}

TEST(Isovalue, ResolvesByItsRule) {
    Statistics s;
    s.count = 10;
    s.mean = 2;
    s.rms = 0.5;
    s.max = 5;
    EXPECT_EQ(Isovalue::parse("auto").resolve(s), 3.5);
    EXPECT_EQ(Isovalue::parse("auto").resolve(s, openvdb::GRID_LEVEL_SET), 0);
    EXPECT_EQ(Isovalue::parse("auto").resolve(s, openvdb::GRID_FOG_VOLUME), 2.5);
    EXPECT_EQ(Isovalue::parse("3sigma").resolve(s, openvdb::GRID_LEVEL_SET), 3.5);
    EXPECT_EQ(Isovalue::parse("-1sigma").resolve(s), 1.5);
    EXPECT_EQ(Isovalue::parse("0.7").resolve(s), 0.7);
}

TEST(Isovalue, WithoutAFiniteSampleOnlyANumberResolves) {
    Statistics s;
    EXPECT_THROW(Isovalue::parse("auto").resolve(s), InvalidInput);
    s.count = s.non_finite = 8;
    EXPECT_THROW(Isovalue::parse("3sigma").resolve(s), InvalidInput);
    EXPECT_EQ(Isovalue::parse("0.7").resolve(s), 0.7);
    EXPECT_EQ(Isovalue::parse("auto").resolve(s, openvdb::GRID_LEVEL_SET), 0);
}
