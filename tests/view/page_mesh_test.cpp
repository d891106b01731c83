// Packed meshes, unpacked again as a browser does.
#include "vdbgeo/view/page_mesh.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "tests/support/small_meshes.h"
#include "tests/support/tet_meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/view/page_text.h"

using namespace vdbgeo;
using namespace vdbgeo::test;
using Json = nlohmann::json;

namespace {

constexpr float nan_value = std::numeric_limits<float>::quiet_NaN();

std::vector<std::uint8_t> from_base64(const std::string& text) {
    const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::vector<std::uint8_t> bytes;
    std::uint32_t bits = 0;
    int have = 0;
    for (const char c : text) {
        if (c == '=') break;
        bits = bits << 6 | static_cast<std::uint32_t>(digits.find(c));
        if ((have += 6) >= 8) bytes.push_back(static_cast<std::uint8_t>(bits >> (have -= 8)));
    }
    return bytes;
}

/// The byte planes of `count` numbers.
std::vector<std::uint32_t> planes(const Json& json, std::size_t count, std::size_t bytes) {
    const auto packed = from_base64(json.at("data").get<std::string>());
    std::vector<std::uint8_t> raw(count * bytes + 1);
    uLongf size = raw.size();
    EXPECT_EQ(uncompress(raw.data(), &size, packed.data(), packed.size()), Z_OK);
    EXPECT_EQ(size, count * bytes);
    std::vector<std::uint32_t> values(count);
    for (std::size_t b = 0; b < bytes; ++b)
        for (std::size_t i = 0; i < count; ++i) values[i] |= std::uint32_t(raw[b * count + i]) << 8 * b;
    return values;
}

std::vector<std::uint32_t> unpacked_array(const Json& json) {
    const std::size_t count = json.at("count"), components = json.at("components");
    const int bits = json.at("bits");
    auto values = planes(json, count * components, static_cast<std::size_t>(bits) / 8);
    const std::uint32_t mask = bits == 32 ? ~0u : (1u << bits) - 1;
    for (std::size_t i = 0; i < values.size(); ++i)
        if (i % count != 0) values[i] = (values[i] + values[i - 1]) & mask;
    return values;
}

std::vector<std::uint32_t> unpacked_index(const Json& json) {
    auto values = planes(json, json.at("count"), 4);
    std::uint32_t next = 0;
    for (std::uint32_t& v : values) v = v == 0 ? next++ : next - v;
    return values;
}

std::vector<Vec3d> positions(const Json& mesh, Vec3d& half_step) {
    const auto values = unpacked_array(mesh.at("position"));
    const std::size_t n = mesh.at("vertices");
    EXPECT_EQ(values.size(), 3 * n);
    std::vector<Vec3d> points(n);
    for (int a = 0; a < 3; ++a) {
        const double low = mesh["box"][0][a], high = mesh["box"][1][a];
        half_step[a] = (high - low) / 65535 / 2 * 1.0001 + 1e-12;
        for (std::size_t v = 0; v < n; ++v)
            points[v][a] = values[static_cast<std::size_t>(a) * n + v] / 65535.0 * (high - low) + low;
    }
    return points;
}

/// Finds the packed mesh's elements in the mesh they came from: each once, no corner further off than half a
/// step, and not turned over (`even`: the order of the corners differs by an even permutation).
template <std::size_t N, class Element, class Points>
void expect_same_elements(const Json& mesh, const Array<Element>& elements, const Points& old_points) {
    Vec3d half;
    const std::vector<Vec3d> points = positions(mesh, half);
    const auto index = unpacked_index(mesh.at("index"));
    ASSERT_EQ(index.size(), N * elements.size());
    const auto near = [&](VertexId old, std::uint32_t v) {
        const Vec3d d = (points.at(v) - old_points[old].template cast<double>()).cwiseAbs();
        return (d.array() <= half.array()).all();
    };
    std::vector<bool> found(elements.size(), false);
    for (std::size_t i = 0; i < index.size(); i += N) {
        std::size_t at = elements.size();
        for (std::size_t e = 0; e < elements.size() && at == elements.size(); ++e) {
            if (found[e]) continue;
            std::array<std::size_t, N> order;
            for (std::size_t k = 0; k < N; ++k) order[k] = k;
            do {
                int odd = 0;
                for (std::size_t a = 0; a < N; ++a)
                    for (std::size_t b = a + 1; b < N; ++b) odd ^= order[a] > order[b];
                bool same = odd == 0;
                for (std::size_t k = 0; k < N && same; ++k) same = near(elements[e][order[k]], index[i + k]);
                if (same) at = e;
            } while (at == elements.size() && std::next_permutation(order.begin(), order.end()));
        }
        ASSERT_LT(at, elements.size()) << "element " << i / N << " is none of the mesh's";
        found[at] = true;
    }
}

PageProperty scalar(const std::string& key, std::vector<float> values) {
    PageProperty p;
    p.key = key, p.name = key, p.values = std::move(values);
    return p;
}

}  // namespace

