#include "apps/report_content.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "apps/build_info.h"
#include "apps/report_words.h"
#include "converters/mesh_file.h"
#include "converters/tet_file.h"
#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/view/png.h"
#include "vdbgeo/view/report_page.h"

namespace vdbgeo::app {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t pockets_shown = 50;
const std::string no_break = "\u00A0";

const char* plural(std::uint64_t n, const char* one, const char* more) { return n == 1 ? one : more; }

/// The first of these stages that has the number.
std::optional<double> number_of(const ReportFolder& folder, const std::vector<const char*>& stages,
                                const char* key) {
    for (const char* name : stages)
        if (const RunStage* s = folder.stage(name))
            if (const auto value = number_in(s->result, key)) return value;
    return {};
}

/// The main numbers, from the summary or from the surface itself.
struct Facts {
    std::string map_name, size, voxel;
    std::optional<double> isovalue, area_A2, volume_A3, pieces, tets;
    bool open = false;  ///< the surface has a border
};

/// "100 × 100 × 100" and "2.7"; empty where the summary has no such lists.
std::string times_text(const Json* list) {
    if (!list || !list->is_array() || list->size() != 3) return {};
    std::string text;
    for (const Json& v : *list) {
        if (!v.is_number()) return {};
        text += (text.empty() ? "" : " × ") + number_text(std::round(v.get<double>() * 1e6) / 1e6);
    }
    return text;
}

const Json* list_in(const ReportFolder& folder, const char* stage, const char* key) {
    const RunStage* s = folder.stage(stage);
    if (!s) return nullptr;
    const auto own = s->result.find(key);
    return own != s->result.end() ? &*own : nullptr;
}

Facts facts_of(const ReportFolder& folder) {
    Facts f;
    f.map_name = fs::path(folder.text("input")).filename().string();
    f.size = times_text(list_in(folder, "map", "size"));
    f.voxel = times_text(list_in(folder, "map", "voxel_size_A"));
    f.isovalue = number_of(folder, {"surface", "tets"}, "iso");
    const std::vector<const char*> measured{"measure", "remesh", "surface"};
    f.area_A2 = number_of(folder, measured, "area_A2");
    f.volume_A3 = number_of(folder, measured, "volume_A3");
    f.pieces = number_of(folder, measured, "components");
    f.open = number_of(folder, measured, "boundary_edges").value_or(0) > 0;
    f.tets = number_of(folder, {"tets"}, "tets");
    return f;
}

std::string volume_text(double A3) {
    return fmt::format("{} Å³ ({} nm³)", number_text(A3), number_text(A3 / 1000));
}

/// "2.7 × 2.7 × 2.7" as "2.7 Å", others as they are.
std::string voxel_text(const std::string& voxel) {
    const std::string times = " × ";
    const std::size_t first = voxel.find(times);
    const std::string one = voxel.substr(0, first);
    return voxel == one + times + one + times + one ? one + " Å" : voxel + " Å";
}

/// A sentence for each thing that is known, in words for somebody who has never seen the program.
std::vector<std::string> summary_text(const Facts& f, const std::vector<PocketRow>& pockets) {
    std::string what = "This page shows a geometric model that vdbgeo made";
    what += f.map_name.empty() ? " from a density map." : fmt::format(" from the density map {}", f.map_name);
    if (!f.map_name.empty())
        what += f.size.empty() ? "."
                               : fmt::format(": a box of {} voxels{}.", f.size,
                                             f.voxel.empty() ? "" : ", " + voxel_text(f.voxel) + " each");
    what +=
        " A density map tells how much matter there is at each place of a specimen; the model is the surface "
        "of "
        "what is dense, with numbers for its shape.";
    std::string found;
    if (f.isovalue)
        found += fmt::format(
            "The surface is drawn where the density is {} (the isovalue): denser places are inside. ",
            number_text(*f.isovalue));
    if (f.area_A2)
        found += fmt::format("It has an area of {} Å²{}{}. ", number_text(*f.area_A2),
                             f.volume_A3 ? fmt::format(" and encloses {}", volume_text(*f.volume_A3)) : "",
                             f.pieces ? fmt::format("; it consists of {} {}", number_text(*f.pieces),
                                                    *f.pieces == 1 ? "piece" : "pieces")
                                      : "");
    if (f.area_A2 && !f.volume_A3 && f.open)
        found +=
            "It is open where the specimen meets the border of the map, so no volume is enclosed; the option "
            "cap of the stage surface closes it there. ";
    if (!pockets.empty()) {
        const auto area = pockets[0].number("area_A2"), depth = pockets[0].number("depth_A");
        found +=
            fmt::format("{} {} where it bends inward {} found", count_text(pockets.size()),
                        plural(pockets.size(), "pocket", "pockets"), plural(pockets.size(), "was", "were"));
        if (area && depth)
            found += fmt::format("; the first by rank has an area of {} Å² and is {} Å deep",
                                 number_text(*area), number_text(*depth));
        found += ". ";
    }
    if (f.tets)
        found += fmt::format("For simulations its inside was filled with {} {}.", number_text(*f.tets),
                             *f.tets == 1 ? "tetrahedron" : "tetrahedra");
    std::vector<std::string> texts{what};
    if (!found.empty()) texts.push_back(found);
    return texts;
}

PageTerms facts_terms(const Facts& f, std::size_t pockets) {
    PageTerms terms;
    if (!f.map_name.empty()) terms.emplace_back("Map", f.map_name);
    if (!f.size.empty()) terms.emplace_back("Size", f.size + " voxels");
    if (!f.voxel.empty()) terms.emplace_back("Voxel", voxel_text(f.voxel));
    if (f.isovalue) terms.emplace_back("Isovalue", number_text(*f.isovalue));
    if (f.volume_A3) terms.emplace_back("Volume", number_text(*f.volume_A3) + no_break + "Å³");
    if (f.area_A2) terms.emplace_back("Area", number_text(*f.area_A2) + no_break + "Å²");
    if (f.pieces) terms.emplace_back("Pieces", number_text(*f.pieces));
    if (pockets > 0) terms.emplace_back("Pockets", count_text(pockets));
    if (f.tets) terms.emplace_back("Tetrahedra", number_text(*f.tets));
    return terms;
}

/// What is around a pocket, in words.
std::string opening_text(const PocketRow& row) {
    const auto rims = row.number("rims");
    std::string text = !rims ? "" : *rims == 0 ? "closed cavity" : *rims == 1 ? "pit" : "channel or groove";
    if (row.number("touches_border").value_or(0) > 0)
        text += text.empty() ? "at the border" : ", at the border";
    return text;
}

/// Lengths and areas to a tenth of an Å or Å², so that columns line up; others with four digits.
std::string cell(const PocketRow& row, const std::string& column) {
    const auto value = row.number(column);
    if (!value) return "–";
    const bool per = column.find("_per_") != std::string::npos || column.rfind("mean_", 0) == 0;
    return per ? number_text(*value) : decimal_text(*value, 1);
}

/// Means over the patch of values that were sampled, by the names of their columns.
std::vector<std::string> sampled_columns(const std::vector<PocketRow>& rows) {
    constexpr std::size_t most = 3;
    std::vector<std::string> names;
    if (rows.empty()) return names;
    for (const auto& [name, value] : rows[0].values)
        if (name.rfind("mean_", 0) == 0 && name != "mean_k1_per_A" && name != "mean_k2_per_A" &&
            name != "mean_H_per_A" && name != "mean_K_per_A2" && name != "mean_depth_A" &&
            names.size() < most)
            names.push_back(name);
    return names;
}

void add_pockets(ReportContent& c, const std::vector<PocketRow>& rows) {
    if (rows.empty()) return;
    const bool outward = rows[0].number("kind").value_or(0) > 0;
    c.pockets_text.push_back(
        outward ? "Patches of the surface that stick out, the most prominent first."
                : "Patches of the surface that bend inward, where small molecules may bind; those that hold "
                  "most space "
                  "come first. Depth is measured below a sheet that lies tight around the specimen, or below "
                  "a ball that "
                  "rolls over it; the mouth is the opening. Curvatures are means over the patch, negative "
                  "where the "
                  "surface is hollow; the position is that of its middle in the map's frame.");
    c.pockets.id = "pocket-table";
    c.pockets.shown = pockets_shown;
    c.pockets.columns = {{"Rank"},          {"Area (Å²)"}, {"Depth (Å)"}, {"Mouth (Å²)"}, {"Mean k1 (1/Å)"},
                         {"Mean k2 (1/Å)"}, {"x (Å)"},     {"y (Å)"},     {"z (Å)"},      {"Form", false}};
    const std::vector<std::string> sampled = sampled_columns(rows);
    for (const std::string& name : sampled) c.pockets.columns.push_back({"Mean " + name.substr(5)});
    for (const PocketRow& row : rows) {
        std::vector<std::string> cells{row.number("id") ? fmt::format("{:.0f}", *row.number("id")) : "–"};
        for (const char* column : {"area_A2", "depth_A", "mouth_area_A2", "mean_k1_per_A", "mean_k2_per_A",
                                   "centroid_x_A", "centroid_y_A", "centroid_z_A"})
            cells.push_back(cell(row, column));
        cells.push_back(opening_text(row));
        for (const std::string& name : sampled) cells.push_back(cell(row, name));
        c.pockets.rows.push_back(std::move(cells));
    }
}

std::vector<PagePocket> pocket_places(const std::vector<PocketRow>& rows) {
    std::vector<PagePocket> places;
    for (const PocketRow& row : rows) {
        const auto id = row.number("id"), area = row.number("area_A2");
        if (!id || !(*id >= 1 && *id < 4e9) || !area || !(*area >= 0)) continue;
        PagePocket p;
        p.id = static_cast<std::uint32_t>(*id);
        const char* axes[] = {"x", "y", "z"};
        bool whole = true;
        for (int a = 0; a < 3; ++a) {
            const auto at = row.number(fmt::format("centroid_{}_A", axes[a]));
            whole = whole && at;
            p.centre[a] = at.value_or(0);
            p.opening[a] = row.number(fmt::format("opening_{}", axes[a])).value_or(0);
        }
        p.radius = std::sqrt(*area / M_PI);
        if (whole) places.push_back(p);
    }
    return places;
}

void add_figures(ReportContent& c, ReportFolder& folder) {
    for (const char axis : {'z', 'y', 'x'}) {
        auto before = folder.picture(fmt::format("slices_before_{}.png", axis),
                                     fmt::format("Section through the map across {}, with noise", axis));
        auto after = folder.picture(fmt::format("slices_after_{}.png", axis),
                                    fmt::format("The same section across {} after noise removal", axis));
        if (before && after) c.comparisons.push_back({axis, std::move(*before), std::move(*after)});
    }
    const std::string spectra = folder.svg("spectra.svg");
    if (!spectra.empty())
        c.noise.push_back(
            {"Power spectra before and after",
             "How strong detail of each fineness is, coarse on the left, fine on the right. Noise removal "
             "should lower the right end and leave the left as it was.",
             spectra,
             {}});
    for (const FileWords& f : plot_files()) {
        const std::string svg = folder.svg(f.file);
        if (!svg.empty()) c.plots.push_back({f.title, f.caption, svg, {}});
    }
    for (const FileWords& f : picture_files())
        if (auto png = folder.picture(f.file, f.title))
            c.pictures.push_back({f.title, f.caption, "", std::move(*png)});
    for (const char* file : {"mean.png", "pockets_picture.png", "denoised.png", "map.png"})
        if (!c.poster) c.poster = folder.picture(file, "The surface of the specimen, seen from three sides");
}

/// Makes pictures narrower until all together take no more than `most` bytes of the page: 580 pixels is what
/// a page shows them with, twice that what fine screens do.
void fit_pictures(ReportContent& c, double most) {
    std::vector<PagePng*> pictures;
    for (PageFigure& figure : c.pictures) pictures.push_back(&figure.image);
    if (c.poster) pictures.push_back(&*c.poster);
    for (const int width : {1160, 870, 580, 400}) {
        double bytes = 0;
        for (const PagePng* png : pictures) bytes += 4.0 / 3 * static_cast<double>(png->bytes.size());
        if (bytes <= most) return;
        for (PagePng* png : pictures) {
            if (png->width <= width) continue;
            try {
                const Image small = scaled_down(read_png(png->bytes), width);
                png->bytes = png_bytes(small);
                png->width = small.width;
                png->height = small.height;
            } catch (const InvalidInput&) {
                // Its chunks are whole, but not what they say: it goes into the page as it is.
            }
        }
    }
}

void add_numbers(ReportContent& c, const ReportFolder& folder) {
    for (const RunStage& s : folder.stages()) {
        std::vector<std::vector<std::string>> rows = result_rows(s.result);
        if (rows.empty()) continue;
        PageNumbers numbers;
        numbers.title = s.title;
        numbers.table.id = fmt::format("numbers-{}", c.numbers.size() + 1);
        numbers.table.columns = {{"", false}, {"Value"}, {"Unit", false}, {"What it means", false}};
        numbers.table.columns[0].name = "Quantity";
        numbers.table.rows = std::move(rows);
        c.numbers.push_back(std::move(numbers));
    }
}

/// The measures of the surface itself, for a folder whose summary tells none.
void add_own_measures(ReportContent& c, Facts& facts, const TriMesh& mesh, const std::string& file) {
    const MeshMeasures m = measure_mesh(mesh);
    facts.area_A2 = m.area_A2;
    facts.volume_A3 = m.volume_A3;
    facts.pieces = static_cast<double>(m.components);
    facts.open = m.boundary_edges > 0;
    Json j{{"vertices", m.vertices},
           {"faces", m.faces},
           {"components", m.components},
           {"closed", m.closed},
           {"area_A2", m.area_A2},
           {"min_angle_deg", m.min_angle_deg},
           {"max_angle_deg", m.max_angle_deg}};
    if (m.volume_A3) j["volume_A3"] = *m.volume_A3;
    if (m.genus) j["genus"] = *m.genus;
    PageNumbers numbers{"The surface", fmt::format("Measured for this page on {}.", file), {}};
    numbers.table.id = "numbers-surface";
    numbers.table.columns = {{"Quantity", false}, {"Value"}, {"Unit", false}, {"What it means", false}};
    numbers.table.rows = result_rows(j);
    c.numbers.push_back(std::move(numbers));
}

PageTable settings_table(const char* id, const char* caption, const Json& object) {
    PageTable table{id, caption, {{"Name", false}, {"Value", false}}, {}};
    const std::function<void(const std::string&, const Json&, int)> add = [&](const std::string& name,
                                                                              const Json& value, int depth) {
        if (value.is_object() && depth < 4 && !value.empty()) {
            for (const auto& [key, inner] : value.items())
                add(name.empty() ? key : name + "." + key, inner, depth + 1);
        } else if (!(value.is_string() && value.get<std::string>().empty())) {
            table.rows.push_back({name, value.is_object() ? "…" : value_text(value)});
        }
    };
    add("", object, 0);
    return table;
}

std::string status_word(const RunStage& s) { return s.status == "done" ? "" : s.status; }

void add_how(ReportContent& c, const ReportFolder& folder) {
    const Json& summary = folder.summary();
    const auto seconds = number_in(summary, "seconds");
    std::string text;
    if (!folder.text("preset").empty()) text += fmt::format("Settings for: {}. ", folder.text("preset"));
    if (seconds) text += fmt::format("The whole run took {}. ", time_text(*seconds));
    if (!folder.stages().empty())
        c.how_text.push_back(
            text +
            "Each step can be done again by itself, in the folder of the results, with the command shown.");
    for (const RunStage& s : folder.stages()) {
        PageStage stage{s.title, status_word(s), s.seconds ? time_text(*s.seconds) : "", s.command, {}};
        if (!s.error.empty()) stage.remarks.push_back("Error: " + s.error);
        for (const std::string& w : s.warnings) stage.remarks.push_back("Warning: " + w);
        if (s.status == "reused")
            stage.remarks.push_back("Taken from an earlier run with the same input and options.");
        c.how.push_back(std::move(stage));
    }
    for (const auto& [key, id, caption] :
         {std::tuple{"options", "options-table", "All options"},
          std::tuple{"versions", "versions-table", "Versions of the program and its libraries"}}) {
        const auto found = summary.find(key);
        if (found == summary.end() || !found->is_object()) continue;
        PageTable table = settings_table(id, caption, *found);
        if (!table.rows.empty()) c.how_tables.push_back(std::move(table));
    }
}

/// The page's meshes, in sizes that may shrink.
struct Meshes {
    std::optional<PageSurface> surface;
    std::optional<PageTets> tets;
    std::uint64_t faces_wanted = 0, tets_wanted = 0;
    PageMesh shown_surface, shown_tets;
};

void read_meshes(Meshes& m, ReportFolder& folder, std::string& surface_file, Session& session) {
    for (const char* name : {"pockets.ply", "curved.ply", "mesh.ply", "surface.ply"}) {
        auto mesh = folder.taken<TriMesh>(name, [&](const std::string& path) {
            return read_mesh(path, session.stage(std::string("reading ") + name));
        });
        session.end_stage();
        if (!mesh) continue;
        if (mesh->triangles.empty()) {
            folder.note_damage(name, "it has no triangles");
            continue;
        }
        m.surface.emplace(std::move(*mesh));
        surface_file = name;
        break;
    }
    auto tets = folder.taken<TetMesh>("tets.vtu", [&](const std::string& path) {
        return read_tets(path, session.stage("reading tets.vtu"));
    });
    session.end_stage();
    if (tets && tets->tets.empty()) {
        folder.note_damage("tets.vtu", "it has no tetrahedra");
        tets.reset();
    }
    if (tets) m.tets.emplace(std::move(*tets));
}

template <class Mesh>
void pack(std::optional<Mesh>& mesh, std::uint64_t wanted, PageMesh& shown, const char* file,
          ReportFolder& folder, const Progress& progress) {
    shown = {};
    if (!mesh || wanted == 0) return;
    try {
        shown = mesh->at_most(wanted, progress);
    } catch (const InvalidInput& e) {
        folder.note_damage(file, std::string("it cannot be shown: ") + e.what());
        mesh.reset();
    } catch (const NumericalError& e) {
        folder.note_damage(file, std::string("it cannot be shown: ") + e.what());
        mesh.reset();
    }
}

}  // namespace

