// A program of someone else: a kernel over gsp::gsp, and one call into each library that gsp::io brings.
#include <Kokkos_Core.hpp>
#include <cstdio>
#include <gsp/core/check.hpp>
#if defined(WITH_IO)
#include <libqhull_r/libqhull_r.h>
#include <stb/stb_image.h>
#include <zlib.h>

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <pugixml.hpp>
#endif

template <class Exec>
int sum_of_squares(Exec const& exec, int n) {
  gsp::expects(n > 0, "sum_of_squares: n must be positive");
  int sum = 0;
  Kokkos::parallel_reduce(
      "consumer::sum_of_squares", Kokkos::RangePolicy<Exec>(exec, 0, n), KOKKOS_LAMBDA(int i, int& s) { s += i * i; }, sum);
  return sum;
}

int main(int argc, char** argv) {
  Kokkos::ScopeGuard kokkos(argc, argv);
  if (sum_of_squares(Kokkos::DefaultExecutionSpace{}, 10) != 285) return 1;
#if defined(WITH_IO)
  pugi::xml_document document;
  if (!document.load_string("<mujoco model='x'/>")) return 2;
  if (crc32(0, reinterpret_cast<Bytef const*>("gsp"), 3) == 0) return 3;
  int width = 0, height = 0, channels = 0;
  if (stbi_info_from_memory(reinterpret_cast<stbi_uc const*>("nothing"), 7, &width, &height, &channels) != 0) return 4;
  if (nlohmann::json::parse("[1, 2]").size() != 2) return 5;
  if (Eigen::Vector3d(1, 2, 2).norm() != 3) return 6;
  qhT hull;
  qh_zero(&hull, stderr);
  qh_freeqhull(&hull, !qh_ALL);
#endif
  std::puts("consumer: gsp works from an install");
  return 0;
}
