# Installs gsp into an empty prefix, configures a project of someone else against it, builds and runs that: among it a simulation with gsp::kernels and header-only,
# which must give the same bits. Then all examples and the program, as a user would build a copy of that folder (not optimised: whether they compile and link is the
# question, and the examples' own tests run them). Any step that fails fails the test.
set(prefix "${WORK}/prefix")
file(REMOVE_RECURSE "${WORK}")
execute_process(COMMAND "${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${prefix}" OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
file(GLOB kernels "${prefix}/*/libgsp_kernels.a" "${prefix}/*/*/libgsp_kernels.a")
set(component "")
if(kernels)
  set(component kernels)
endif()
execute_process(COMMAND "${CMAKE_COMMAND}" -G "${GENERATOR}" -S "${CONSUMER}" -B "${WORK}/build" "-DCMAKE_CXX_COMPILER=${COMPILER}"
  "-DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER}" "-Dgsp_ROOT=${prefix}" -DCMAKE_BUILD_TYPE=Release "-DCMAKE_CXX_FLAGS_RELEASE=-O2 -DNDEBUG" "-DWITH_IO=${IO}" "-DCOMPONENT=${component}"
  "-DNATIVE=${NATIVE}" "-DCMAKE_CXX_FLAGS=${FLAGS}" COMMAND_ERROR_IS_FATAL ANY)
if(IO)  # a component that is not there: the sentence that names those that are
  execute_process(COMMAND "${CMAKE_COMMAND}" -G "${GENERATOR}" -S "${CONSUMER}" -B "${WORK}/component" "-DCMAKE_CXX_COMPILER=${COMPILER}"
    "-Dgsp_ROOT=${prefix}" -DCOMPONENT=wheels RESULT_VARIABLE result OUTPUT_QUIET ERROR_VARIABLE said)
  string(REGEX REPLACE "[ \n]+" " " said "${said}")
  if(result EQUAL 0 OR NOT said MATCHES "gsp has no component 'wheels'; there are io, kernels and runtime")
    message(FATAL_ERROR "find_package(gsp COMPONENTS wheels): ${said}")
  endif()
endif()
execute_process(COMMAND "${CMAKE_COMMAND}" --build "${WORK}/build" --parallel 2 COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND "${WORK}/build/consumer" COMMAND_ERROR_IS_FATAL ANY)
if(kernels)
  execute_process(COMMAND "${WORK}/build/simulation" "${WORK}/kernels.bin" COMMAND_ERROR_IS_FATAL ANY)
  execute_process(COMMAND "${WORK}/build/simulation_header_only" "${WORK}/header_only.bin" COMMAND_ERROR_IS_FATAL ANY)
  execute_process(COMMAND "${CMAKE_COMMAND}" -E compare_files "${WORK}/kernels.bin" "${WORK}/header_only.bin" RESULT_VARIABLE differ)
  if(differ)
    message(FATAL_ERROR "tests/package: states and pictures of gsp::kernels (${WORK}/kernels.bin) and of the headers alone (${WORK}/header_only.bin) are not the same bits")
  endif()
endif()
if(EXISTS "${BUILD}/gsp")  # the program is installed with the library
  execute_process(COMMAND "${prefix}/bin/gsp" --version OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
endif()
set(flags -O0)
if(NATIVE)
  string(APPEND flags " -march=native")  # the width of gsp::kernels
endif()
if(IO)
  execute_process(COMMAND "${CMAKE_COMMAND}" -G "${GENERATOR}" -S "${EXAMPLES}" -B "${WORK}/examples" "-DCMAKE_CXX_COMPILER=${COMPILER}"
    "-DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER}" "-Dgsp_ROOT=${prefix}" "-DCMAKE_CXX_FLAGS=${flags}" COMMAND_ERROR_IS_FATAL ANY)
  # All examples; the program, which the install has, is configured alone.
  file(GLOB stories RELATIVE "${EXAMPLES}" "${EXAMPLES}/[0-9][0-9]_*.cpp")
  list(TRANSFORM stories REPLACE "\\.cpp$" "")
  list(TRANSFORM stories PREPEND example_)
  execute_process(COMMAND "${CMAKE_COMMAND}" --build "${WORK}/examples" --parallel 2 --target ${stories} COMMAND_ERROR_IS_FATAL ANY)
  execute_process(COMMAND "${WORK}/examples/example_01_pendulum" COMMAND_ERROR_IS_FATAL ANY)
  if(NATIVE)  # a file of another width than gsp::kernels compiles its own, beside it
    execute_process(COMMAND "${CMAKE_COMMAND}" "-DCMAKE_CXX_FLAGS=-O0" "${WORK}/examples" OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
    execute_process(COMMAND "${CMAKE_COMMAND}" --build "${WORK}/examples" --target example_01_pendulum COMMAND_ERROR_IS_FATAL ANY)
    execute_process(COMMAND "${WORK}/examples/example_01_pendulum" COMMAND_ERROR_IS_FATAL ANY)
  endif()
endif()
