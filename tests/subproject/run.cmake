# gsp in a project of someone else by add_subdirectory: gsp::kernels has the width of the file that links it. Not optimised: whether widths
# agree is the question. Any step that fails fails the test.
file(REMOVE_RECURSE "${WORK}")
set(kokkos "")
if(KOKKOS)  # one that was named; else the sub-project finds what its parent has found
  set(kokkos "-DKokkos_ROOT=${KOKKOS}")
endif()
execute_process(COMMAND "${CMAKE_COMMAND}" -G "${GENERATOR}" -S "${CMAKE_CURRENT_LIST_DIR}" -B "${WORK}" "-DGSP=${GSP}" "-DCMAKE_CXX_COMPILER=${COMPILER}"
  "-DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER}" ${kokkos} "-DGSP_CACHE_DIR=${CACHE}" "-DCMAKE_CXX_FLAGS=-O0" COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND "${CMAKE_COMMAND}" --build "${WORK}" --parallel 2 --target simulation COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND "${WORK}/simulation" "${WORK}/out.bin" COMMAND_ERROR_IS_FATAL ANY)