TEST(PageMesh, ArraysComeBack) {
    const std::vector<std::uint32_t> values{0, 255, 3, 3, 250, 1};
    for (const int bits : {8, 16, 32})
        for (const int components : {1, 2, 3}) {
            const Json json = Json::parse(packed_array(values, bits, components));
            EXPECT_EQ(json["bits"], bits);
            EXPECT_EQ(json["count"], 6 / components);
            EXPECT_EQ(unpacked_array(json), values) << bits << " " << components;
        }
    const std::vector<std::uint32_t> large{65535, 0, 65534, 1};
    EXPECT_EQ(unpacked_array(Json::parse(packed_array(large, 16))), large);
    EXPECT_EQ(unpacked_array(Json::parse(packed_array({}, 16, 3))).size(), 0u);
    EXPECT_THROW(packed_array(values, 12), InvalidInput);
    EXPECT_THROW(packed_array(values, 8, 4), InvalidInput);
    EXPECT_THROW(packed_array(values, 8, 0), InvalidInput);
}

TEST(PageMesh, IndicesComeBackAndHaveToComeInTurn) {
    const std::vector<VertexId> corners{0, 1, 2, 2, 1, 3, 0, 3, 4};
    EXPECT_EQ(unpacked_index(Json::parse(packed_index(corners))), corners);
    EXPECT_EQ(unpacked_index(Json::parse(packed_index({}))).size(), 0u);
    EXPECT_THROW(packed_index({0, 2, 1}), InvalidInput);
}

TEST(PageMesh, ASurfaceComesBack) {
    TriMesh mesh = icosphere(2, 37.5);
    for (Vec3f& p : mesh.points) p += Vec3f(1000, -3, 0.25f);
    mesh.points.push_back(Vec3f(5000, 0, 0));  // which no face uses
    std::vector<float> x(mesh.points.size());
    for (std::size_t v = 0; v < x.size(); ++v) x[v] = mesh.points[v].x();
    PageProperty p = scalar("x", x);
    p.range = {900, 1100};
    const Json json = Json::parse(packed_surface(mesh, {p}, 12345));
    EXPECT_EQ(json["faces"], mesh.triangles.size());
    EXPECT_EQ(json["faces_full"], 12345);
    EXPECT_EQ(json["vertices"], mesh.points.size() - 1);
    expect_same_elements<3>(json, mesh.triangles, mesh.points);
    // The property went with the vertices.
    Vec3d half;
    const std::vector<Vec3d> points = positions(json, half);
    const Json& packed = json["properties"][0];
    EXPECT_EQ(packed["range"], Json({900, 1100}));
    const double low = packed["low"], high = packed["high"];
    const auto values = unpacked_array(packed["values"]);
    ASSERT_EQ(values.size(), points.size());
    for (std::size_t v = 0; v < points.size(); ++v)
        EXPECT_NEAR(values[v] / 65534.0 * (high - low) + low, points[v].x(), half.x() + (high - low) / 65534);
}

TEST(PageMesh, TetrahedraComeBack) {
    const TetMesh mesh = ball_tets(10, 4);
    PageProperty p = scalar("number", std::vector<float>(mesh.tets.size()));
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) p.values[t] = static_cast<float>(t);
    const Json json = Json::parse(packed_tets(mesh, {p}, mesh.tets.size()));
    EXPECT_EQ(json["tets"], mesh.tets.size());
    EXPECT_EQ(json["tets_full"], mesh.tets.size());
    expect_same_elements<4>(json, mesh.tets, mesh.points);
    // Each tetrahedron has its own number still.
    const auto values = unpacked_array(json["properties"][0]["values"]);
    EXPECT_EQ(std::set<std::uint32_t>(values.begin(), values.end()).size(), mesh.tets.size());
}

TEST(PageMesh, SameBytesAndSmallInWhateverOrder) {
    TriMesh mesh = icosphere(5, 100);
    const std::string packed = packed_surface(mesh, {}, 0);
    EXPECT_EQ(packed, packed_surface(mesh, {}, 0));
    // Faces in an order that jumps about cost a little more only.
    std::vector<Triangle> jumping;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
        jumping.push_back(mesh.triangles[i * 7919 % mesh.triangles.size()]);
    std::copy(jumping.begin(), jumping.end(), mesh.triangles.begin());
    EXPECT_LT(packed_surface(mesh, {}, 0).size(), 1.2 * static_cast<double>(packed.size()));
    // 20480 faces, 10242 vertices: 245760 + 122904 bytes as they are.
    EXPECT_LT(packed.size(), 90000u);
}

