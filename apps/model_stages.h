// The stages of `vdbgeo model`: each is a command of vdbgeo, or several, on files of one folder.
#pragma once

#include <string>
#include <vector>

#include "apps/model_options.h"

namespace vdbgeo::app {

/// What a stage's command lines are made from.
struct ModelState {
    std::string in, folder;
    Json sections;                  ///< the options of all stages; false: the stage is left out
    Json results = Json::object();  ///< of the stages so far, by name
    bool by_team = false;           ///< which draws no pictures while noise is removed

    bool on(const std::string& stage) const;
    /// The path of a file of the folder.
    std::string at(const std::string& name) const;
    bool labels() const;
    /// Names of the grid, the mesh and the mesh with most properties that later stages work on.
    std::string grid() const;
    std::string mesh() const;
    std::string fullest_mesh() const;
    /// The isovalue of the surface as the number it came to; as it was given where that is not known yet.
    std::string isovalue() const;
};

struct ModelStage {
    using Lines = std::vector<std::vector<std::string>>;
    using Names = std::vector<std::string>;

    const char* name;
    const char* title;
    const char* command;  ///< whose flags the section may have
    /// Whether nothing can be done without it. What depends on another stage that failed fails by itself.
    bool essential;
    /// Files of the folder it reads; "" is the map itself.
    Names (*inputs)(const ModelState&);
    /// Files of the folder it leaves.
    Names (*outputs)(const ModelState&);
    /// Command lines without the program's name.
    Lines (*lines)(const ModelState&);
};

/// In the order in which they run.
const std::vector<ModelStage>& model_stages();

/// nullptr where there is none of that name.
const ModelStage* find_stage(const std::string& name);

/// "map, denoise, …"
std::string stage_names();

/// A file of options that changes nothing: every option of every stage with its help and its default, as
/// comments to take away.
std::string all_options_text();

/// UsageError, naming stage and option, where a section has an option that the stage's command does not know.
void check_sections(const Json& sections);

}  // namespace vdbgeo::app
