// What `vdbgeo model` is asked to do: options by stage, from a preset, a file, and the command line.
#pragma once

#include <CLI/CLI.hpp>

#include <string>
#include <vector>

#include "apps/session.h"

namespace vdbgeo::app {

/// Options of the stages as one JSON object: a section a stage, named like the stage, whose keys are the
/// flags of the stage's command without the dashes ({"surface": {"iso": 0.5, "cap": true}}), or false for a
/// stage that is left out; and "preset". Values are numbers, texts, true for a flag, or arrays for a flag
/// that may be repeated.
struct ModelOptions {
    std::string in, folder;
    std::string preset = "molecule";
    std::string from, to;         ///< first and last stage to run; empty: all
    bool fresh = false;           ///< take nothing over from an earlier run
    Json given = Json::object();  ///< sections as given, without the preset's

    static const std::vector<std::string>& presets();

    /// The preset's options with the given ones over them.
    Json sections() const;
};

/// Reads a file of options, or the summary of an earlier model, over what `options` has: its preset, its
/// sections and, where no map was given, its input. InvalidInput for what is no such file.
void read_config(const std::string& file, ModelOptions& options);

/// "stage.option=value", "stage.flag", "stage=false": adds it to the sections. UsageError.
void set_option(const std::string& text, Json& sections);

/// Puts `more` over `sections`, key by key.
void merge_sections(Json& sections, const Json& more);

/// The words that a section stands for on a command line: "--iso", "0.5", "--cap".
std::vector<std::string> words_of(const Json& section);

}  // namespace vdbgeo::app