TEST(PageMesh, CategoriesAndWhatHasNoValue) {
    const TriMesh mesh = icosphere(0, 1);
    const std::size_t n = mesh.points.size();
    PageProperty kind = scalar("kind", std::vector<float>(n, 3));
    kind.category = true;
    kind.classes = {{3, "three"}, {4, "<four>"}};
    kind.values[0] = nan_value, kind.values[1] = -1, kind.values[2] = 255, kind.values[3] = 2.5f,
    kind.values[4] = 254;
    PageProperty some = scalar("some", std::vector<float>(n, nan_value));
    some.values[5] = 7;
    const Json json = Json::parse(packed_surface(mesh, {kind, some}, n));
    auto values = unpacked_array(json["properties"][0]["values"]);
    std::sort(values.begin(), values.end());
    EXPECT_EQ(std::count(values.begin(), values.end(), 255u), 4);
    EXPECT_EQ(std::count(values.begin(), values.end(), 254u), 1);
    EXPECT_EQ(std::count(values.begin(), values.end(), 3u), static_cast<std::ptrdiff_t>(n) - 5);
    EXPECT_EQ(json["properties"][0]["kind"], "category");
    EXPECT_EQ(json["properties"][0]["classes"][1], Json({{"value", 4}, {"name", "<four>"}}));
    const auto scalars = unpacked_array(json["properties"][1]["values"]);
    EXPECT_EQ(std::count(scalars.begin(), scalars.end(), 65535u), static_cast<std::ptrdiff_t>(n) - 1);
    EXPECT_LT(json["properties"][1]["low"].get<double>(), 7);
    EXPECT_GT(json["properties"][1]["high"].get<double>(), 7);
}

TEST(PageMesh, RangesAreRobustAndSymmetricWhereColoursAre) {
    const TriMesh mesh = icosphere(3, 1);
    PageProperty p = scalar("H", std::vector<float>(mesh.points.size()));
    for (std::size_t v = 0; v < p.values.size(); ++v)
        p.values[v] = -1 + 4 * static_cast<float>(v) / static_cast<float>(p.values.size() - 1);
    p.values[17] = 1e30f;  // one wild value
    const auto shown = [&] {
        const Json json = Json::parse(packed_surface(mesh, {p}, 0));
        return std::array<double, 4>{json["properties"][0]["range"][0], json["properties"][0]["range"][1],
                                     json["properties"][0]["low"], json["properties"][0]["high"]};
    };
    auto r = shown();
    EXPECT_NEAR(r[0], -0.92, 0.02);
    EXPECT_NEAR(r[1], 2.92, 0.03);
    EXPECT_NEAR(r[2], -1, 0.01);
    EXPECT_LT(r[3], 1000);  // the wild one does not take all the steps
    p.colormap = "diverging";
    r = shown();
    EXPECT_DOUBLE_EQ(r[0], -r[1]);
    EXPECT_NEAR(r[1], 2.92, 0.03);
}

TEST(PageMesh, EmptyFlatAndDamagedMeshes) {
    const Json none = Json::parse(packed_surface({}, {}, 0));
    EXPECT_EQ(none["faces"], 0);
    EXPECT_EQ(none["vertices"], 0);
    TriMesh flat;
    flat.points = {{0, 0, 5}, {1, 0, 5}, {0, 1, 5}, {1, 1, 5}};
    flat.triangles = {{0, 1, 2}, {2, 1, 3}, {1, 1, 2}};  // one without area among them
    const Json json = Json::parse(packed_surface(flat, {}, 3));
    EXPECT_EQ(json["box"][0][2], json["box"][1][2]);
    expect_same_elements<3>(json, flat.triangles, flat.points);
    EXPECT_THROW(packed_surface(flat, {scalar("short", {1, 2})}, 3), InvalidInput);
    flat.triangles.push_back({0, 1, 9});
    EXPECT_THROW(packed_surface(flat, {}, 3), InvalidInput);
}

TEST(PageText, Base64) {
    const std::vector<std::pair<std::string, std::string>> known{
        {"", ""}, {"f", "Zg=="}, {"fo", "Zm8="}, {"foo", "Zm9v"}, {"foob", "Zm9vYg=="}, {"\xFF\xFE", "//4="}};
    for (const auto& [bytes, text] : known) EXPECT_EQ(base64(bytes), text);
}

TEST(PageText, WhatIsNotTextIsMadeHarmless) {
    EXPECT_EQ(html_text("a<b>&\"'"), "a&lt;b&gt;&amp;&quot;&#39;");
    EXPECT_EQ(html_text("tab\tline\n bell\a nul" + std::string(1, '\0')), "tab\tline\n bell nul");
    const std::string mark = "\xEF\xBF\xBD";
    EXPECT_EQ(valid_utf8("Å\xFFz"), "Å" + mark + "z");
    EXPECT_EQ(valid_utf8("\xC0\xAF"), mark + mark);                        // an overlong slash
    EXPECT_EQ(valid_utf8("\xED\xA0\x80"), mark + mark + mark);             // half of a surrogate pair
    EXPECT_EQ(valid_utf8("\xF4\x90\x80\x80"), mark + mark + mark + mark);  // beyond Unicode
    EXPECT_EQ(valid_utf8("\xE2\x82"), mark + mark);                        // cut off
    EXPECT_EQ(valid_utf8("😀"), "😀");
    EXPECT_EQ(json_string("</script><!--\"\\\n"), "\"<\\/script>\\u003c!--\\\"\\\\\\n\"");
    EXPECT_EQ(Json::parse(json_string("</script><!--\"\\\n")), "</script><!--\"\\\n");
    EXPECT_EQ(json_number(0.1), "0.1");
    EXPECT_EQ(json_number(std::nan("")), "null");
}
