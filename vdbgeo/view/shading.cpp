#include "vdbgeo/view/shading.h"

#ifdef VDBGEO_HAS_EMBREE
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

Vec3f linear(const Vec3f& srgb) { return srgb.unaryExpr(&srgb_to_linear); }

/// What one primary ray found. Directions are in camera axes: right, up, towards the viewer.
struct Sample {
    bool hit = false, inside = false;
    float depth = 0;     // along `towards`, model units
    float open = 1;      // share of the hemisphere that is free
    float lit = 1;       // share of the key light that arrives
    Vec3f normal, base;  // base: linear light
};

/// The lights, in camera axes.
const Vec3f key_light = Vec3f(-0.54f, 0.62f, 0.57f).normalized();
const Vec3f fill_light = Vec3f(0.75f, -0.15f, 0.64f).normalized();
constexpr float occlusion_reach = 0.5f;  // of the mesh's radius
constexpr int shadow_rays = 2;           // a sample
constexpr float light_radius = 0.2f;     // of the key light's disc, at distance 1
constexpr float ray_offset = 2e-5f;      // of the mesh's radius: some 100 units in the last place

/// Three well mixed numbers in [0, 1) from four integers.
std::array<float, 3> noise(std::uint32_t x, std::uint32_t y, std::uint32_t i, std::uint32_t stream) {
    std::uint64_t h = (std::uint64_t(x) << 32 | y) * 0x9E3779B97F4A7C15ull;
    h ^= (std::uint64_t(i) << 32 | stream) * 0xC2B2AE3D27D4EB4Full + (h >> 29);
    h = (h ^ (h >> 32)) * 0xD6E8FEB86659FD93ull;
    h = (h ^ (h >> 32)) * 0xD6E8FEB86659FD93ull;
    h ^= h >> 32;
    const auto part = [&](int shift) { return static_cast<float>(h >> shift & 0x1FFFFF) * 0x1p-21f; };
    return {part(0), part(21), part(42)};
}

/// Two unit vectors that make a right-handed frame with the unit vector n.
std::pair<Vec3f, Vec3f> tangents(const Vec3f& n) {
    const Vec3f helper = std::abs(n.z()) < 0.9f ? Vec3f::UnitZ() : Vec3f::UnitX();
    const Vec3f t = helper.cross(n).normalized();
    return {t, n.cross(t)};
}

/// A panel's camera: model = axes · (right, up, towards).
struct Camera {
    Eigen::Matrix3f axes;
    float left, top, step;  // corner of sample (0, 0) and the distance of samples, model units
    float near, far;        // depths of the model
};

Vec3f base_colour(const Scene& scene, const RayCaster::Hit& hit, const Triangle& t, bool inside) {
    const Vec3f plain = linear(inside ? scene.options.inside : scene.options.surface);
    if (!scene.property) return plain;
    const auto& values = scene.property->values;
    const float w = 1 - hit.u - hit.v;
    double value = 0;
    if (scene.of_faces) {
        value = values[hit.face];
        if (std::isnan(value)) return plain;
    } else if (scene.scale->map->categories() > 0) {
        value = values[w >= hit.u && w >= hit.v ? t[0] : hit.u >= hit.v ? t[1] : t[2]];
    } else {
        value = w * values[t[0]] + hit.u * values[t[1]] + hit.v * values[t[2]];
    }
    return linear(scene.scale->colour(value)) * (inside ? 0.35f : 1.0f);
}

/// How much of the light an edge of the face takes at a point of it: lines about a pixel wide, by the
/// distance to the edges in the picture. Faces of a few pixels and those seen edge-on have fainter lines:
/// they would be nothing else.
float edge_ink(const Scene& scene, const Camera& camera, const RayCaster::Hit& hit, const Triangle& t) {
    constexpr float most = 0.8f, half_width = 0.5f;  // pixels
    const float pixel = camera.step * static_cast<float>(scene.grid);
    std::array<Eigen::Vector2f, 3> p;
    for (std::size_t k = 0; k < 3; ++k)
        p[k] = (camera.axes.transpose() * scene.model.points[t[k]]).head<2>() / pixel;
    const Eigen::Vector2f ab = p[1] - p[0], ac = p[2] - p[0];
    const float area = std::abs(ab.x() * ac.y() - ab.y() * ac.x());  // twice, pixels²
    const std::array<float, 3> length{(p[2] - p[1]).norm(), ac.norm(), ab.norm()};
    const float around = length[0] + length[1] + length[2];
    if (!(area > 0)) return 0;
    const float inner_radius = area / around;
    const float strength = most * std::clamp((inner_radius - 0.5f) / 3.0f, 0.0f, 1.0f);
    const unsigned hidden =
        scene.hidden_edges ? static_cast<unsigned>(scene.hidden_edges->values[hit.face]) : 0;
    const std::array<float, 3> weight{1 - hit.u - hit.v, hit.u, hit.v};
    float nearest = std::numeric_limits<float>::infinity();
    for (unsigned k = 0; k < 3; ++k)
        if (!(hidden >> k & 1u)) nearest = std::min(nearest, weight[k] * area / length[k]);
    return strength * std::clamp(half_width + 0.5f - nearest, 0.0f, 1.0f);
}

