# Makes the manual pages in build/PRESET/man (target `man`) if scdoc is installed; the package needs it.
find_program(SCDOC scdoc)
if(SCDOC)
  # A page has the date of the release, not of the build.
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/debian/changelog")
  file(STRINGS "${PROJECT_SOURCE_DIR}/debian/changelog" trailer REGEX "^ -- .*>  " LIMIT_COUNT 1)
  string(REGEX REPLACE "^.*>  " "" released "${trailer}")
  execute_process(COMMAND date --utc "--date=${released}" +%s OUTPUT_VARIABLE released_s OUTPUT_STRIP_TRAILING_WHITESPACE
    COMMAND_ERROR_IS_FATAL ANY)
  set(pages "")
  foreach(page vgyro.1 vgyro-fleet.1 vgyro.toml.5 vgyrod.8)
    set(source "${PROJECT_SOURCE_DIR}/docs/man/${page}.scd")
    set(made "${CMAKE_BINARY_DIR}/man/${page}")
    add_custom_command(OUTPUT "${made}" DEPENDS "${source}" VERBATIM
      COMMAND ${CMAKE_COMMAND} -E make_directory "${CMAKE_BINARY_DIR}/man"
      COMMAND ${CMAKE_COMMAND} -E env SOURCE_DATE_EPOCH=${released_s} sh -c "\"${SCDOC}\" < \"${source}\" > \"${made}\"")
    list(APPEND pages "${made}")
  endforeach()
  add_custom_target(man ALL DEPENDS ${pages})
endif()
