# The install tree: headers, both libraries, package files, man pages, the data of the bundled thigh.
include(CMakePackageConfigHelpers)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/sonde)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/sonde
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
foreach(library IN LISTS SONDE_LIBRARIES)
  string(REPLACE "-" "_" target ${library})
  install(TARGETS ${target}_lib_static ${target}_lib_shared EXPORT ${library}Targets
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(EXPORT ${library}Targets NAMESPACE sonde:: DESTINATION ${package_dir})
endforeach()

configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/sondeConfig.cmake.in
  ${PROJECT_BINARY_DIR}/sondeConfig.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/sondeConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/sondeConfig.cmake ${PROJECT_BINARY_DIR}/sondeConfigVersion.cmake
  ${PROJECT_SOURCE_DIR}/cmake/FindNIFTI2.cmake
  DESTINATION ${package_dir})
# Relative to the .pc file, so that the tree may be moved.
file(RELATIVE_PATH SONDE_PREFIX_FROM_PC
  ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig ${CMAKE_INSTALL_PREFIX})
# sonde_pc(library OF house... OTHERS modules... LIBS flags...): the .pc file of one library; LIBS are of
# static libraries that pkg-config does not know.
function(sonde_pc SONDE_PC_NAME)
  cmake_parse_arguments(PARSE_ARGV 1 pc "" "" "OF;OTHERS;LIBS")
  list(JOIN pc_OF " " SONDE_PC_HOUSE)
  list(JOIN pc_OTHERS " " SONDE_PC_OTHERS)
  list(JOIN pc_LIBS " " SONDE_PC_LIBS)
  configure_file(${PROJECT_SOURCE_DIR}/cmake/sonde.pc.in ${PROJECT_BINARY_DIR}/${SONDE_PC_NAME}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/${SONDE_PC_NAME}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
endfunction()
sonde_pc(sonde OTHERS zlib)
sonde_pc(sonde-files OF sonde OTHERS libpng libjpeg yaml-0.1 zlib LIBS -lnifti2 -lznz)
sonde_pc(sonde-solid OF sonde)
sonde_pc(sonde-limb OF sonde-files sonde)
sonde_pc(sonde-sweep OF sonde OTHERS zlib)
sonde_pc(sonde-scene OF sonde-files sonde)
sonde_pc(sonde-fit OF sonde-solid sonde-files sonde)
sonde_pc(sonde-exam OF sonde-fit sonde-solid sonde-limb sonde-sweep sonde-files sonde OTHERS sqlite3 libmd openssl zlib)

install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/data/thigh ${PROJECT_SOURCE_DIR}/data/scenes
  ${PROJECT_SOURCE_DIR}/data/cases ${PROJECT_SOURCE_DIR}/data/course ${PROJECT_SOURCE_DIR}/data/protocols ${PROJECT_SOURCE_DIR}/data/scanners
  ${PROJECT_SOURCE_DIR}/data/openigtlink
  DESTINATION ${CMAKE_INSTALL_DATADIR}/sonde/data)
if(TARGET thigh)
  install(FILES ${SONDE_BUNDLED_MODEL} ${SONDE_BUNDLED_LEG} DESTINATION ${CMAKE_INSTALL_DATADIR}/sonde)
endif()

# All that `cmake --install` copies, for builds that leave tests, benchmarks and samples out.
add_custom_target(installed)
foreach(library IN LISTS SONDE_LIBRARIES)
  string(REPLACE "-" "_" target ${library})
  add_dependencies(installed ${target}_lib_static ${target}_lib_shared)
endforeach()
foreach(target IN ITEMS sonde manual thigh python)
  if(TARGET ${target})
    add_dependencies(installed ${target})
  endif()
endforeach()
