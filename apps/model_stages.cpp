#include "apps/model_stages.h"

#include <fmt/format.h>

#include <filesystem>

#include "apps/subcommand.h"
#include "converters/mesh_file.h"
#include "vdbgeo/view/render.h"

namespace vdbgeo::app {
namespace {

using Lines = ModelStage::Lines;
using Names = ModelStage::Names;
using Words = std::vector<std::string>;

/// A command line: `fixed` words, those of `usual` options ("--width", "1200", "--edges") that the stage's
/// section does not have, and the section's own.
Words compose(Words fixed, const Words& usual, const ModelState& m, const char* stage) {
    const Json section = m.sections.value(stage, Json::object());
    for (std::size_t i = 0; i < usual.size(); ++i) {
        const bool flag = i + 1 == usual.size() || usual[i + 1].rfind("--", 0) == 0;
        if (!section.is_object() || !section.contains(usual[i].substr(2))) {
            fixed.push_back(usual[i]);
            if (!flag) fixed.push_back(usual[i + 1]);
        }
        if (!flag) ++i;
    }
    const Words given = words_of(section);
    fixed.insert(fixed.end(), given.begin(), given.end());
    return fixed;
}

/// Colours of a vertex property over the surface.
struct PropertyPicture {
    const char *property, *file;
};
constexpr PropertyPicture property_pictures[] = {
    {"K", "gaussian.png"}, {"H", "mean.png"}, {"k1", "k1.png"}, {"k2", "k2.png"}};

Lines picture_lines(const ModelState& m) {
    Lines lines;
    const auto add = [&](const Words& inputs, const char* picture, Words usual) {
        Words words{"render"};
        for (const std::string& in : inputs) words.push_back(m.at(in));
        words.push_back(m.at(picture));
        usual.insert(usual.begin(), {"--width", "1000", "--occlusion", "4"});
        lines.push_back(compose(std::move(words), usual, m, "pictures"));
    };
    if (!m.labels()) {
        add({"density.vdb"}, "map.png", {"--iso", m.isovalue()});
        if (m.on("denoise"))
            add({"density.vdb", "smooth.vdb"}, "denoised.png",
                {"--iso", m.isovalue(), "--labels", "before,after", "--view", "iso"});
    } else {
        add({"surface.ply"}, "map.png", {"--color-by", "label", "--color-map", "categorical"});
    }
    if (m.on("remesh"))
        add({"surface.ply", "mesh.ply"}, "meshes.png",
            {"--labels", "marching cubes,remeshed", "--view", "iso", "--edges", "--zoom", "4"});
    if (m.on("curvature"))
        for (const auto& [property, file] : property_pictures)
            add({m.fullest_mesh()}, file, {"--color-by", property, "--color-map", "diverging"});
    if (m.on("tets")) {
        const Words size{"--width", "800", "--occlusion", "4"};
        Words cut{"cutaway", m.at("tets.vtu"), m.at("cut.png")};
        // A quarter of the body is taken away, from the front (cf. the paper's Fig 16).
        const Json tets = m.results.value("tets", Json::object()).value("tets", Json(4));
        Words peel{"cutaway", m.at("tets.vtu"), m.at("peel.png"), "--peel",
                   fmt::format("{}", tets.get<std::uint64_t>() / 4)};
        for (Words* words : {&cut, &peel}) {
            words->insert(words->end(), size.begin(), size.end());
            lines.push_back(*words);
        }
    }
    return lines;
}

Names picture_files(const ModelState& m) {
    Names names;
    for (const Words& line : picture_lines(m))
        for (const std::string& word : line)
            if (word.size() > 4 && word.substr(word.size() - 4) == ".png")
                names.push_back(std::filesystem::path(word).filename().string());
    return names;
}

Names picture_inputs(const ModelState& m) {
    Names names = m.labels() ? Names{"surface.ply"} : Names{"density.vdb"};
    if (!m.labels() && m.on("denoise")) names.push_back("smooth.vdb");
    if (m.on("remesh")) names.insert(names.end(), {"surface.ply", "mesh.ply"});
    if (m.on("curvature")) names.push_back(m.fullest_mesh());
    if (m.on("tets")) names.push_back("tets.vtu");
    return names;
}

Lines denoise_lines(const ModelState& m) {
    Words words{"denoise", m.at("density.vdb"), m.at("smooth.vdb")};
    if (!m.by_team) words.insert(words.end(), {"--slices", m.at("slices"), "--spectra", m.at("spectra.svg")});
    return {compose(words, {}, m, "denoise")};
}

Names denoise_files(const ModelState& m) {
    if (m.by_team) return {"smooth.vdb"};
    Names names{"smooth.vdb", "spectra.svg"};
    for (const char axis : {'x', 'y', 'z'})
        for (const char* when : {"before", "after"})
            names.push_back(fmt::format("slices_{}_{}.png", when, axis));
    return names;
}

Lines curvature_lines(const ModelState& m) {
    const Words usual = m.labels() ? Words{} : Words{"--map", m.at(m.grid())};
    return {compose({"curvature", m.at(m.mesh()), m.at("curved.ply"), "--histogram", m.at("curvature.svg"),
                     "--plane", m.at("k1k2.svg")},
                    usual, m, "curvature")};
}

Lines pocket_lines(const ModelState& m) {
    return {compose({"pockets", m.at("curved.ply"), m.at("pockets.csv"), "--mesh", m.at("pockets.ply"),
                     "--picture", m.at("pockets_picture.png")},
                    {"--width", "1000"}, m, "pockets"),
            compose({"pockets", m.at("curved.ply"), m.at("pockets.json")}, {}, m, "pockets")};
}

Lines tet_lines(const ModelState& m) {
    Words usual;
    if (!m.labels()) {
        usual = {"--iso", m.isovalue()};
        const Json section = m.sections.value("tets", Json::object());
        if (!section.is_object() || section.value("method", "stuffing") == "stuffing")
            usual.push_back("--optimize");
    }
    return {
        compose({"tetrahedralize", m.at(m.grid()), m.at("tets.vtu"), "--histogram", m.at("dihedrals.svg")},
                usual, m, "tets")};
}

}  // namespace

bool ModelState::on(const std::string& stage) const {
    return sections.value(stage, Json(true)) != Json(false);
}

std::string ModelState::at(const std::string& name) const {
    return (std::filesystem::path(folder) / name).string();
}

bool ModelState::labels() const {
    return on("surface") && sections.contains("surface") && sections["surface"].is_object() &&
           sections["surface"].contains("labels");
}

std::string ModelState::grid() const { return on("denoise") ? "smooth.vdb" : "density.vdb"; }

std::string ModelState::mesh() const { return on("remesh") ? "mesh.ply" : "surface.ply"; }

std::string ModelState::fullest_mesh() const {
    return on("pockets") && on("curvature") ? "pockets.ply" : on("curvature") ? "curved.ply" : mesh();
}

std::string ModelState::isovalue() const {
    if (results.contains("surface") && results["surface"].contains("iso"))
        return fmt::format("{}", results["surface"]["iso"].get<double>());
    const Json section = sections.value("surface", Json::object());
    if (!section.is_object() || !section.contains("iso")) return "auto";
    return section["iso"].is_string() ? section["iso"].get<std::string>() : section["iso"].dump();
}

const std::vector<ModelStage>& model_stages() {
    static const std::vector<ModelStage> stages{
        {"map", "Map to sparse grid", "convert", true, [](const ModelState&) { return Names{""}; },
         [](const ModelState&) { return Names{"density.vdb"}; },
         [](const ModelState& m) -> Lines {
             return {compose({"convert", m.in, m.at("density.vdb")}, {}, m, "map")};
         }},
        {"denoise", "Noise removal", "denoise", true, [](const ModelState&) { return Names{"density.vdb"}; },
         denoise_files, denoise_lines},
        {"surface", "Surface at the isovalue", "surface", true,
         [](const ModelState& m) { return Names{m.grid()}; },
         [](const ModelState&) { return Names{"surface.ply"}; },
         [](const ModelState& m) -> Lines {
             return {compose({"surface", m.at(m.grid()), m.at("surface.ply")}, {}, m, "surface")};
         }},
        {"statistics", "Densities and isovalues", "info", false,
         [](const ModelState& m) { return Names{m.grid()}; },
         [](const ModelState&) {
             return Names{"density.svg", "isovalues.svg"};
         },
         [](const ModelState& m) -> Lines {
             return {compose({"info", m.at(m.grid()), "--histogram", m.at("density.svg"), "--isovalues",
                              "--plot", m.at("isovalues.svg")},
                             {"--iso", m.isovalue()}, m, "statistics")};
         }},
        {"remesh", "Good triangles", "remesh", true, [](const ModelState&) { return Names{"surface.ply"}; },
         [](const ModelState&) { return Names{"mesh.ply"}; },
         [](const ModelState& m) -> Lines {
             return {compose({"remesh", m.at("surface.ply"), m.at("mesh.ply")}, {}, m, "remesh")};
         }},
        {"measure", "Numbers of the surface", "measure", false,
         [](const ModelState& m) {
             return m.on("remesh") ? Names{"surface.ply", "mesh.ply"} : Names{"surface.ply"};
         },
         [](const ModelState&) { return Names{"angles.svg"}; },
         [](const ModelState& m) -> Lines {
             Words words{"measure", m.at("surface.ply")};
             if (m.on("remesh")) words.push_back(m.at("mesh.ply"));
             words.insert(words.end(), {"--histogram", m.at("angles.svg")});
             return {compose(words, {}, m, "measure")};
         }},
        {"curvature", "Curvature", "curvature", false,
         [](const ModelState& m) {
             return m.labels() ? Names{m.mesh()} : Names{m.mesh(), m.grid()};
         },
         [](const ModelState&) {
             return Names{"curved.ply", "curvature.svg", "k1k2.svg"};
         },
         curvature_lines},
        {"pockets", "Pockets", "pockets", false, [](const ModelState&) { return Names{"curved.ply"}; },
         [](const ModelState&) {
             return Names{"pockets.csv", "pockets.json", "pockets.ply", "pockets_picture.png"};
         },
         pocket_lines},
        {"tets", "Tetrahedra", "tetrahedralize", false, [](const ModelState& m) { return Names{m.grid()}; },
         [](const ModelState&) {
             return Names{"tets.vtu", "dihedrals.svg"};
         },
         tet_lines},
        {"pictures", "Pictures", "render", false, picture_inputs, picture_files, picture_lines},
        {"report", "Report page", "report", false, [](const ModelState&) { return Names{"summary.json"}; },
         [](const ModelState&) { return Names{"report.html"}; },
         [](const ModelState& m) -> Lines {
             return {compose({"report", m.folder}, {}, m, "report")};
         }},
    };
    return stages;
}

const ModelStage* find_stage(const std::string& name) {
    for (const ModelStage& stage : model_stages())
        if (name == stage.name) return &stage;
    return nullptr;
}

std::string stage_names() {
    std::string names;
    for (const ModelStage& stage : model_stages())
        names += (names.empty() ? "" : ", ") + std::string(stage.name);
    return names;
}

std::string all_options_text() {
    std::string text =
        "// Options of vdbgeo model: take away the // before an option to set it. --config reads this file.\n"
        "{\n    // \"preset\": \"molecule\",  // or tomogram, label\n";
    const auto& stages = model_stages();
    for (const ModelStage& stage : stages) {
        text += fmt::format("    // {}: vdbgeo {}; false leaves it out\n    \"{}\": {{\n", stage.title,
                            stage.command, stage.name);
        CLI::App app;
        find_command(stage.command).define(app);
        for (const CLI::Option* option : app.get_options()) {
            if (option->get_positional() || option->get_name() == "--help") continue;
            const bool flag = option->get_items_expected_max() == 0;
            const std::string given = option->get_default_str();
            text += fmt::format("        // \"{}\": {},  // {}\n", option->get_name().substr(2),
                                flag ? "true" : Json(given).dump(), option->get_description());
        }
        text += &stage == &stages.back() ? "    }\n" : "    },\n";
    }
    return text + "}";
}

void check_sections(const Json& sections) {
    for (const auto& [name, section] : sections.items()) {
        const ModelStage* stage = find_stage(name);
        if (!stage || !section.is_object()) continue;
        CLI::App app;
        find_command(stage->command).define(app);
        for (const auto& item : section.items())
            if (!app.get_option_no_throw("--" + item.key()))
                throw UsageError(fmt::format("{}: there is no option {}; vdbgeo {} --help lists them", name,
                                             item.key(), stage->command));
    }
}

}  // namespace vdbgeo::app
