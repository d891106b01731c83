// MRC to VDB with OpenVDB's own tools and a dense array, the way it is done in C++ without vdbgeo: a peer for
// scripts/bench-tomogram. Modes 1 and 2, this machine's byte order, columns along x.
#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>
#include <openvdb/tools/Prune.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iostream>
#include <stdexcept>
#include <vector>

namespace {

struct Map {
    std::int32_t nx = 0, ny = 0, nz = 0, mode = 0;
    double voxel = 1;
    std::vector<float> values;
};

Map read_map(const char* path) {
    std::ifstream in(path, std::ios::binary);
    std::vector<char> header(1024);
    if (!in.read(header.data(), 1024)) throw std::runtime_error("no header");
    const auto word = [&](std::size_t n) {
        std::int32_t value;
        std::memcpy(&value, header.data() + 4 * (n - 1), 4);
        return value;
    };
    Map map{word(1), word(2), word(3), word(4), 1, {}};
    float cell;
    std::memcpy(&cell, header.data() + 4 * 10, 4);
    if (word(8) > 0 && cell > 0) map.voxel = static_cast<double>(cell) / word(8);
    if (map.mode != 1 && map.mode != 2) throw std::runtime_error("not of mode 1 or 2");
    in.seekg(1024 + word(24));
    const auto count = static_cast<std::size_t>(map.nx) * static_cast<std::size_t>(map.ny) *
                       static_cast<std::size_t>(map.nz);
    map.values.resize(count);
    if (map.mode == 2) {
        in.read(reinterpret_cast<char*>(map.values.data()), static_cast<std::streamsize>(4 * count));
    } else {
        std::vector<std::int16_t> section(static_cast<std::size_t>(map.nx) *
                                          static_cast<std::size_t>(map.ny));
        for (std::size_t done = 0; done < count; done += section.size()) {
            in.read(reinterpret_cast<char*>(section.data()),
                    static_cast<std::streamsize>(2 * section.size()));
            for (std::size_t i = 0; i < section.size(); ++i) map.values[done + i] = section[i];
        }
    }
    if (!in) throw std::runtime_error("truncated");
    return map;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) {
        std::cerr << "usage: peer_copy_from_dense IN.mrc OUT.vdb THRESHOLD\n";
        return 2;
    }
    try {
        openvdb::initialize();
        Map map = read_map(argv[1]);
        const float threshold = std::strtof(argv[3], nullptr);
        for (float& v : map.values)
            if (!(v > threshold)) v = 0;
        using openvdb::Coord;
        const openvdb::CoordBBox box(Coord(0), Coord(map.nx - 1, map.ny - 1, map.nz - 1));
        // LayoutXYZ: x runs fastest.
        const openvdb::tools::Dense<float, openvdb::tools::LayoutXYZ> dense(box, map.values.data());
        auto grid = openvdb::FloatGrid::create(0);
        grid->setName("density");
        grid->setTransform(openvdb::math::Transform::createLinearTransform(map.voxel));
        openvdb::tools::copyFromDense(dense, *grid, 0.0f);
        openvdb::tools::prune(grid->tree());
        openvdb::io::File file(argv[2]);
        file.write({grid});
        file.close();
    } catch (const std::exception& error) {
        std::cerr << "peer_copy_from_dense: error: " << argv[1] << ": " << error.what() << "\n";
        return 3;
    }
}