void ReportOptions::check() const {
    if (faces < 100) throw InvalidInput("--faces: expected at least 100");
    if (tets < 100) throw InvalidInput("--tets: expected at least 100");
    if (max_bytes < 100'000) throw InvalidInput("--max-size: expected at least 100K");
}

namespace {

class ReportMaker {
 public:
    ReportMaker(const ReportOptions& options, Session& session)
        : options_(options), session_(session), folder_(options.folder) {}

    Report make() {
        meshes_.faces_wanted = options_.faces, meshes_.tets_wanted = options_.tets;
        read_meshes(meshes_, folder_, surface_file_, session_);
        pockets_ = folder_.pockets();
        facts_ = facts_of(folder_);
        if (!facts_.area_A2 && meshes_.surface)
            add_own_measures(content_, facts_, meshes_.surface->mesh(), surface_file_);
        if (!facts_.tets && meshes_.tets) facts_.tets = static_cast<double>(meshes_.tets->mesh().tets.size());
        fill();
        pack_surface();
        pack_tets();
        while (true) {
            finish();
            report_.html = report_html(content_);
            if (report_.html.size() <= options_.max_bytes) break;
            shrink();
        }
        tell();
        return std::move(report_);
    }

 private:
    void fill() {
        const std::string stem = fs::path(facts_.map_name).stem().string();
        std::string folder_name = fs::weakly_canonical(fs::path(options_.folder)).filename().string();
        content_.title = !options_.title.empty() ? options_.title : !stem.empty() ? stem : folder_name;
        if (content_.title.empty()) content_.title = "Report";
        content_.subtitle =
            fmt::format("Geometric model of {}, made with vdbgeo {}",
                        facts_.map_name.empty() ? "a density map" : facts_.map_name, VDBGEO_VERSION);
        content_.summary = summary_text(facts_, pockets_);
        content_.facts = facts_terms(facts_, pockets_.size());
        add_figures(content_, folder_);
        fit_pictures(content_, 0.45 * static_cast<double>(options_.max_bytes));
        add_numbers(content_, folder_);
        content_.glossary = glossary();
        add_how(content_, folder_);
        content_.citations = citations(VDBGEO_VERSION);
    }

    void pack_surface() {
        pack(meshes_.surface, meshes_.faces_wanted, meshes_.shown_surface, surface_file_.c_str(), folder_,
             session_.stage("surface for the page"));
        session_.end_stage();
    }

    void pack_tets() {
        pack(meshes_.tets, meshes_.tets_wanted, meshes_.shown_tets, "tets.vtu", folder_,
             session_.stage("tetrahedra for the page"));
        session_.end_stage();
    }

    /// What depends on the size of things.
    void finish() {
        content_.surface = meshes_.shown_surface.json;
        content_.tets = meshes_.shown_tets.json;
        content_.pocket_places =
            content_.surface.empty() ? std::vector<PagePocket>() : pocket_places(pockets_);
        content_.specimen.clear();
        for (const PageMesh* m : {&meshes_.shown_surface, &meshes_.shown_tets})
            content_.specimen.insert(content_.specimen.end(), m->remarks.begin(), m->remarks.end());
        content_.specimen.insert(content_.specimen.end(), left_out_.begin(), left_out_.end());
        content_.pockets_text.clear();
        content_.pockets = {};
        add_pockets(content_, pockets_);
        content_.missing = folder_.missing(options_.within_run);
    }

    /// One step towards a shorter page.
    void shrink() {
        constexpr std::uint64_t least = 4000;
        const std::size_t surface = content_.surface.size(), tets = content_.tets.size();
        if (surface >= tets && meshes_.shown_surface.shown > least) {
            meshes_.faces_wanted = meshes_.shown_surface.shown / 2;
            return pack_surface();
        }
        if (meshes_.shown_tets.shown > least) {
            meshes_.tets_wanted = meshes_.shown_tets.shown / 2;
            return pack_tets();
        }
        if (surface > 0 && meshes_.shown_surface.shown > least) {
            meshes_.faces_wanted = meshes_.shown_surface.shown / 2;
            return pack_surface();
        }
        if (drop_largest_picture()) return;
        if (surface + tets > 0) {
            (tets > 0 ? meshes_.tets_wanted : meshes_.faces_wanted) = 0;
            left_out_.push_back(fmt::format("The {} left out for the page's size.",
                                            tets > 0 ? "tetrahedra are" : "surface in three dimensions is"));
            return tets > 0 ? pack_tets() : pack_surface();
        }
        throw InvalidInput(
            fmt::format("{}: the page takes {} bytes without any picture; allow more (--max-size)",
                        options_.folder, report_.html.size()));
    }

    bool drop_largest_picture() {
        if (!content_.pictures.empty()) {
            const auto largest = std::max_element(content_.pictures.begin(), content_.pictures.end(),
                                                  [](const PageFigure& a, const PageFigure& b) {
                                                      return a.image.bytes.size() < b.image.bytes.size();
                                                  });
            left_out_.push_back(
                fmt::format("The picture “{}” is left out for the page's size.", largest->title));
            content_.pictures.erase(largest);
            return true;
        }
        if (!content_.comparisons.empty()) {
            left_out_.push_back(fmt::format("The sections across {} are left out for the page's size.",
                                            content_.comparisons.back().axis));
            content_.comparisons.pop_back();
            return true;
        }
        const bool there = content_.poster.has_value();
        content_.poster.reset();
        return there;
    }

    void tell() {
        report_.notes = meshes_.shown_surface.remarks;
        report_.notes.insert(report_.notes.end(), meshes_.shown_tets.remarks.begin(),
                             meshes_.shown_tets.remarks.end());
        report_.notes.insert(report_.notes.end(), left_out_.begin(), left_out_.end());
        report_.faces = meshes_.shown_surface.shown, report_.tets = meshes_.shown_tets.shown;
        if (meshes_.surface) report_.faces_full = meshes_.surface->mesh().triangles.size();
        if (meshes_.tets) report_.tets_full = meshes_.tets->mesh().tets.size();
        report_.pockets = pockets_.size();
        report_.damaged = folder_.damaged();
        report_.missing = content_.missing;
    }

    const ReportOptions& options_;
    Session& session_;
    ReportFolder folder_;
    std::string surface_file_;
    Meshes meshes_;
    std::vector<PocketRow> pockets_;
    Facts facts_;
    ReportContent content_;
    std::vector<std::string> left_out_;
    Report report_;
};

}  // namespace

Report make_report(const ReportOptions& options, Session& session) {
    options.check();
    return ReportMaker(options, session).make();
}

std::string write_report(const ReportOptions& options, Session& session, Report& report) {
    const std::string out =
        options.out.empty() ? (fs::path(options.folder) / "report.html").string() : options.out;
    report = make_report(options, session);
    write_file(out, report.html);
    return out;
}

}  // namespace vdbgeo::app
