# The oracle of tests and benches: MuJoCo 4.0.1 from the PyPI wheel mujoco-core, unpacked in the cache. Makes the target gsp_mujoco
# (C headers, libmujoco.so.4.0.1, run path) or says why not; nothing that users link needs it.
option(GSP_WITH_MUJOCO "Build the tests and benches that compare with MuJoCo, when it can be had" ON)
function(gsp_find_mujoco)
  if(NOT GSP_WITH_MUJOCO)
    message(STATUS "gsp: oracle tests are left out (GSP_WITH_MUJOCO is OFF)")
    return()
  endif()
  if(NOT CMAKE_SYSTEM_NAME STREQUAL "Linux" OR NOT CMAKE_SYSTEM_PROCESSOR STREQUAL "x86_64")
    message(STATUS "gsp: oracle tests are left out (the pinned MuJoCo is for Linux on x86_64)")
    return()
  endif()
  # One wheel for every Python: only its C library and headers are used.
  gsp_unpack_wheel(prefix mujoco-core-4.0.1 mujoco_core-4.0.1-cp311-cp311-manylinux_2_27_x86_64.manylinux_2_28_x86_64.whl
    be28c0c7587347ef996b4de0487264e9da296282082b092bae211a9163e9aed6
    --only-binary :all: --python-version 311 --implementation cp --abi cp311 --platform manylinux_2_28_x86_64 --platform manylinux_2_27_x86_64 mujoco-core==4.0.1)
  if(NOT prefix)
    message(STATUS "gsp: oracle tests are left out (${prefix_ERROR})")
    return()
  endif()
  add_library(gsp_mujoco SHARED IMPORTED GLOBAL)
  set_target_properties(gsp_mujoco PROPERTIES IMPORTED_LOCATION "${prefix}/mujoco/libmujoco.so.4.0.1" IMPORTED_SONAME libmujoco.so.4.0.1
    INTERFACE_INCLUDE_DIRECTORIES "${prefix}/mujoco/include" INTERFACE_COMPILE_DEFINITIONS GSP_HAS_MUJOCO=1)
  message(STATUS "gsp: oracle MuJoCo 4.0.1 at ${prefix}")
endfunction()
gsp_find_mujoco()
