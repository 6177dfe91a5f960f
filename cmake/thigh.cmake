# The bundled thigh: fitted from data/thigh by the program that was just built, and again whenever
# the data or the program change.
set(SONDE_BUNDLED_MODEL ${PROJECT_BINARY_DIR}/share/sonde/thigh.sonde)
set(thigh_data ${PROJECT_SOURCE_DIR}/data/thigh)
add_custom_command(
  OUTPUT ${SONDE_BUNDLED_MODEL}
  COMMAND ${CMAKE_COMMAND} -E make_directory ${PROJECT_BINARY_DIR}/share/sonde
  COMMAND sonde fit ${thigh_data}/indentation.csv --surface ${thigh_data}/skin.ply
    --sites ${thigh_data}/sites.csv --stages 3 --name "Thigh A (synthetic)"
    --provenance "Computed by finite elements (CalculiX), not measured on a person; fitted in three stages to data/thigh/indentation.csv"
    -o ${SONDE_BUNDLED_MODEL}
  DEPENDS sonde ${thigh_data}/indentation.csv ${thigh_data}/skin.ply ${thigh_data}/sites.csv
    ${thigh_data}/femur.ply ${thigh_data}/fat_skin_interface.ply ${thigh_data}/muscle_surface.ply
  COMMENT "Fitting the bundled thigh" USES_TERMINAL VERBATIM)
# The bundled leg, on which the page practises: drawn anew by each program, which refuses others.
set(SONDE_BUNDLED_LEG ${PROJECT_BINARY_DIR}/share/sonde/leg.sonde)
add_custom_command(
  OUTPUT ${SONDE_BUNDLED_LEG}
  COMMAND ${CMAKE_COMMAND} -E make_directory ${PROJECT_BINARY_DIR}/share/sonde
  COMMAND sonde limb --seed 3 --bmi 24 --model ${SONDE_BUNDLED_LEG} > ${PROJECT_BINARY_DIR}/leg.txt
  DEPENDS sonde
  COMMENT "Drawing the bundled leg" VERBATIM)
add_custom_target(thigh ALL DEPENDS ${SONDE_BUNDLED_MODEL} ${SONDE_BUNDLED_LEG})
