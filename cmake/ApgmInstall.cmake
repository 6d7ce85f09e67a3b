# `cmake --install` gives a package that find_package(apgm) finds, with the target apgm::apgm.
include(CMakePackageConfigHelpers)

if(BUILD_SHARED_LIBS)
  set(BUILD_SHARED_LIBS_01 1)
else()
  set(BUILD_SHARED_LIBS_01 0)
endif()
set(APGM_CMAKE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/apgm)

install(TARGETS apgm EXPORT apgmTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
                                        LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/libapgm/include/apgm DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(FILES ${PROJECT_SOURCE_DIR}/schema/apgm.fbs DESTINATION ${CMAKE_INSTALL_DATADIR}/apgm)
# What tells file(1) and desktops of .apgm files.
install(FILES ${PROJECT_SOURCE_DIR}/tools/share/apgm.magic DESTINATION ${CMAKE_INSTALL_DATADIR}/misc)
install(FILES ${PROJECT_SOURCE_DIR}/tools/share/apgm-mime.xml DESTINATION ${CMAKE_INSTALL_DATADIR}/mime/packages
        RENAME apgm.xml)
install(EXPORT apgmTargets NAMESPACE apgm:: DESTINATION ${APGM_CMAKE_DIR})
configure_package_config_file(cmake/apgmConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/apgmConfig.cmake
                              INSTALL_DESTINATION ${APGM_CMAKE_DIR})
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/apgmConfigVersion.cmake COMPATIBILITY SameMajorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/apgmConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/apgmConfigVersion.cmake
        DESTINATION ${APGM_CMAKE_DIR})
