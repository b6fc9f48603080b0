# CoACD 1.0.14 (MIT), which takes meshes apart into convex ones, from the PyPI wheel coacd, unpacked in the cache. gsp::io loads it when a
# model asks for that (io/convex_parts.hpp); nothing links it. Leaves its path in GSP_COACD_LIBRARY, or says why not.
option(GSP_WITH_COACD "Fetch CoACD, so that meshes can be read as convex parts" ${PROJECT_IS_TOP_LEVEL})
function(gsp_find_coacd)
  if(NOT GSP_WITH_COACD)
    return()
  endif()
  if(NOT CMAKE_SYSTEM_NAME STREQUAL "Linux" OR NOT CMAKE_SYSTEM_PROCESSOR STREQUAL "x86_64")
    message(STATUS "gsp: no convex parts of meshes (the pinned CoACD is for Linux on x86_64; GSP_COACD in the environment names another)")
    return()
  endif()
  gsp_unpack_wheel(prefix coacd-1.0.14 coacd-1.0.14-cp39-abi3-manylinux_2_17_x86_64.manylinux2014_x86_64.whl
    6c135b717af096523bbebf1fd8d326e8950c024237fe9806ad46dedd8b4c31f0
    --only-binary :all: --python-version 311 --implementation cp --abi abi3 --platform manylinux2014_x86_64 --platform manylinux_2_17_x86_64 coacd==1.0.14)
  if(NOT prefix)
    message(STATUS "gsp: no convex parts of meshes (${prefix_ERROR})")
    return()
  endif()
  set(GSP_COACD_LIBRARY "${prefix}/coacd/lib_coacd.so" PARENT_SCOPE)
endfunction()
gsp_find_coacd()