/// Rays from one point, cast when a packet is full. Each adds 1 to a counter where nothing blocks it.
class Fan {
 public:
    Fan(const RayCaster& rays, const Vec3f& origin) : rays_(rays), origin_(origin) {}
    void add(const Vec3f& direction, float length, int& free) {
        directions_[count_] = direction;
        lengths_[count_] = length;
        counters_[count_] = &free;
        if (++count_ == RayCaster::packet) cast();
    }
    void cast() {
        if (count_ == 0) return;
        const auto blocked = rays_.blocked(origin_, directions_, lengths_, count_);
        for (int i = 0; i < count_; ++i) *counters_[i] += !blocked[static_cast<std::size_t>(i)];
        count_ = 0;
    }

 private:
    const RayCaster& rays_;
    Vec3f origin_;
    Vec3f directions_[RayCaster::packet];
    float lengths_[RayCaster::packet];
    int* counters_[RayCaster::packet];
    int count_ = 0;
};

/// Neighbouring samples take interleaved parts of one pattern of directions, so that averaging over 4×4 of
/// them sees sixteen times as many evenly spread ones. Coordinates of ray i of n in the unit disc, evenly by
/// area, and a free number.
struct DiscRay {
    float square, angle, extra;  // radius², radians, [0, 1)
};
DiscRay disc_ray(std::uint32_t x, std::uint32_t y, int i, int n, std::uint32_t stream) {
    static constexpr std::uint32_t order[16] = {0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5};
    const float turn = static_cast<float>(order[(y & 3) * 4 + (x & 3)]);
    const float shift = static_cast<float>(order[((x + 1) & 3) * 4 + ((y + 2) & 3)]);
    const auto [a, b, c] = noise(x, y, static_cast<std::uint32_t>(i), stream);
    const float k = static_cast<float>(i);
    return {(k + (shift + a) / 16) / static_cast<float>(n), 6.2831853f * (k * 0.61803399f + (turn + b) / 16),
            c};
}

/// Casts the rays of ambient occlusion (cosine-weighted) and of the key light's shadow from `origin`, in the
/// hemisphere of the smooth normal: that of the flat face would cut the light off along the faces' edges.
void light_sample(const Scene& scene, const Camera& camera, const Vec3f& origin, std::uint32_t x,
                  std::uint32_t y, Sample& sample) {
    Fan fan(scene.rays, origin);
    int open = 0, lit = 0;
    const auto [tangent, bitangent] = tangents(sample.normal);
    const int n = scene.options.occlusion_rays;
    for (int i = 0; i < n; ++i) {
        const DiscRay ray = disc_ray(x, y, i, n, 0);
        const float flat = std::sqrt(ray.square);
        const Vec3f d = flat * std::cos(ray.angle) * tangent + flat * std::sin(ray.angle) * bitangent +
                        std::sqrt(std::max(0.0f, 1 - ray.square)) * sample.normal;
        fan.add(camera.axes * d, occlusion_reach * (0.05f + 0.95f * ray.extra), open);
    }
    const auto [across, up] = tangents(key_light);
    for (int i = 0; scene.options.shadows && i < shadow_rays; ++i) {
        const DiscRay ray = disc_ray(x, y, i, shadow_rays, 1);
        const float flat = light_radius * std::sqrt(ray.square);
        const Vec3f d =
            (key_light + flat * (std::cos(ray.angle) * across + std::sin(ray.angle) * up)).normalized();
        if (d.dot(sample.normal) > 0) fan.add(camera.axes * d, 4.0f, lit);
    }
    fan.cast();
    if (n > 0) sample.open = static_cast<float>(open) / static_cast<float>(n);
    if (scene.options.shadows) sample.lit = static_cast<float>(lit) / shadow_rays;
}

/// The point of a face moved out to where the smooth normals imagine the surface (Hanika 2021): rays that
/// start there are not cut off by the face itself or its neighbours where the mesh is a coarse image of a
/// convex surface. Where the surface is concave or flat the point stays.
Vec3f lifted(const ViewModel& model, const Triangle& t, const float* weights, const Vec3f& point,
             bool inside) {
    Vec3f result = point;
    for (int k = 0; k < 3; ++k) {
        const Vec3f normal = inside ? Vec3f(-model.normals[t[k]]) : model.normals[t[k]];
        result -= weights[k] * std::min(0.0f, (point - model.points[t[k]]).dot(normal)) * normal;
    }
    return result;
}

