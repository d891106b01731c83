// The glossary behind report_words: what keys, properties, files and words of the trade mean.
#pragma once

#include "apps/report_words.h"

namespace vdbgeo::app {

/// The entry of a key; null where there is none.
const KeyWords* find_words(const std::string& key);

}  // namespace vdbgeo::app
