// The kernel sets of marching cubes give the same bits, and what the plainest gives is checked bit by bit.
#include "vdbgeo/surface/cell_kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <random>

#include "tests/support/maps.h"
#include "vdbgeo/surface/cell_topology.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

constexpr int layer_floats = (cell::block_dim + 1) * cell::sample_stride;

/// 9³ samples in a block's layout.
std::vector<float> block_samples(unsigned seed) { return noise(9 * layer_floats, seed); }

cell::EdgeBits some_edges(unsigned seed) {
    std::mt19937_64 random(seed);
    cell::EdgeBits edges{};
    int vertices = 0;
    for (int x = 0; x < 8; ++x) {
        edges.layer_first[x] = static_cast<std::uint16_t>(vertices);
        for (auto& axis : edges.crossed) axis[x] = random() & random();
        int in_layer = 0;
        for (int y = 0; y < 8; ++y) {
            edges.row_first[x] |= static_cast<std::uint64_t>(in_layer) << 8 * y;
            for (const auto& axis : edges.crossed) in_layer += __builtin_popcountll(axis[x] >> 8 * y & 0xFF);
        }
        vertices += in_layer;
    }
    return edges;
}

}  // namespace

TEST(CellKernels, SignsAreThoseOfEachSample) {
    std::vector<float> values = noise(512, 1);
    for (std::size_t i = 0; i < values.size(); i += 7) values[i] = i % 2 ? 0.25f : std::nanf("");
    for (const cell::Kernels* k : cell::available_kernels()) {
        cell::BlockBits words;
        k->sign_words(values.data(), 0.25f, words);
        for (int i = 0; i < 512; ++i)
            ASSERT_EQ(words[i / 64] >> (i % 64) & 1, values[static_cast<std::size_t>(i)] >= 0.25f)
                << k->name << " " << i;
    }
}

TEST(CellKernels, PatternsAreThoseOfEachCellsKey) {
    std::mt19937_64 random(2);
    cell::BlockBits active, corner_words[8];
    cell::FaceBits faces;
    const std::uint64_t* corners[8];
    for (int x = 0; x < 8; ++x) {
        active[x] = x == 3 ? 0 : random();
        for (auto& words : corner_words) words[x] = random();
        for (int a = 0; a < 3; ++a) faces.lower[a][x] = random(), faces.upper[a][x] = random();
    }
    for (int c = 0; c < 8; ++c) corners[c] = corner_words[c];
    std::vector<std::uint16_t> of_key(1 << 14);
    for (std::size_t i = 0; i < of_key.size(); ++i) of_key[i] = static_cast<std::uint16_t>(40503 * i);
    for (const cell::Kernels* k : cell::available_kernels())
        for (const cell::FaceBits* with : std::initializer_list<const cell::FaceBits*>{nullptr, &faces}) {
            std::array<std::uint16_t, 512> patterns;
            std::array<cell::OpenCell, 512> open;
            const cell::Counts counts =
                k->list_patterns(active, corners, with, of_key.data(), patterns.data(), open.data());
            std::size_t n = 0, m = 0;
            for (int i = 0; i < 512; ++i) {
                const int x = i / 64, bit = i % 64;
                if (!(active[x] >> bit & 1)) continue;
                std::size_t key = 0;
                for (int c = 0; c < 8; ++c) key |= (corners[c][x] >> bit & 1) << c;
                for (int a = 0; with && a < 3; ++a)
                    key |= (faces.lower[a][x] >> bit & 1) << (8 + 2 * a) | (faces.upper[a][x] >> bit & 1)
                                                                               << (9 + 2 * a);
                ASSERT_EQ(patterns[n], of_key[key]) << k->name << " cell " << i;
                if (of_key[key] & cell::unsettled) {
                    ASSERT_EQ(open[m].cell, i) << k->name;
                    ASSERT_EQ(open[m].item, n) << k->name;
                    ++m;
                }
                ++n;
            }
            EXPECT_EQ(counts.cells, static_cast<int>(n));
            EXPECT_EQ(counts.open, static_cast<int>(m));
        }
}