Sample trace(const Scene& scene, const Camera& camera, int column, int row) {
    Sample sample;
    const float x = camera.left + (static_cast<float>(column) + 0.5f) * camera.step;
    const float y = camera.top - (static_cast<float>(row) + 0.5f) * camera.step;
    const Vec3f towards = camera.axes.col(2);
    const Vec3f eye = camera.axes * Vec3f(x, y, 2.0f);
    const auto hit = scene.rays.first(eye, -towards);
    if (!hit) return sample;
    const Triangle& t = (*scene.model.triangles)[hit->face];
    const auto& p = scene.model.points;
    const auto& n = scene.model.normals;
    const Vec3f face = camera.axes.transpose() * (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]);
    const float w = 1 - hit->u - hit->v;
    sample.hit = true;
    sample.inside = face.z() < 0;
    const Vec3f face_normal = face.normalized() * (sample.inside ? -1.0f : 1.0f);
    Vec3f normal = camera.axes.transpose() * (w * n[t[0]] + hit->u * n[t[1]] + hit->v * n[t[2]]);
    if (sample.inside) normal = -normal;
    // A smooth normal that looks away from the viewer is turned to the horizon.
    normal.z() = std::max(normal.z(), 0.0f);
    sample.normal = normal.norm() > 1e-6f ? Vec3f(normal.normalized()) : face_normal;
    const bool drawing = scene.options.lines_only;
    sample.base = drawing ? linear(scene.options.background) : base_colour(scene, *hit, t, sample.inside);
    const float drawn = scene.options.edges ? edge_ink(scene, camera, *hit, t) : 0;
    sample.base =
        sample.base * (1 - drawn) + (drawing ? drawn : 0) * linear(ink_on(scene.options.background));
    const float weights[3] = {w, hit->u, hit->v};
    const Vec3f point = w * p[t[0]] + hit->u * p[t[1]] + hit->v * p[t[2]];
    sample.depth = point.dot(towards);
    if (drawing) return sample;
    const Vec3f origin =
        lifted(scene.model, t, weights, point, sample.inside) + camera.axes * (ray_offset * face_normal);
    light_sample(scene, camera, origin, static_cast<std::uint32_t>(column), static_cast<std::uint32_t>(row),
                 sample);
    return sample;
}

/// The samples of a tile and of a border around it.
struct Tile {
    int columns, rows;
    std::vector<Sample> samples;
    const Sample& at(int x, int y) const {
        return samples[static_cast<std::size_t>(y) * static_cast<std::size_t>(columns) +
                       static_cast<std::size_t>(x)];
    }
};

/// Weights of the neighbours within `reach`, row by row.
std::vector<float> bell(int reach) {
    std::vector<float> weights;
    for (int dy = -reach; dy <= reach; ++dy)
        for (int dx = -reach; dx <= reach; ++dx)
            weights.push_back(
                std::exp(-1.2f * static_cast<float>(dx * dx + dy * dy) / static_cast<float>(reach * reach)));
    return weights;
}

/// Occlusion and light averaged over the neighbours that lie on the same piece of surface.
std::pair<float, float> smooth_light(const Tile& tile, int x, int y, int reach, const float* bell,
                                     float step) {
    const Sample& here = tile.at(x, y);
    float weight = 0, open = 0, lit = 0;
    for (int dy = -reach; dy <= reach; ++dy)
        for (int dx = -reach; dx <= reach; ++dx, ++bell) {
            const Sample& other = tile.at(x + dx, y + dy);
            if (!other.hit || other.inside != here.inside) continue;
            const float like = here.normal.dot(other.normal);
            if (like < 0.7f) continue;
            const Vec3f apart(static_cast<float>(dx) * step, static_cast<float>(-dy) * step,
                              other.depth - here.depth);
            if (std::abs(apart.dot(here.normal)) > 2 * step * static_cast<float>(reach)) continue;
            const float w = like * like * *bell;
            weight += w;
            open += w * other.open;
            lit += w * other.lit;
        }
    return weight > 0 ? std::pair(open / weight, lit / weight) : std::pair(here.open, here.lit);
}

/// Whether the surface ends here before something clearly farther.
bool on_outline(const Tile& tile, int x, int y, int reach) {
    const Sample& here = tile.at(x, y);
    for (int dy = -reach; dy <= reach; ++dy)
        for (int dx = -reach; dx <= reach; ++dx) {
            const Sample& other = tile.at(x + dx, y + dy);
            if (!other.hit || other.depth < here.depth - 0.06f) return true;
        }
    return false;
}

