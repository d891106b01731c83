#include "vdbgeo/volume/specimen.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

namespace {

using Parts = std::vector<Part>;

constexpr double pi = 3.14159265358979323846;

/// The point at cylindrical coordinates: radius and height in Å, angle in degrees.
Vec3d at(double radius, double degrees, double z) {
    const double angle = degrees * pi / 180;
    return {radius * std::cos(angle), radius * std::sin(angle), z};
}

Part blob(const char* name, const Vec3d& centre, double radius) { return {name, centre, centre, radius}; }

Part tube(const char* name, const Vec3d& a, const Vec3d& b, double radius) { return {name, a, b, radius}; }

void append(Parts& parts, const Parts& more) { parts.insert(parts.end(), more.begin(), more.end()); }

/// The n copies of `unit` turned about z.
Parts cyclic(const Parts& unit, int n) {
    Parts parts;
    for (int k = 0; k < n; ++k) {
        const Eigen::AngleAxisd turn(2 * pi * k / n, Vec3d::UnitZ());
        for (const Part& part : unit) parts.push_back({part.name, turn * part.a, turn * part.b, part.radius});
    }
    return parts;
}

// T4 baseplate, dome form (Kostyuchenko et al. 2003; Taylor et al. 2016): 520-610 Å wide, 270 Å high, a hub
// with the cell-puncturing needle, six wedges, six short tail fibres of 340 Å folded along the rim, and the
// first rings of the tail tube (90 Å wide, rings 40 Å apart, each turned by 18°).
Parts baseplate() {
    Parts unit;
    for (int ring = 0; ring < 3; ++ring)
        unit.push_back(blob("tube", at(34, 18.0 * ring, 62 + 40.0 * ring), 19));
    append(unit, {blob("hub", at(27, 18, 22), 20), blob("hub", at(30, 48, -16), 20),
                  tube("hub", at(24, 0, -30), at(12, 20, -62), 13)});
    append(unit, {// inner dome: a ring around the hub, and its spokes to the wedges
                  blob("wedge", at(74, -14, 48), 20), blob("wedge", at(74, 14, 40), 20),
                  tube("wedge", at(40, 0, 40), at(80, 0, 50), 11),
                  // the wedge: two bent arms from the dome to the rim
                  tube("wedge", at(86, -12, 44), at(140, -14, 22), 17),
                  tube("wedge", at(86, 12, 38), at(145, 10, 12), 17),
                  tube("wedge", at(140, -14, 22), at(205, -4, -30), 17),
                  tube("wedge", at(145, 10, 12), at(205, 4, -36), 15),
                  // a zigzag that joins the wedges
                  tube("wedge", at(145, 10, 12), at(165, 30, -18), 13),
                  tube("wedge", at(165, 30, -18), at(140, 46, 22), 13), blob("wedge", at(172, 28, -26), 22),
                  blob("wedge", at(165, 35, -52), 18)});
    append(unit,
           {// the rim: a knot at each corner with a pin below it
            blob("pin", at(226, 0, -52), 27), blob("pin", at(238, 9, -78), 21),
            blob("pin", at(238, -9, -78), 21), tube("pin", at(232, 0, -70), at(212, 0, -122), 15),
            tube("pin", at(222, -5, -30), at(240, -8, 2), 14), blob("pin", at(246, -8, 12), 17),
            // the short tail fibre, laid along the rim to the next corner
            tube("fibre", at(250, 4, -88), at(228, 22, -96), 11),
            tube("fibre", at(228, 22, -96), at(214, 38, -98), 11),
            tube("fibre", at(214, 38, -98), at(208, 52, -112), 11), blob("fibre", at(206, 54, -116), 18)});
    Parts parts = cyclic(unit, 6);
    append(parts, {tube("hub", {0, 0, -50}, {0, 0, -118}, 17), tube("hub", {0, 0, -118}, {0, 0, -148}, 9)});
    return parts;
}

// Microtubule: 13 protofilaments, left-handed 3-start helix of monomers, so that neighbours are shifted by
// 3 · 41 / 13 = 9.4 Å and one turn comes back 1.5 dimers too high: the seam. Outer diameter 250 Å, lumen 170
// Å, dimer repeat 82 Å (Nogales et al. 1999; Alushin et al. 2014). Beta carries a bump outside, as decorated
// microtubules do, which makes the dimer and the seam visible.
Parts microtubule() {
    constexpr int protofilaments = 13, monomers = 12;
    constexpr double repeat = 41, shift = 3 * repeat / protofilaments;
    Parts parts;
    for (int p = 0; p < protofilaments; ++p) {
        const double angle = -360.0 * p / protofilaments;
        // as many dimers further down as the helix has risen: the ends are as level as dimers allow
        const int first = -2 * static_cast<int>(std::lround(shift * p / (2 * repeat)));
        for (int m = first; m < first + monomers; ++m) {
            const bool beta = m % 2 != 0;
            const char* name = beta ? "beta" : "alpha";
            const double z = repeat * m + shift * p;
            append(parts, {blob(name, at(102, angle, z), 17), blob(name, at(108, angle + 5, z + 9), 12),
                           blob(name, at(108, angle - 5, z - 9), 12),
                           tube(name, at(94, angle - 4, z - 4), at(97, angle - 15, z - 2), 8),
                           tube(name, at(119, angle + 2, z - 10), at(119, angle - 1, z + 10), 8)});
            if (beta) parts.push_back(blob(name, at(129, angle - 1, z), 13));
        }
    }
    return parts;
}

struct Capsomer {
    Vec3d centre;
    int fold;
};

/// The capsomers of the head of phi29: an icosahedron drawn out along a five-fold axis, caps T = 3, middle
/// Q = 5: 12 pentamers and 30 hexamers; the flat faces are then inflated half-way to an ellipsoid.
std::vector<Capsomer> head_capsomers() {
    // Edge vectors of the caps (1,1) and of the middle triangles (-2,3) on a triangular lattice: the middle
    // ones are 5/3 times as high, and hold lattice points at barycentric (2/5, 2/5, 1/5) and (1/5, 1/5, 3/5).
    const double ring = 196, ring_z = 0.843 * ring, apex_z = ring_z + 0.618 * ring;
    std::vector<Capsomer> capsomers = {{{0, 0, apex_z}, 5}, {{0, 0, -apex_z}, 5}};
    for (int k = 0; k < 5; ++k) {
        for (const int side : {1, -1}) {
            const double angle = 72.0 * k + (side > 0 ? 0 : 36);
            const Vec3d a = at(ring, angle, side * ring_z), b = at(ring, angle + 72, side * ring_z),
                        c = at(ring, angle + 36, -side * ring_z), apex(0, 0, side * apex_z);
            capsomers.push_back({a, 5});
            capsomers.push_back({(a + b + apex) / 3, 6});
            capsomers.push_back({0.4 * a + 0.4 * b + 0.2 * c, 6});
            capsomers.push_back({0.2 * a + 0.2 * b + 0.6 * c, 6});
        }
    }
    const Vec3d axes(208, 208, 262);
    for (Capsomer& capsomer : capsomers) {
        const Vec3d p = capsomer.centre;
        capsomer.centre = 0.45 * p + 0.55 * p / p.cwiseQuotient(axes).norm();
    }
    return capsomers;
}

/// The nearest `fold` neighbours of a capsomer, in turn around it.
std::vector<Vec3d> neighbours_in_turn(const std::vector<Capsomer>& all, const Capsomer& capsomer) {
    std::vector<std::pair<double, Vec3d>> near;
    for (const Capsomer& other : all)
        near.emplace_back((other.centre - capsomer.centre).squaredNorm(), other.centre);
    const auto closer = [](const auto& a, const auto& b) { return a.first < b.first; };
    std::sort(near.begin(), near.end(), closer);
    const Vec3d normal = capsomer.centre.normalized();
    const Vec3d u = normal.unitOrthogonal(), v = normal.cross(u);
    std::vector<std::pair<double, Vec3d>> turn;
    for (int k = 1; k <= capsomer.fold; ++k) {
        const Vec3d& p = near[static_cast<std::size_t>(k)].second;
        turn.emplace_back(std::atan2((p - capsomer.centre).dot(v), (p - capsomer.centre).dot(u)), p);
    }
    std::sort(turn.begin(), turn.end(), closer);
    std::vector<Vec3d> points;
    for (const auto& [angle, p] : turn) points.push_back(p);
    return points;
}

/// Capsomers as raised rings of subunits on a thin wall, and fibres where three hexamers meet.
Parts head() {
    const std::vector<Capsomer> capsomers = head_capsomers();
    Parts parts;
    for (const Capsomer& capsomer : capsomers) {
        const Vec3d& c = capsomer.centre;
        const bool portal = c.z() < 0 && c.head<2>().norm() < 1e-9;
        if (portal) continue;  // the connector takes the place of this pentamer
        const std::vector<Vec3d> around = neighbours_in_turn(capsomers, capsomer);
        for (std::size_t k = 0; k < around.size(); ++k) {
            const Vec3d& n = around[k];
            const Vec3d& next = around[(k + 1) % around.size()];
            const Vec3d out = c.normalized(), corner = (c + n + next) / 3;
            append(parts,
                   {tube("capsid", c + 0.27 * (n - c) + 18 * out, c + 0.27 * (next - c) + 18 * out, 10),
                    blob("capsid", c + 0.29 * (n - c) + 22 * out, 13.5),
                    tube("capsid", c + 0.15 * (corner - c) - 4 * out, corner - 6 * out, 12),
                    tube("capsid", c + 0.2 * (n - c) - 4 * out, c + 0.5 * (n - c) - 6 * out, 12)});
        }
    }
    for (std::size_t i = 0; i < capsomers.size(); ++i) {
        if (capsomers[i].fold != 6) continue;
        const std::vector<Vec3d> around = neighbours_in_turn(capsomers, capsomers[i]);
        for (std::size_t k = 0; k < around.size(); ++k) {
            const Vec3d corner = (capsomers[i].centre + around[k] + around[(k + 1) % around.size()]) / 3;
            int hexamers = 0, before = 0;
            for (std::size_t j = 0; j < capsomers.size(); ++j) {
                const bool here = capsomers[j].fold == 6 && (capsomers[j].centre - corner).norm() < 100;
                hexamers += here;
                before += here && j < i;
            }
            if (hexamers < 3 || before > 0) continue;  // the corner belongs to the first of its hexamers
            const Vec3d out = corner.normalized();
            append(parts,
                   {tube("fibre", corner, corner + 85 * out, 10), blob("fibre", corner + 92 * out, 14)});
        }
    }
    return parts;
}

// Bacteriophage phi29 without its DNA: prolate head 540 Å long and 450 Å wide, capsid wall 30-40 Å; a 12-fold
// connector, the lower collar with 12 appendages, and a tail of 380 Å with a knob (Tao et al. 1998; Xiang et
// al. 2006).
Parts virus() {
    Parts parts = head();
    const Parts twelfth = {blob("connector", at(58, 0, -215), 17),
                           tube("connector", at(50, 4, -228), at(36, 10, -270), 12),
                           tube("collar", at(36, 10, -270), at(40, 15, -300), 12),
                           blob("collar", at(62, 0, -296), 16),
                           tube("appendage", at(66, 0, -300), at(104, 6, -312), 9),
                           tube("appendage", at(104, 6, -312), at(112, 9, -366), 13),
                           blob("appendage", at(112, 10, -372), 17)};
    append(parts, cyclic(twelfth, 12));
    Parts sixth;
    for (int ring = 0; ring < 8; ++ring)
        sixth.push_back(blob("tail", at(27, 30.0 * (ring % 2), -322 - 30.0 * ring), 17));
    append(sixth, {tube("tail", at(30, 0, -560), at(44, 10, -610), 15),
                   tube("tail", at(44, 10, -610), at(24, 24, -660), 15)});
    append(parts, cyclic(sixth, 6));
    return parts;
}

// V-ATPase (Muench et al. 2009; Zhao et al. 2015): A3B3 head 130 Å wide and 100 Å high, central shaft, three
// peripheral stalks, collar, membrane ring of ten c subunits beside subunit a; 250 Å high in all.
Parts atpase() {
    const Parts third = {
        // A, with the bulge near the top that stands out in every map; B
        tube("head", at(42, 0, 40), at(46, 0, 78), 20), tube("head", at(46, 0, 78), at(40, 0, 108), 17),
        tube("head", at(62, -4, 84), at(68, -8, 100), 14), tube("head", at(42, 60, 44), at(44, 60, 80), 20),
        tube("head", at(44, 60, 80), at(38, 60, 114), 16),
        // the peripheral stalk, in the groove between A and B
        tube("stalk", at(56, 32, 128), at(68, 32, 104), 9),
        tube("stalk", at(68, 32, 104), at(72, 34, 50), 7.5),
        tube("stalk", at(72, 34, 50), at(66, 44, 4), 7.5), tube("stalk", at(66, 44, 4), at(58, 50, -14), 9)};
    Parts parts = cyclic(third, 3);
    append(parts, {// central shaft D, F and its foot d on the ring
                   tube("shaft", {0, 0, 84}, {3, 0, -20}, 10), blob("shaft", {12, 4, 8}, 14),
                   blob("shaft", {2, 0, -34}, 22), blob("shaft", {16, -10, -42}, 16),
                   // collar: C and H and the near part of a join the stalks, off the axis
                   tube("collar", at(60, 48, -12), at(52, 110, -4), 12),
                   tube("collar", at(52, 110, -4), at(60, 168, -12), 12),
                   tube("collar", at(60, 168, -12), at(50, 228, -16), 13),
                   tube("collar", at(50, 228, -16), at(60, 288, -12), 13),
                   tube("collar", at(60, 288, -12), at(62, 325, -40), 13),
                   tube("collar", at(62, 325, -40), at(62, 340, -66), 13)});
    append(parts, cyclic({tube("ring", at(38, 0, -62), at(36, 0, -126), 9),
                          tube("ring", at(25, 18, -66), at(25, 18, -122), 8)},
                         10));
    for (int helix = 0; helix < 5; ++helix)
        append(parts,
               {tube("subunit a", at(62, 310 + 14.0 * helix, -66), at(58, 306 + 14.0 * helix, -118), 10),
                tube("subunit a", at(76, 316 + 11.0 * helix, -72), at(73, 318 + 11.0 * helix, -112), 9)});
    return parts;
}

// Type III secretion needle complex of Shigella (Hodgkinson et al. 2009): twelve-fold base 320 Å high, inner
// rings 240-260 Å and outer rings 150-200 Å wide, a neck between, an inner rod, and the needle 70 Å wide, a
// helix of 5.6 subunits a turn and pitch 24 Å around a channel.
Parts needle_complex() {
    const Parts unit = {
        // inner membrane rings, lower and upper: lobes, closed to a ring, and what joins them
        blob("base", at(94, 0, -148), 17), tube("base", at(78, 0, -150), at(78, 30, -150), 11),
        tube("base", at(94, 0, -146), at(98, 6, -100), 8.5), tube("base", at(70, 0, -146), at(68, 6, -96), 9),
        blob("base", at(112, 6, -92), 18), tube("base", at(96, 6, -92), at(96, 36, -92), 13),
        tube("base", at(92, 2, -84), at(66, -4, -64), 12),
        // neck
        tube("base", at(66, -4, -64), at(51, -4, -34), 12),
        tube("base", at(51, -4, -34), at(53, 0, 14), 11.5),
        // outer membrane rings
        tube("base", at(53, 0, 14), at(70, 4, 40), 11), blob("base", at(91, 6, 52), 16),
        tube("base", at(78, 6, 52), at(78, 36, 52), 12), tube("base", at(76, 6, 56), at(66, 10, 92), 9.5),
        blob("base", at(77, 12, 102), 14), tube("base", at(66, 12, 102), at(66, 42, 102), 11),
        tube("base", at(62, 12, 106), at(51, 14, 130), 10),
        tube("base", at(49, 14, 136), at(49, 44, 136), 11),
        // socket and inner rod
        tube("base", at(33, 0, -64), at(31, 12, -24), 9), blob("base", at(34, 6, -70), 13)};
    Parts parts = cyclic(unit, 12);
    constexpr double turn = 360 / 5.6, rise = 24 / 5.6;
    for (int k = 0; - 40 + rise * k < 400; ++k) {
        const double z = -40 + rise * k, angle = turn * k;
        parts.push_back(tube("needle", at(20, angle, z), at(27, angle + 8, z + 9), 9.5));
    }
    return parts;
}

/// The 36 vertices of the hexagonal barrel and, for each, its three neighbours counter-clockwise seen from
/// outside. Rings of six from the top: 0, 1 (below the corners of ring 0), 2 (between), and their mirror
/// images 3, 4, 5; edges of equal length, faces nearly flat.
struct Barrel {
    std::vector<Vec3d> vertices;
    std::vector<std::array<std::size_t, 3>> neighbours;
};

Barrel hexagonal_barrel(double edge) {
    const double r1 = 1.63, r2 = 1.77;  // rings 1 and 2, in edges; ring 0 has radius 1
    const double z2 = 0.5, z1 = z2 + std::sqrt(1 - (r1 * r1 + r2 * r2 - std::sqrt(3.0) * r1 * r2)),
                 z0 = z1 + std::sqrt(1 - (r1 - 1) * (r1 - 1));
    const std::array<double, 6> radius = {1, r1, r2, r2, r1, 1}, height = {z0, z1, z2, -z2, -z1, -z0},
                                phase = {0, 0, 30, 30, 0, 0};
    Barrel barrel;
    for (std::size_t ring = 0; ring < 6; ++ring)
        for (int k = 0; k < 6; ++k)
            barrel.vertices.push_back(edge * at(radius[ring], phase[ring] + 60.0 * k, height[ring]));
    for (std::size_t i = 0; i < barrel.vertices.size(); ++i) {
        const Vec3d& p = barrel.vertices[i];
        const Vec3d u = p.unitOrthogonal(), v = p.normalized().cross(u);
        std::vector<std::pair<double, std::size_t>> around;
        for (std::size_t j = 0; j < barrel.vertices.size(); ++j) {
            const Vec3d d = barrel.vertices[j] - p;
            if (j != i && d.norm() < 1.01 * edge) around.emplace_back(std::atan2(d.dot(v), d.dot(u)), j);
        }
        std::sort(around.begin(), around.end());
        barrel.neighbours.push_back({around.at(0).second, around.at(1).second, around.at(2).second});
    }
    return barrel;
}

// Clathrin coat, the D6 barrel of 36 triskelia (Fotin et al. 2004): about 700 Å across, edges 185 Å. A leg
// runs from its hub along an edge (proximal), bends at the knee and goes on along the next edge, deeper
// (distal), then turns inwards (linker and terminal domain, 100-150 Å below). Each edge carries four legs.
Parts clathrin_cage() {
    const Barrel barrel = hexagonal_barrel(172);
    Parts parts;
    for (std::size_t i = 0; i < barrel.vertices.size(); ++i) {
        const Vec3d& hub = barrel.vertices[i];
        const Vec3d out = hub.normalized();
        parts.push_back(tube("hub", hub + 8 * out, hub - 22 * out, 17));
        for (const std::size_t j : barrel.neighbours[i]) {
            const Vec3d& knee = barrel.vertices[j];
            const auto& ways = barrel.neighbours[j];
            const auto back = static_cast<std::size_t>(std::find(ways.begin(), ways.end(), i) - ways.begin());
            const Vec3d& ankle = barrel.vertices[ways[(back + 1) % 3]];
            const Vec3d knee_out = knee.normalized(), ankle_out = ankle.normalized();
            // a leg keeps to one side of its edge, so that the legs of both ends lie beside each other
            const Vec3d side = 11 * (hub + knee).normalized().cross((knee - hub).normalized());
            const Vec3d side2 = 11 * (knee + ankle).normalized().cross((ankle - knee).normalized());
            const Vec3d bend = knee - 14 * knee_out + 0.1 * (hub - knee) + side;
            const Vec3d foot = knee + 0.8 * (ankle - knee) - 34 * ankle_out + side2;
            append(parts, {tube("leg", hub + 2 * out, hub + 0.5 * (knee - hub) + side + 4 * out, 12),
                           tube("leg", hub + 0.5 * (knee - hub) + side + 4 * out, bend, 12),
                           tube("leg", bend, knee + 0.25 * (ankle - knee) - 24 * knee_out + side2, 12),
                           tube("leg", knee + 0.25 * (ankle - knee) - 24 * knee_out + side2, foot, 11),
                           tube("terminal", foot, foot - 44 * ankle_out - 0.12 * (ankle - knee), 8.5),
                           blob("terminal", foot - 62 * ankle_out - 0.15 * (ankle - knee), 19)});
        }
    }
    return parts;
}

using Builder = Parts (*)();

const std::vector<std::pair<PhantomKind, Builder>>& builders() {
    static const std::vector<std::pair<PhantomKind, Builder>> table = {
        {{"baseplate",
          "bacteriophage T4 baseplate: dome, hub and needle, six wedges and short tail fibres (C6)"},
         baseplate},
        {{"microtubule", "13 protofilaments of tubulin dimers (82 Å) on a 3-start helix, with its seam"},
         microtubule},
        {{"virus",
          "bacteriophage phi29: prolate head (T = 3, Q = 5) with fibres, connector, collar and tail"},
         virus},
        {{"atpase", "V-ATPase: A3B3 head, central shaft, three peripheral stalks, collar and ten-fold ring"},
         atpase},
        {{"needle-complex", "type III secretion system: twelve-fold rings of the base, and a helical needle"},
         needle_complex},
        {{"clathrin-cage", "clathrin coat: hexagonal barrel of 36 triskelia (D6)"}, clathrin_cage}};
    return table;
}

/// Shifts the parts along z so that their box is centred; x and y stay, for the sake of the axis.
void centre_along_axis(Parts& parts) {
    double low = parts.front().a.z(), high = low;
    for (const Part& part : parts) {
        low = std::min(low, std::min(part.a.z(), part.b.z()) - part.radius);
        high = std::max(high, std::max(part.a.z(), part.b.z()) + part.radius);
    }
    for (Part& part : parts)
        for (Vec3d* p : {&part.a, &part.b}) p->z() -= (low + high) / 2;
}

}  // namespace

const std::vector<PhantomKind>& specimen_kinds() {
    static const std::vector<PhantomKind> kinds = [] {
        std::vector<PhantomKind> list;
        for (const auto& [kind, builder] : builders()) list.push_back(kind);
        return list;
    }();
    return kinds;
}

std::vector<Part> specimen_parts(const std::string& kind) {
    for (const auto& [entry, builder] : builders()) {
        if (entry.name != kind) continue;
        Parts parts = builder();
        centre_along_axis(parts);
        return parts;
    }
    throw InvalidInput("phantom: there is no specimen \"" + kind + "\"");
}

double parts_extent(const std::vector<Part>& parts) {
    double reach = 0;
    for (const Part& part : parts)
        reach = std::max(
            {reach, part.a.cwiseAbs().maxCoeff() + part.radius, part.b.cwiseAbs().maxCoeff() + part.radius});
    return 2 * reach;
}

}  // namespace vdbgeo
