# Programs, libraries, headers, and a CMake package: find_package(vdbgeo) gives vdbgeo::vdbgeo (the library),
# vdbgeo::converters (file formats) and vdbgeo::view (pictures).
include(CMakePackageConfigHelpers)

set(_package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/vdbgeo)
set_target_properties(vdbgeo_converters PROPERTIES EXPORT_NAME converters)
set_target_properties(vdbgeo_view PROPERTIES EXPORT_NAME view)
install(TARGETS vdbgeo vdbgeo_converters vdbgeo_view EXPORT vdbgeoTargets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(TARGETS vdbgeo_main mrc2vdb vdb2mrc RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
if(VDBGEO_MPI_FOUND)
  install(TARGETS vdbgeo_mpi_main RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()
install(DIRECTORY vdbgeo converters DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
install(EXPORT vdbgeoTargets NAMESPACE vdbgeo:: DESTINATION ${_package_folder})

configure_package_config_file(cmake/vdbgeoConfig.cmake.in ${PROJECT_BINARY_DIR}/vdbgeoConfig.cmake
                              INSTALL_DESTINATION ${_package_folder})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/vdbgeoConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/vdbgeoConfig.cmake ${PROJECT_BINARY_DIR}/vdbgeoConfigVersion.cmake
              cmake/VdbgeoDependencies.cmake DESTINATION ${_package_folder})
install(FILES LICENSE THIRD_PARTY.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
