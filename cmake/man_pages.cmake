# Makes the manual pages in build/PRESET/man (target `man`) if scdoc is installed; the package needs it.
find_program(SCDOC scdoc)
if(SCDOC)
  set(pages "")
  foreach(page vgyro.1 vgyro-fleet.1 vgyro.toml.5 vgyrod.8)
    set(source "${PROJECT_SOURCE_DIR}/docs/man/${page}.scd")
    set(made "${CMAKE_BINARY_DIR}/man/${page}")
    add_custom_command(OUTPUT "${made}" DEPENDS "${source}" VERBATIM
      COMMAND ${CMAKE_COMMAND} -E make_directory "${CMAKE_BINARY_DIR}/man"
      COMMAND sh -c "\"${SCDOC}\" < \"${source}\" > \"${made}\"")
    list(APPEND pages "${made}")
  endforeach()
  add_custom_target(man ALL DEPENDS ${pages})
endif()