Vec3f shade(const Scene& scene, const Camera& camera, const Sample& s, float open, float lit) {
    const Vec3f& n = s.normal;
    const float key = std::max(0.0f, (n.dot(key_light) + 0.2f) / 1.2f) * lit;
    const float fill = std::max(0.0f, n.dot(fill_light));
    const float sky = (0.8f + 0.2f * n.y()) * std::pow(open, 1.3f);
    const Vec3f half = (key_light + Vec3f::UnitZ()).normalized();
    const float mirror = n.dot(half);
    const float gloss = mirror > 0.7f ? 0.10f * std::pow(mirror, 28.0f) * lit : 0;  // else < 1e-5
    const Vec3f light =
        s.base * (0.95f * key + (0.16f * fill + 0.36f * sky) * (0.3f + 0.7f * open)) + Vec3f::Constant(gloss);
    const float depth = camera.near > camera.far ? (camera.near - s.depth) / (camera.near - camera.far) : 0;
    const float fade = 0.18f * std::clamp(depth, 0.0f, 1.0f);
    return light * (1 - fade) + linear(scene.options.background) * fade;
}

/// One tile of a panel, in pixels of the panel.
void draw_tile(Image& image, const Scene& scene, const Camera& camera, const Panel& panel, int x0, int y0,
               int x1, int y1) {
    const int grid = scene.grid, reach = grid + 1;
    const std::vector<float> weights = bell(reach);
    Tile tile{(x1 - x0) * grid + 2 * reach, (y1 - y0) * grid + 2 * reach, {}};
    tile.samples.reserve(static_cast<std::size_t>(tile.columns) * static_cast<std::size_t>(tile.rows));
    for (int y = 0; y < tile.rows; ++y)
        for (int x = 0; x < tile.columns; ++x)
            tile.samples.push_back(trace(scene, camera, x0 * grid + x - reach, y0 * grid + y - reach));
    for (int y = y0; y < y1; ++y)
        for (int x = x0; x < x1; ++x) {
            Vec3f sum = Vec3f::Zero();
            int hits = 0;
            for (int k = 0; k < grid * grid; ++k) {
                const int sx = (x - x0) * grid + k % grid + reach, sy = (y - y0) * grid + k / grid + reach;
                const Sample& sample = tile.at(sx, sy);
                if (!sample.hit) continue;
                const bool outlined =
                    scene.options.outline && on_outline(tile, sx, sy, std::max(1, grid / 2));
                Vec3f colour = sample.base;
                if (scene.options.lines_only) {
                    if (outlined) colour = linear(ink_on(scene.options.background));
                } else {
                    const auto [open, lit] = smooth_light(tile, sx, sy, reach, weights.data(), camera.step);
                    colour = shade(scene, camera, sample, open, lit) * (outlined ? 0.3f : 1.0f);
                }
                sum += colour.cwiseMin(1.0f);
                ++hits;
            }
            if (hits == 0) continue;  // the background keeps its exact bytes
            const float all = static_cast<float>(grid * grid);
            const Vec3f mean =
                (sum + linear(scene.options.background) * (all - static_cast<float>(hits))) / all;
            image.set(panel.x + x, panel.y + y, mean.unaryExpr(&linear_to_srgb));
        }
}

}  // namespace

void draw_panel(Image& image, const Scene& scene, double pixels_per_A, const Panel& panel, const ViewBox& box,
                const Progress& progress) {
    const double unit = scene.model.radius, pixel = 1 / pixels_per_A;
    Camera camera;
    camera.axes.col(0) = panel.view.right.cast<float>();
    camera.axes.col(1) = panel.view.up.cast<float>();
    camera.axes.col(2) = panel.view.towards.cast<float>();
    camera.left = static_cast<float>((panel.middle.x() - 0.5 * panel.width * pixel) / unit);
    camera.top = static_cast<float>((panel.middle.y() + 0.5 * panel.height * pixel) / unit);
    camera.step = static_cast<float>(pixel / unit / scene.grid);
    camera.near = static_cast<float>(box.high.z() / unit);
    camera.far = static_cast<float>(box.low.z() / unit);
    constexpr int side = 64;
    const int across = (panel.width + side - 1) / side, down = (panel.height + side - 1) / side;
    const auto tiles = static_cast<std::size_t>(across) * static_cast<std::size_t>(down);
    std::atomic<std::size_t> done = 0;
    parallel_for(tiles, 1, [&](std::size_t i) {
        const int x0 = static_cast<int>(i) % across * side, y0 = static_cast<int>(i) / across * side;
        draw_tile(image, scene, camera, panel, x0, y0, std::min(x0 + side, panel.width),
                  std::min(y0 + side, panel.height));
        progress.report(static_cast<double>(++done) / static_cast<double>(tiles));
    });
}

}  // namespace vdbgeo

#endif
