// The record of a map in the EMDB, as its API (JSON) or its header file (XML) gives it.
#pragma once

#include <filesystem>

namespace vdbgeo {

/// The contour level that the depositors recommend, in the map's units: of the levels that the record lists
/// the one marked as primary, else the first. It is read from
/// - the JSON of EMDB's API (www.ebi.ac.uk/emdb/api/entry/EMD-1080): map.contour_list.contour, a list or a
/// single one,
///   with `primary` and `level`;
/// - the header file of the archive (emd-1080.xml): <contour primary="true"><level>, and <contourLevel> of
/// versions
///   before 3;
/// - the JSON that scripts/fetch_emdb.sh writes beside a map: `contour`.
///
/// Throws IoError where the file cannot be read, and InvalidInput where it is neither JSON nor XML or holds
/// no level.
double recommended_contour(const std::filesystem::path& record);

}  // namespace vdbgeo
