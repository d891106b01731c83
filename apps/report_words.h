// Words for what the commands print: a label, a unit and one plain sentence for every key.
#pragma once

#include <string>
#include <vector>

#include "apps/session.h"
#include "vdbgeo/view/report_page.h"

namespace vdbgeo::app {

struct KeyWords {
    std::string label, unit, help;
};

/// The words of a key of a result. A key that is not in the glossary gets its own name in words, the unit
/// that its ending tells (_A, _A2, _A3, _deg, _per_A, _per_A2, bytes, seconds), and no help.
KeyWords words_for(const std::string& key);

/// A number for people: as many digits as mean something, thousands apart, powers of ten where it is very
/// small or very large. Whole numbers are told whole.
std::string number_text(double value);
/// With so many digits behind the point, however many before it.
std::string decimal_text(double value, int digits);
std::string count_text(std::uint64_t count);

/// A JSON value as text in a table: numbers as number_text, yes and no, lists one behind the other or, long
/// ones, how many there are and between what they lie.
std::string value_text(const Json& value);

/// The rows (label, value, unit, what it means) of a result; objects in it are put in line, what only repeats
/// names of files is left out.
std::vector<std::vector<std::string>> result_rows(const Json& result);

/// Seconds, minutes or hours.
std::string time_text(double seconds);

/// Words of the trade, each explained in a sentence.
PageTerms glossary();

/// What a property of a mesh's vertices or tetrahedra is: name, unit, help, colours.
struct PropertyWords {
    std::string name, unit, help;
    std::string colormap = "sequential";
};
PropertyWords property_words(const std::string& key);

/// A file that `model` writes: what it is called on the page, and what can be seen.
struct FileWords {
    const char *file, *title, *caption;
};
const std::vector<FileWords>& plot_files();
const std::vector<FileWords>& picture_files();

/// What to cite, with its BibTeX.
PageTerms citations(const std::string& version);

}  // namespace vdbgeo::app
