// fwd.hpp and gsp.hpp, and the regions that profilers see.
#include <gsp/fwd.hpp>
#if defined(KOKKOS_VERSION) || defined(_GLIBCXX_STRING)
#error "gsp/fwd.hpp names types only: it includes nothing"
#endif

namespace {
// what a header of a user mentions with names alone
template <class R, class Mem>
struct Mine {
  gsp::Model<R, Mem> const* model;
  gsp::State<R, Mem>* state;
  gsp::Simulation<R, Mem>* simulation;
  gsp::Frames<Mem>* frames;
};
gsp::CompiledModel load(gsp::Description const& description);
}  // namespace

#include <gsp/gsp.hpp>
#include <support/kokkos_tools.hpp>
#include <type_traits>

namespace {
gsp::CompiledModel load(gsp::Description const& description) { return gsp::compile(description); }

std::vector<std::string> told;
void push(char const* name) { told.push_back(name); }
void pop() { told.push_back("end"); }
}  // namespace

TEST_CASE("names of fwd.hpp are those of the headers") {
  using Mem = Kokkos::HostSpace;
  Mine<float, Mem> const mine{};
  static_assert(std::is_same_v<decltype(*mine.model), gsp::Model<float, Mem> const&>);
  static_assert(sizeof(gsp::Dynamics<float, Mem>) > 0 && sizeof(gsp::Poses<float, Mem>) > 0 && sizeof(gsp::RungeKutta<float, Mem>) > 0);
  static_assert(sizeof(gsp::CollisionModel<float, Mem>) > 0 && sizeof(gsp::Contacts<float, Mem>) > 0 && sizeof(gsp::Rows<float, Mem>) > 0);
  static_assert(sizeof(gsp::Newton<float, Mem>) > 0 && sizeof(gsp::Simulation<float, Mem>) > 0 && sizeof(gsp::Gaussians<Mem>) > 0 &&
                sizeof(gsp::Cameras<Mem>) > 0);
  static_assert(sizeof(gsp::Frames<Mem>) > 0 && sizeof(gsp::Field<float>) > 0 && sizeof(gsp::GaussianSet) > 0 && sizeof(gsp::Error) > 0);
  static_assert(sizeof(gsp::ModelOptions) + sizeof(gsp::StateOptions) + sizeof(gsp::SimulationOptions) + sizeof(gsp::StepOptions) > 0);
  static_assert(sizeof(gsp::PgsOptions) + sizeof(gsp::FrameOptions) + sizeof(gsp::RenderOptions) > 0);
#if defined(GSP_IO)
  static_assert(sizeof(gsp::io::MjcfOptions) + sizeof(gsp::io::UrdfOptions) + sizeof(gsp::io::SplatSet) > 0);
#endif
  CHECK(mine.model == nullptr);
  CHECK(load(gsp::samples::pendulum()).nv == 1);
}

TEST_CASE("a region is told to the tool that listens when it opens, and to nobody else") {
  namespace tools = Kokkos::Tools::Experimental;
  auto const before = tools::get_callbacks();
  { gsp::Region const unheard("gsp::test::unheard"); }
  CHECK(told.empty());
  {
    gsp::Region const early("gsp::test::early");
    tools::set_push_region_callback(push);
    tools::set_pop_region_callback(pop);
    gsp::Region const outer("gsp::test::outer");
    { gsp::Region const inner("gsp::test::inner"); }
  }
  tools::set_callbacks(before);
  CHECK(told == std::vector<std::string>{"gsp::test::outer", "gsp::test::inner", "end", "end"});
}
