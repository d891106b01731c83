# Finds what vdbgeo builds on. The same file serves the build and, installed, the users of the package.
# TBB comes first (OpenVDB's module looks for it in its own way), and OpenVDB's module path goes again
# afterwards because it shadows the finders of other packages.
include(CMakeFindDependencyMacro)

find_dependency(TBB CONFIG COMPONENTS tbb tbbmalloc)

set(_vdbgeo_module_path "${CMAKE_MODULE_PATH}")
set(_vdbgeo_shared "${BUILD_SHARED_LIBS}")
list(APPEND CMAKE_MODULE_PATH /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/cmake/OpenVDB)
find_dependency(OpenVDB 10.0)
set(CMAKE_MODULE_PATH "${_vdbgeo_module_path}")
set(BUILD_SHARED_LIBS "${_vdbgeo_shared}")  # OpenVDB's module forces it on

find_dependency(Eigen3 3.3 CONFIG)
find_dependency(fmt CONFIG)
find_dependency(ZLIB)
find_dependency(BZip2)
find_dependency(PNG)
find_dependency(zstd CONFIG)
find_dependency(OpenMesh CONFIG)
find_dependency(nlohmann_json CONFIG)
