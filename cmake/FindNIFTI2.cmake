# nifticlib's reader of NIfTI-1 and NIfTI-2 as the target NIFTI2::NIFTI2. Debian's own NIFTIConfig.cmake
# wants the programs of nifti-bin as well, and there is no pkg-config file.
find_path(NIFTI2_INCLUDE_DIR nifti2_io.h PATH_SUFFIXES nifti)
find_library(NIFTI2_LIBRARY nifti2)
find_library(NIFTI2_ZNZ_LIBRARY znz)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(NIFTI2 REQUIRED_VARS NIFTI2_LIBRARY NIFTI2_ZNZ_LIBRARY NIFTI2_INCLUDE_DIR)
mark_as_advanced(NIFTI2_INCLUDE_DIR NIFTI2_LIBRARY NIFTI2_ZNZ_LIBRARY)
if(NIFTI2_FOUND AND NOT TARGET NIFTI2::NIFTI2)
  add_library(NIFTI2::NIFTI2 UNKNOWN IMPORTED)
  set_target_properties(NIFTI2::NIFTI2 PROPERTIES IMPORTED_LOCATION ${NIFTI2_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${NIFTI2_INCLUDE_DIR} INTERFACE_LINK_LIBRARIES ${NIFTI2_ZNZ_LIBRARY})
endif()
