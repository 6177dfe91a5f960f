# Kernels of every deformable model, folder tissue/MODEL: world/kernel.c in each precision for each
# instruction set, as one written source file each.
set(sonde_models two_layer bulk)
set(sonde_kernel_sets base)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  list(APPEND sonde_kernel_sets avx2 avx512)
endif()
set(sonde_flags_base "")
set(sonde_flags_avx2 -mavx2)
set(sonde_flags_avx512 -mavx512f -mavx512dq)

foreach(model IN LISTS sonde_models)
  foreach(set IN LISTS sonde_kernel_sets)
    foreach(precision IN ITEMS float double)
      set(name ${model}_${set}_${precision})
      set(source ${CMAKE_CURRENT_BINARY_DIR}/kernel_${name}_hot.c)
      set(define_double)
      if(precision STREQUAL "double")
        set(define_double "#define SONDE_REAL_DOUBLE\n")
      endif()
      file(CONFIGURE OUTPUT ${source} CONTENT "${define_double}#define SONDE_MODEL_KERNEL \"tissue/${model}/kernel.h\"
#define SONDE_KERNELS sonde_kernels_${name}
#define SONDE_KERNELS_NAME \"${set}\"
#include \"world/kernel.c\"
")
      target_sources(sonde_world PRIVATE ${source})
      sonde_kernels("${sonde_flags_${set}}" ${source})
    endforeach()
  endforeach()
endforeach()
