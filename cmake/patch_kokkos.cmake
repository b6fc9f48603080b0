# Makes the Kokkos 4.7.00 source compile with CUDA 13, where two runtime calls took new arguments:
#   cudaGraphAddDependencies(graph, from, to, edge data, n)                       edge data may be null
#   cudaMemPrefetchAsync(pointer, count, location, flags, stream)                 a location names kind and id of the memory
# Run as: cmake -DKOKKOS_SOURCE=<folder> -P patch_kokkos.cmake
set(file "${KOKKOS_SOURCE}/core/src/Cuda/Kokkos_Cuda_Instance.hpp")
file(READ "${file}" text)

function(replace_once from to)
  string(FIND "${text}" "${from}" first)
  string(FIND "${text}" "${from}" last REVERSE)
  if(first LESS 0 OR NOT first EQUAL last)
    message(FATAL_ERROR "gsp: ${file} is not the Kokkos 4.7.00 that this patch is for: '${from}' does not stand there exactly once")
  endif()
  string(REPLACE "${from}" "${to}" changed "${text}")
  set(text "${changed}" PARENT_SCOPE)
endfunction()

replace_once("    return cudaGraphAddDependencies(graph, from, to, numDependencies);\n"
"#if CUDART_VERSION >= 13000
    return cudaGraphAddDependencies(graph, from, to, nullptr, numDependencies);
#else
    return cudaGraphAddDependencies(graph, from, to, numDependencies);
#endif\n")
replace_once("    return cudaMemPrefetchAsync(devPtr, count, dstDevice, m_stream);\n"
"#if CUDART_VERSION >= 13000
    cudaMemLocation const where{cudaMemLocationTypeDevice, dstDevice};
    return cudaMemPrefetchAsync(devPtr, count, where, 0, m_stream);
#else
    return cudaMemPrefetchAsync(devPtr, count, dstDevice, m_stream);
#endif\n")
file(WRITE "${file}" "${text}")
