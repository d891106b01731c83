#include "apps/report_glossary.h"

#include <fmt/format.h>

#include <unordered_map>

namespace vdbgeo::app {
namespace {

using Words = std::unordered_map<std::string, KeyWords>;

/// Maps and grids.
const Words& map_words() {
    static const Words words{
        {"size", {"Size of the map", "voxels", "Number of samples along x, y and z."}},
        {"nx", {"Samples along x", "voxels", ""}},
        {"ny", {"Samples along y", "voxels", ""}},
        {"nz", {"Samples along z", "voxels", ""}},
        {"voxel_size_A", {"Voxel size", "Å", "Distance between neighbouring samples along x, y and z."}},
        {"origin_A", {"Origin", "Å", "Where the first sample lies in the world."}},
        {"origin_rule", {"Origin taken from", "", "Which entry of the file's header told the origin."}},
        {"mode", {"MRC mode", "", "How the numbers are stored in the map file."}},
        {"min", {"Least value", "", "In the map's own units."}},
        {"max", {"Greatest value", "", "In the map's own units."}},
        {"mean", {"Mean", "", "The average."}},
        {"rms", {"Standard deviation", "", "How far values typically are from the mean (rms)."}},
        {"median", {"Median", "", "Half of it lies below."}},
        {"p05", {"5th percentile", "", "5 % of it lie below."}},
        {"p95", {"95th percentile", "", "95 % of it lie below."}},
        {"name", {"Name", "", ""}},
        {"class", {"Kind of grid", "", "What the grid's values stand for."}},
        {"active_voxels",
         {"Voxels kept", "", "Samples that the sparse grid holds; others read as the background."}},
        {"leaves", {"Blocks of the grid", "", "Blocks of 8 × 8 × 8 voxels that the sparse grid holds."}},
        {"bytes_in_memory", {"Memory of the sparse grid", "bytes", ""}},
        {"dense_bytes",
         {"Memory of the full map", "bytes", "What the same map takes without a sparse grid."}},
        {"bytes", {"Size of the file", "bytes", ""}},
        {"background", {"Background", "", "The value of all places that are not kept, in the map's units."}},
        {"transform",
         {"Frame", "", "World position in Å = matrix · voxel number; the last column is the origin."}},
        {"active_box_min", {"First voxel kept", "voxels", "Along x, y and z."}},
        {"active_box_max", {"Last voxel kept", "voxels", "Along x, y and z."}},
        {"space_group", {"Space group", "", "As the file's header tells it."}},
        {"quantisation", {"Rounding", "", "Densities are stored as multiples of a step."}},
        {"step", {"Step", "", ""}},
        {"largest_error", {"Largest error", "", "In the map's units."}},
        {"count", {"Samples", "", "How many numbers were looked at."}},
        {"non_finite",
         {"Samples that are no numbers", "", "NaN and infinities, left out of everything else."}},
        {"non_finite_samples",
         {"Samples that are no numbers", "", "NaN and infinities, left out of everything else."}},
        {"sigma_above_mean", {"Isovalue above the mean", "standard deviations", ""}}};
    return words;
}

const Words& denoising_words() {
    static const Words words{
        {"method", {"Method", "", "The algorithm that was used."}},
        {"order", {"Order", "", "0 is ordinary diffusion; higher orders smooth noise and spare shapes."}},
        {"diffusivity", {"Diffusivity", "", "How fast differences even out, in voxels and steps of time."}},
        {"sigma",
         {"Where edges are kept", "",
          "How the program tells an edge from noise: by one number for the whole map or by place."}},
        {"stepper", {"Time stepping", "", "How the equation is solved in time."}},
        {"fidelity", {"Fidelity", "", "How strongly the result is held to the input; 0: not at all."}},
        {"automatic",
         {"Chosen by the program", "", "Whether the amount of smoothing was found from the map itself."}},
        {"noise",
         {"Noise found", "", "Standard deviation of the noise that was estimated, in the map's units."}},
        {"dt", {"Time step", "", "Length of a step, in voxels."}},
        {"steps", {"Steps", "", "How many time steps were made."}},
        {"cycles", {"Cycles", "", "Rounds of time steps of varying length."}},
        {"time", {"Diffusion time", "", "How long noise was let to even out, in voxels."}},
        {"mean_before", {"Mean before", "", "In the map's units."}},
        {"mean_after", {"Mean after", "", "In the map's units; the same as before, since nothing is added."}},
        {"removed", {"Removed", "", "Root mean square of what was taken away, in the map's units."}},
        {"state_bytes", {"Memory at work", "bytes", ""}},
        {"blur", {"Width of the blur", "voxels", ""}},
        {"range", {"Range", "", "Differences beyond this count as edges, in the map's units."}},
        {"radius", {"Radius", "voxels", ""}}};
    return words;
}

const Words& surface_words() {
    static const Words words{
        {"iso", {"Isovalue", "", "The density at which the surface lies, in the map's units."}},
        {"iso_rule", {"Isovalue asked for", "", "A number, or the rule by which it was found."}},
        {"vertices", {"Vertices", "", "Corner points of the mesh."}},
        {"faces", {"Triangles", "", "Faces of the surface mesh."}},
        {"vertices_before", {"Vertices before", "", ""}},
        {"faces_before", {"Triangles before", "", ""}},
        {"components",
         {"Pieces", "", "Parts of the surface that hang together; walls of cavities count too."}},
        {"genus",
         {"Genus", "", "Tunnels through the surface: 0 for a ball, 1 for a ring, all pieces together."}},
        {"closed", {"Closed", "", "Whether the surface has an inside and an outside everywhere."}},
        {"open_at_map_border",
         {"Open at the map's border", "",
          "Whether the density runs into the border of the map, where the surface ends."}},
        {"boundary_edges",
         {"Open edges", "", "Edges with a triangle on one side only; 0 for a closed surface."}},
        {"holes", {"Holes", "", "Closed lines of open edges."}},
        {"area_A2", {"Area", "Å²", "Of the surface; flat caps at the map's border do not count."}},
        {"volume_A3", {"Volume", "Å³", "What the surface or the tetrahedra enclose; 1 nm³ is 1,000 Å³."}},
        {"cap_area_A2",
         {"Area of caps", "Å²", "Flat faces that close the surface at the border of the map."}},
        {"min_angle_deg", {"Smallest angle", "°", "Of all triangles; 60° is ideal, near 0° is a needle."}},
        {"max_angle_deg", {"Largest angle", "°", "Of all triangles."}},
        {"mean_angle_deg", {"Mean angle", "°", "Always 60° for triangles."}},
        {"below_30_percent", {"Angles below 30°", "%", "Share of thin angles; few is good."}},
        {"radius_edge_max",
         {"Radius-edge ratio, largest", "",
          "Radius of the circle or ball through an element's corners, over its shortest edge; small is "
          "good."}},
        {"radius_edge_mean",
         {"Radius-edge ratio, mean", "", "0.577 is ideal for triangles, 0.612 for tetrahedra."}},
        {"euler_characteristic",
         {"Euler characteristic", "",
          "Vertices − edges + triangles: 2 for each ball, 2 less for each tunnel."}},
        {"manifold", {"Manifold", "", "Whether the surface is like a sheet at every point."}},
        {"oriented", {"Oriented", "", "Whether all triangles agree on what is outside."}},
        {"duplicate_faces", {"Duplicate triangles", "", "0 for a sound mesh."}},
        {"misoriented_edges", {"Edges between triangles that disagree", "", "0 for a sound mesh."}},
        {"non_manifold_edges", {"Edges with more than two triangles", "", "0 for a sound mesh."}},
        {"non_manifold_vertices", {"Points where sheets touch", "", "0 for a sound mesh."}},
        {"degenerate_faces", {"Triangles without area", "", "0 for a sound mesh."}},
        {"unused_vertices", {"Vertices without a triangle", "", ""}},
        {"length_A", {"Length of edges aimed at", "Å", ""}},
        {"hausdorff_A",
         {"Largest distance to what it was made from", "Å",
          "No point of one surface is further than this from the other (Hausdorff distance)."}},
        {"distance_to_result", {"Distance, old surface to new", "Å", ""}},
        {"distance_to_input", {"Distance, new surface to old", "Å", ""}},
        {"distance_to_boundary", {"Distance, surface to tetrahedra", "Å", ""}},
        {"distance_to_surface", {"Distance, tetrahedra to surface", "Å", ""}},
        {"max_A", {"Largest", "Å", ""}},
        {"mean_A", {"Mean", "Å", ""}},
        {"rms_A", {"Root mean square", "Å", ""}},
        {"p999_A", {"99.9 % within", "Å", ""}},
        {"angle_histogram",
         {"Angles by whole degrees", "angles a degree",
          "How many angles of triangles there are from 0° to 180°."}},
        {"pieces", {"Pieces", "", "Parts of the surface that hang together."}}};
    return words;
}

const Words& curvature_words() {
    static const Words words{
        {"scale_voxels",
         {"Scale", "voxels",
          "Width of the blur through which the density is seen: finer shapes do not count."}},
        {"radius_A",
         {"Size of the neighbourhood", "Å", "Curvature is that of the surface within this distance."}},
        {"undefined", {"Vertices without a curvature", "", ""}},
        {"border_vertices", {"Vertices at the border", "", "Seen from one side only: less exact."}},
        {"cap_vertices", {"Vertices on caps", "", "No part of the specimen."}},
        {"integral_K",
         {"Total Gaussian curvature", "",
          "4π for each ball and 4π less for each tunnel, of an exact surface (Gauss–Bonnet)."}},
        {"integral_H2",
         {"Bending (Willmore) energy", "",
          "Integral of H² over the area: 4π for a ball, more for anything else."}},
        {"flatness_per_A",
         {"Flat up to", "1/Å", "Principal curvatures up to this count as 0 for the types of surface."}},
        {"H_per_A", {"Mean curvature H", "1/Å", "Positive on bumps, negative in pits."}},
        {"K_per_A2", {"Gaussian curvature K", "1/Å²", "Positive on bumps and in pits, negative on saddles."}},
        {"k1_per_A",
         {"Largest curvature k1", "1/Å", "The bend in the direction in which the surface bulges most."}},
        {"k2_per_A",
         {"Smallest curvature k2", "1/Å",
          "The bend in the direction in which it bulges least; negative where it is hollow."}},
        {"shape_index", {"Shape index", "", "−1 peak, −½ ridge, 0 saddle, ½ valley, 1 pit."}},
        {"curvedness_per_A",
         {"Curvedness", "1/Å", "How strongly it bends, whatever the shape; 1/radius for a ball."}},
        {"area_by_type_A2", {"Area", "Å²", "By the type of surface: the signs of K and H."}},
        {"peak", {"Peak", "", "Bulges in all directions."}},
        {"ridge", {"Ridge", "", "Bulges in one direction, straight in the other."}},
        {"saddle_ridge", {"Saddle ridge", "", "A saddle that bulges more than it is hollow."}},
        {"flat", {"Flat", "", ""}},
        {"minimal_surface", {"Minimal surface", "", "A saddle as hollow as it bulges."}},
        {"pit", {"Pit", "", "Hollow in all directions."}},
        {"valley", {"Valley", "", "Hollow in one direction, straight in the other."}},
        {"saddle_valley", {"Saddle valley", "", "A saddle that is more hollow than it bulges."}},
        {"sampled", {"Sampled", "", "Values of another map at the surface."}}};
    return words;
}

const Words& pocket_words() {
    static const Words words{
        {"curvature", {"Curvature", "", "Whether it was taken from the file or computed for this."}},
        {"kind", {"Kind", "", "Pockets bend inward, protrusions outward."}},
        {"threshold_per_A", {"Bound on k2 (protrusions: k1)", "1/Å", "A pocket is where k2 is below this."}},
        {"k1_below_per_A", {"Bound on k1", "1/Å", "and k1 is not above this."}},
        {"min_area_A2", {"Least area", "Å²", "Smaller patches are taken for roughness."}},
        {"min_persistence_per_A",
         {"Least depth of a saddle between two", "1/Å",
          "Patches that are less apart in curvature count as one."}},
        {"depth_below",
         {"Depth is measured below", "",
          "The convex hull (a sheet tight around the specimen), or a ball that rolls over it."}},
        {"ambient_radius_A", {"Radius of the ball", "Å", "Not given where depth is measured from the hull."}},
        {"pockets", {"Pockets", "", "Patches found."}},
        {"protrusions", {"Protrusions", "", "Patches found."}},
        {"surface_area_A2", {"Area of the whole surface", "Å²", ""}}};
    return words;
}

const Words& tet_words() {
    static const Words words{
        {"tets", {"Tetrahedra", "", "Solid elements, with four corners each, that fill the specimen."}},
        {"boundary_faces", {"Triangles on the boundary", "", ""}},
        {"min_dihedral_deg",
         {"Smallest dihedral angle", "°",
          "Angle between two faces of a tetrahedron; simulations suffer below some 10°."}},
        {"max_dihedral_deg", {"Largest dihedral angle", "°", "Simulations suffer above some 165°."}},
        {"mean_min_dihedral_deg",
         {"Smallest dihedral angle, mean over the tetrahedra", "°",
          "70.5° is that of the regular tetrahedron."}},
        {"min_dihedral_p01_deg",
         {"Smallest dihedral angle, 1st percentile", "°", "1 % of the tetrahedra have a smaller one."}},
        {"slivers", {"Slivers", "", "Tetrahedra with an angle below 5° or above 175°; 0 is good."}},
        {"inverted", {"Turned over", "", "Tetrahedra of no or negative volume; 0 is good."}},
        {"min_tet_volume_A3", {"Smallest tetrahedron", "Å³", ""}},
        {"max_tet_volume_A3", {"Largest tetrahedron", "Å³", ""}},
        {"mean_edge_A", {"Mean edge", "Å", ""}},
        {"min_edge_A", {"Shortest edge", "Å", ""}},
        {"max_edge_A", {"Longest edge", "Å", ""}},
        {"regions", {"Region", "", ""}},
        {"region", {"Number", "", ""}},
        {"surface_volume_A3", {"Volume inside the surface", "Å³", "What the tetrahedra should fill."}},
        {"volume_error",
         {"Error of the volume", "", "Part by which the tetrahedra's volume differs from it; 0.01 is 1 %."}},
        {"optimize", {"Improvement of the tetrahedra", "", ""}},
        {"rounds", {"Rounds", "", ""}},
        {"moves", {"Points moved", "", ""}},
        {"flips", {"Tetrahedra exchanged", "", ""}},
        {"outside_before", {"Bad tetrahedra before", "", "With an angle outside of what was asked for."}},
        {"outside_after", {"Bad tetrahedra after", "", "With an angle outside of what was asked for."}},
        {"peak_bytes", {"Memory, at most", "bytes", ""}},
        {"seconds", {"Time", "s", ""}},
        {"read", {"Reading", "", ""}},
        {"compute", {"Computing", "", ""}},
        {"write", {"Writing", "", ""}}};
    return words;
}

}  // namespace

const KeyWords* find_words(const std::string& key) {
    for (const Words* words : {&surface_words(), &map_words(), &curvature_words(), &tet_words(),
                               &pocket_words(), &denoising_words()}) {
        const auto found = words->find(key);
        if (found != words->end()) return &found->second;
    }
    return nullptr;
}

PageTerms glossary() {
    return {{"Density map",
             "A box of numbers from an electron microscope: how much matter there is at each place."},
            {"Voxel",
             "One place of the map, a small box; its size is the distance between neighbouring samples."},
            {"Å", "Ångström, 10⁻¹⁰ m; about the size of an atom. 10 Å are 1 nm."},
            {"Isovalue", "The density at which the surface is drawn; denser places are inside."},
            {"Principal curvatures k1, k2",
             "How much the surface bends in the direction in which it bulges most (k1) and least (k2): "
             "1/radius, negative where it is hollow."},
            {"Mean curvature H", "The average of k1 and k2: positive on bumps, negative in pits."},
            {"Gaussian curvature K",
             "k1 times k2: positive on bumps and in pits, negative on saddles, 0 where it is straight in one "
             "direction."},
            {"Shape index", "Only the kind of bend: −1 peak, −½ ridge, 0 saddle, ½ valley, 1 pit."},
            {"Curvedness", "Only the strength of the bend, √((k1² + k2²)/2)."},
            {"Pocket",
             "A patch of the surface that bends inward, where a small molecule may bind; its depth is "
             "measured below a sheet that is tight around the specimen (the convex hull) or below a ball "
             "that rolls over it."},
            {"Mouth", "The line around a pocket; its area is that of the opening."},
            {"Tetrahedron",
             "A solid with four corners and four faces. Simulations need the inside cut into such pieces."},
            {"Dihedral angle",
             "The angle between two faces of a tetrahedron. Very small and very large ones make simulations "
             "inexact; the regular tetrahedron has 70.5°."},
            {"Genus", "How many tunnels go through: 0 for a ball, 1 for a ring."},
            {"Closed, manifold",
             "A surface without holes that is like a sheet everywhere: only such a one has a volume."},
            {"Hausdorff distance", "The largest distance from any point of one surface to the other."}};
}

PropertyWords property_words(const std::string& key) {
    static const std::unordered_map<std::string, PropertyWords> known{
        {"H",
         {"Mean curvature H", "1/Å", "Red where the surface bulges, blue where it is hollow.", "diverging"}},
        {"K", {"Gaussian curvature K", "1/Å²", "Red on bumps and in pits, blue on saddles.", "diverging"}},
        {"k1",
         {"Largest curvature k1", "1/Å", "The bend in the direction in which the surface bulges most.",
          "diverging"}},
        {"k2",
         {"Smallest curvature k2", "1/Å",
          "The bend in the direction in which it bulges least: blue is hollow.", "diverging"}},
        {"shape_index",
         {"Shape index", "", "Blue peaks, pale saddles, red pits: the kind of bend, whatever its strength.",
          "diverging"}},
        {"curvedness", {"Curvedness", "1/Å", "How strongly the surface bends, whatever the shape."}},
        {"type", {"Type of surface", "", "Eight kinds by the signs of K and H.", "categorical"}},
        {"pocket",
         {"Pockets", "",
          "Patches that bend inward; number 1 is the first by rank. Colours come again after eight.",
          "categorical"}},
        {"protrusion",
         {"Protrusions", "",
          "Patches that stick out; number 1 is the first by rank. Colours come again after eight.",
          "categorical"}},
        {"min_dihedral_deg",
         {"Smallest dihedral angle", "°", "Of each tetrahedron; small ones are bad for simulations."}}};
    const auto found = known.find(key);
    if (found != known.end()) return found->second;
    const KeyWords words = words_for(key);
    return {words.label, words.unit,
            words.help.empty() ? "A value that the mesh has at its vertices." : words.help};
}

const std::vector<FileWords>& plot_files() {
    static const std::vector<FileWords> files{
        {"density.svg", "Densities of the map",
         "How often each density occurs; the line marks the isovalue. Solvent and noise make the large hump, "
         "the specimen the tail on its right."},
        {"isovalues.svg", "The surface over the isovalue",
         "What volume, area and number of pieces would be at other isovalues. A good isovalue lies where "
         "they change slowly; many pieces are a sign of noise."},
        {"angles.svg", "Angles of the triangles",
         "The narrower the hump around 60°, the better the triangles: those of marching cubes are broad, "
         "those of the mesh used here should be narrow."},
        {"curvature.svg", "Curvature over the surface",
         "Which part of the area has which curvature: right of 0 the surface bulges, left of it it is "
         "hollow."},
        {"k1k2.svg", "The two curvatures together",
         "Each place of the surface by its largest (k1) and its smallest curvature (k2). Both positive: "
         "peaks; both negative: pits; in between: saddles."},
        {"dihedrals.svg", "Dihedral angles of the tetrahedra",
         "Good tetrahedra have angles around 70°. What reaches near 0° or 180° would trouble a simulation."}};
    return files;
}

const std::vector<FileWords>& picture_files() {
    static const std::vector<FileWords> files{
        {"map.png", "The surface of the map as it came",
         "The isosurface of the raw map, before noise was removed."},
        {"denoised.png", "The surface after noise removal",
         "The same isovalue; dust and roughness should be gone, shapes should not."},
        {"meshes.png", "Triangles before and after",
         "Lines are the edges of triangles: as marching cubes makes them, and well shaped as they are used "
         "here."},
        {"gaussian.png", "Gaussian curvature K", "Red on bumps and in pits, blue on saddles."},
        {"mean.png", "Mean curvature H", "Red where the surface bulges, blue where it is hollow."},
        {"k1.png", "Largest curvature k1",
         "Red where the surface bulges in some direction, blue where it is hollow in all."},
        {"k2.png", "Smallest curvature k2",
         "Blue where the surface is hollow in some direction: places where small molecules may bind."},
        {"pockets_picture.png", "Pockets",
         "Each coloured patch is a pocket; colours come again after eight."},
        {"cut.png", "The tetrahedra, cut open",
         "One half is taken away. Colours on the cut: the smallest dihedral angle of each tetrahedron, pale "
         "is good."},
        {"peel.png", "The tetrahedra, peeled",
         "Some tetrahedra are taken away from one place on, as if peeled. Colours: the smallest dihedral "
         "angle of each, pale is good."}};
    return files;
}

PageTerms citations(const std::string& version) {
    return {{"The program:", fmt::format("@software{{vdbgeo,\n  title   = {{vdbgeo: geometric modelling of "
                                         "cryo-EM maps and tomograms on OpenVDB}},\n"
                                         "  author  = {{{{The vdbgeo developers}}}},\n  version = {{{}}},\n  "
                                         "license = {{GPL-3.0-or-later}}\n}}",
                                         version)},
            {"The paper whose protocol it carries out, doi:10.1002/cnm.2532 :",
             "@article{FengXiaTongWei2012,\n  author  = {Feng, Xin and Xia, Kelin and Tong, Yiying and Wei, "
             "Guo-Wei},\n"
             "  title   = {Geometric modeling of subcellular structures, organelles, and multiprotein "
             "complexes},\n"
             "  journal = {International Journal for Numerical Methods in Biomedical Engineering},\n"
             "  year    = {2012},\n  volume  = {28},\n  number  = {12},\n  pages   = {1198--1223},\n"
             "  doi     = {10.1002/cnm.2532}\n}"}};
}

}  // namespace vdbgeo::app
