# The install tree: headers, both libraries, package files, man pages, the data of the bundled thigh.
include(CMakePackageConfigHelpers)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/sonde)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/sonde
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
install(TARGETS sonde_lib_static sonde_lib_shared EXPORT sondeTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT sondeTargets NAMESPACE sonde:: DESTINATION ${package_dir})

configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/sondeConfig.cmake.in
  ${PROJECT_BINARY_DIR}/sondeConfig.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/sondeConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/sondeConfig.cmake ${PROJECT_BINARY_DIR}/sondeConfigVersion.cmake
  DESTINATION ${package_dir})
# Relative to the .pc file, so that the tree may be moved.
file(RELATIVE_PATH SONDE_PREFIX_FROM_PC
  ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig ${CMAKE_INSTALL_PREFIX})
configure_file(${PROJECT_SOURCE_DIR}/cmake/sonde.pc.in
  ${PROJECT_BINARY_DIR}/sonde.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/sonde.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1
  FILES_MATCHING PATTERN "*.1")
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/data/thigh ${PROJECT_SOURCE_DIR}/data/scenes
  ${PROJECT_SOURCE_DIR}/data/cases ${PROJECT_SOURCE_DIR}/data/protocols
  DESTINATION ${CMAKE_INSTALL_DATADIR}/sonde/data)
if(TARGET thigh)
  install(FILES ${SONDE_BUNDLED_MODEL} DESTINATION ${CMAKE_INSTALL_DATADIR}/sonde)
endif()
