# Finds what vdbgeo builds on. The same file serves the build and, installed, the users of the package.
# TBB comes first (OpenVDB's module looks for it in its own way), and OpenVDB's module path goes again
# afterwards because it shadows the finders of other packages.
include(CMakeFindDependencyMacro)

macro(vdbgeo_find_openvdb)
  set(_vdbgeo_module_path "${CMAKE_MODULE_PATH}")
  set(_vdbgeo_shared "${BUILD_SHARED_LIBS}")
  list(APPEND CMAKE_MODULE_PATH /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/cmake/OpenVDB)
  find_package(OpenVDB 10.0 REQUIRED)
  set(CMAKE_MODULE_PATH "${_vdbgeo_module_path}")
  set(BUILD_SHARED_LIBS "${_vdbgeo_shared}")  # OpenVDB's module forces it on
endmacro()

find_package(TBB CONFIG REQUIRED COMPONENTS tbb tbbmalloc)
vdbgeo_find_openvdb()
find_package(Eigen3 3.3 CONFIG REQUIRED)
find_package(fmt CONFIG REQUIRED)
find_package(ZLIB REQUIRED)
find_package(BZip2 REQUIRED)
find_package(PNG REQUIRED)
find_package(zstd CONFIG REQUIRED)