TEST(CellKernels, AllSetsGiveTheSameVerticesAndTunnels) {
    const std::vector<float> samples = block_samples(3);
    const cell::EdgeBits edges = some_edges(4);
    const cell::DiagonalPlacing placing{{10.1, -3, 1e3}, {1.3, -0.7, 2.1}, {8, -16, 400}, 0.1,
                                        1.0 / 1024,      nullptr};
    std::vector<float> points[3];
    std::vector<bool> changes[3];
    std::size_t set = 0;
    for (const cell::Kernels* k : cell::available_kernels()) {
        points[set].assign(3 * 3 * 512 + 8, 0);
        cell::DiagonalPlacing with_end = placing;
        with_end.end = points[set].data() + points[set].size();
        k->place_vertices(samples.data(), edges, with_end, points[set].data());
        std::vector<cell::SliceTest> tests(1024);
        for (std::size_t i = 0; i < tests.size(); ++i)
            tests[i] = {{static_cast<std::uint16_t>(i / 2), 0}, static_cast<std::uint8_t>(i % 2), false};
        k->settle(samples.data(), 0.1f, tests.data(), static_cast<int>(tests.size()));
        for (const cell::SliceTest& t : tests) changes[set].push_back(t.change);
        EXPECT_GT(std::count(changes[set].begin(), changes[set].end(), true), 10);
        EXPECT_EQ(changes[set], changes[0]) << k->name;
        std::size_t vertices = 0;
        for (const auto& axis : edges.crossed)
            for (const std::uint64_t word : axis)
                vertices += static_cast<std::size_t>(__builtin_popcountll(word));
        EXPECT_EQ(std::memcmp(points[set].data(), points[0].data(), 3 * vertices * sizeof(float)), 0)
            << k->name;
        ++set;
    }
}

TEST(CellKernels, DrawsEveryCellFromTheNumbersAroundItAndNothingPastTheEnd) {
    const cell::EdgeBits edges = some_edges(5);
    std::mt19937_64 random(6);
    constexpr std::size_t kinds = 16;
    std::array<cell::Drawing::Places, kinds> first, more;
    std::array<std::uint8_t, kinds> corners;
    for (std::size_t p = 0; p < kinds; ++p) {
        corners[p] = static_cast<std::uint8_t>(3 * (1 + p % 10));
        for (int i = 0; i < 16; ++i) {
            first[p].place[i] = static_cast<std::uint8_t>(random() % 32);
            more[p].place[i] = static_cast<std::uint8_t>(random() % 32);
        }
    }
    std::array<std::uint16_t, 512> patterns;
    for (auto& p : patterns) p = static_cast<std::uint16_t>(random() % kinds);
    cell::BlockBits active;
    for (auto& word : active) word = random();
    for (const cell::Kernels* k : cell::available_kernels()) {
        cell::VertexNumbers numbers;
        std::memset(&numbers, 0, sizeof(numbers));
        for (int side = 0; side < 7; ++side)
            k->take_numbers(edges, 1000u * static_cast<unsigned>(side), side, numbers);
        // The numbers of crossed edges, one after another.
        std::uint32_t next = 0;
        for (int x = 0; x < 8; ++x)
            for (int y = 0; y < 8; ++y)
                for (int z = 0; z < 8; ++z)
                    for (int a = 0; a < 3; ++a) {
                        if (!(edges.crossed[a][x] >> (8 * y + z) & 1)) continue;
                        ASSERT_EQ(numbers.of[x][y][z][a], next) << k->name;
                        ++next;
                    }
        for (int x = 0; x < 8; ++x)
            for (int y = 0; y < 8; ++y) {
                ASSERT_EQ(numbers.of[x][y][8][0],
                          4000 + edges.layer_first[x] + (edges.row_first[x] >> 8 * y & 0xFF));
                ASSERT_EQ(numbers.of[x][y][8][1],
                          numbers.of[x][y][8][0] + (edges.crossed[0][x] >> 8 * y & 1));
            }
        std::vector<std::uint32_t> expected;
        std::size_t item = 0;
        for (int i = 0; i < 512; ++i) {
            if (!(active[i / 64] >> i % 64 & 1)) continue;
            const std::size_t p = patterns[item++];
            for (int c = 0; c < corners[p]; ++c) {
                const int place = (c < 16 ? first : more)[p].place[c & 15];
                expected.push_back(numbers.of[i / 64 + (place >> 4)][(i >> 3 & 7) + (place >> 3 & 1)]
                                             [(i & 7) + (place >> 2 & 1)][place & 3]);
            }
        }
        std::vector<std::uint32_t> out(expected.size() + 64, 77);
        k->draw({active,
                 patterns.data(),
                 &numbers,
                 {first.data(), more.data(), corners.data()},
                 out.data(),
                 out.data() + expected.size(),
                 nullptr,
                 nullptr});
        EXPECT_TRUE(std::equal(expected.begin(), expected.end(), out.begin())) << k->name;
        for (std::size_t i = expected.size(); i < out.size(); ++i) ASSERT_EQ(out[i], 77u) << k->name;
    }
}
