#pragma once
#include <gsp/constraint/contact_forces.hpp>
#include <gsp/core/region.hpp>
#include <gsp/core/status.hpp>
#include <gsp/model/detail/sizes.hpp>
#include <gsp/sensor/accelerations.hpp>
#include <gsp/sensor/detail/body_contacts_kernels.hpp>
#include <string>
#include <type_traits>
#include <vector>

/// Contacts of chosen bodies as arrays over worlds, as learning takes them: net forces and their friction, forces by partner, and for how
/// long a body has touched, or not.
namespace gsp {

struct BodyContactsOptions {
  int worlds = 1;
  std::vector<int> bodies = {};    // whose contacts; empty: of all bodies but the world
  std::vector<int> partners = {};  // bodies of force_matrix; empty: none
  int history = 0;                 // forces of so many updates are kept
  double threshold = 0;            // [N] a body touches while the sum of its contacts' forces by absolute value is above it
};

/// Of B bodies and P partners in all worlds. `make_body_contacts` allocates it. Forces act on the body, in world axes.
template <class R, class Mem>
struct BodyContacts {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0;
  R threshold = R(0);
  detail::ModelSizes model{};                  // host: of which model
  View<int*> bodies, partners;                 // (B), (P) body indices
  View<R***> force, friction;                  // (world, B, 3) sum over the body's contacts [N]; friction: what is along their planes
  View<R****> force_matrix;                    // (world, B, P, 3) of those with a partner [N]
  View<R****> force_history;                   // (world, history, B, 3) force at the last updates, 0: the newest [N]
  View<R***> position;                         // (world, B, 3) centre of the contacts' points, weighted by their forces [m]; 0: none pushes
  View<int**> found;                           // (world, B) contacts, also those in the gap, which do not push
  View<R**> air_time, contact_time;            // (world, B) [s] since it has touched last, and since when it touches; one of them is 0
  View<R**> last_air_time, last_contact_time;  // (world, B) [s] how long it was, when it ended last
  View<R**> load;                              // (world, B) sum of the contacts' forces by absolute value [N]
  int count() const { return int(bodies.extent(0)); }
};

/// Allocates; fences. Errors: std::invalid_argument for worlds < 1, bodies that the model does not have or that have no geom, and a
/// threshold or history below 0.
template <class R, ExecutionSpace Exec, class Mem>
BodyContacts<R, Mem> make_body_contacts(Exec const& exec, Model<R, Mem> const& model, BodyContactsOptions options = {}) {
  expects(options.worlds > 0, "gsp::make_body_contacts: worlds must be positive and is " + std::to_string(options.worlds));
  expects(options.threshold >= 0, "gsp::make_body_contacts: threshold must be a number, 0 or more");
  expects(options.history >= 0, "gsp::make_body_contacts: history must be 0 or more");
  bool const chosen = !options.bodies.empty();
  if (!chosen)
    for (int b = 1; b < model.nbody; ++b) options.bodies.push_back(b);
  for (auto const* list : {&options.bodies, &options.partners})
    for (int b : *list)
      expects(b >= 0 && b < model.nbody, "gsp::make_body_contacts: there is no body " + std::to_string(b) + ": the model has " +
                                             std::to_string(model.nbody) + ", numbered from 0; body_id(compiled, name) finds one");
  if (chosen) {
    std::vector<bool> has_geom(std::size_t(model.nbody), false);
    for (int const b : detail::to_host(exec, model.geom_body)) has_geom[std::size_t(b)] = true;
    for (int const b : options.bodies)
      expects(has_geom[std::size_t(b)], "gsp::make_body_contacts: body " + std::to_string(b) +
                                            " has no geom, so that nothing ever touches it: name the body that its geoms are of");
  }
  BodyContacts<R, Mem> c;
  int const n = options.worlds, bodies = int(options.bodies.size()), partners = int(options.partners.size());
  c.worlds = n;
  c.threshold = R(options.threshold);
  c.model = detail::sizes_of(model);
  c.bodies = detail::to_device<decltype(c.bodies)>(exec, "gsp::BodyContacts::bodies", options.bodies);
  c.partners = detail::to_device<decltype(c.partners)>(exec, "gsp::BodyContacts::partners", options.partners);
  auto const make = [&](auto& view, char const* label, auto... items) {
    view = detail::allocate_zero<std::decay_t<decltype(view)>>(exec, label, n, bodies, items...);
  };
  make(c.force, "gsp::BodyContacts::force", 3);
  make(c.friction, "gsp::BodyContacts::friction", 3);
  make(c.force_matrix, "gsp::BodyContacts::force_matrix", partners, 3);
  c.force_history =
      detail::allocate_zero<decltype(c.force_history)>(exec, "gsp::BodyContacts::force_history", n, options.history, bodies, 3);
  make(c.position, "gsp::BodyContacts::position", 3);
  make(c.found, "gsp::BodyContacts::found");
  make(c.air_time, "gsp::BodyContacts::air_time");
  make(c.contact_time, "gsp::BodyContacts::contact_time");
  make(c.last_air_time, "gsp::BodyContacts::last_air_time");
  make(c.last_contact_time, "gsp::BodyContacts::last_contact_time");
  make(c.load, "gsp::BodyContacts::load");
  return c;
}

/// force, friction, force_matrix, position, found and load: of the contacts whose forces were solved for last: of the state as it is after
/// `forward`, of the start of the last step after `step`.
/// @param collision, contacts, rows, impulses  as for contact_forces
/// One launch, a thread a body and world, each through the world's contacts in the order of their list: the same bits for any batch. Cost:
/// a binary search for each contact of the body. Does not allocate, does not fence. Errors: those of contact_forces; contacts of bodies of
/// another model or number of worlds.
template <ExecutionSpace Exec, class R, class Mem>
void body_contacts(Exec const& exec, Model<R, Mem> const& model, CollisionModel<R, Mem> const& collision, Contacts<R, Mem> const& contacts,
                   Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses, BodyContacts<R, Mem>& of) {
  Region const region("gsp::sensor::body_contacts");
  constexpr char const* where = "gsp::body_contacts";
  expects(of.model == detail::sizes_of(model), where, "the contacts of bodies were made for another model: make_body_contacts with this");
  detail::expects_as_many(where, "worlds", "make both with the same {.worlds = n}", detail::Count{"contacts", contacts.worlds},
                          detail::Count{"contacts of bodies", of.worlds});
  detail::expects_contact_forces(where, model, collision, contacts, rows, impulses);
  Kokkos::parallel_for("gsp::sensor::body_contacts", Kokkos::RangePolicy<Exec>(exec, 0, of.worlds * of.count()),
                       detail::SumBodyContacts<R, Mem, BodyContacts<R, Mem>>{
                           detail::contact_force_of(model, collision, contacts, rows, impulses), of, detail::has_solution(rows, impulses)});
}

/// Times of contact and of flight go on by dt [s]: a body touches while its load is above the threshold; and force becomes the newest of
/// force_history. After body_contacts, once for each dt of the worlds' time. In a world that has stopped (status) they stay.
/// One launch; does not allocate, does not fence. Errors: std::invalid_argument for a negative dt, a state of another number of worlds.
template <ExecutionSpace Exec, class R, class Mem>
void update_contact_times(Exec const& exec, State<R, Mem> const& state, double dt, BodyContacts<R, Mem>& of) {
  Region const region("gsp::sensor::update_contact_times");
  expects(dt >= 0, "gsp::update_contact_times: dt must not be negative");
  detail::expects_as_many("gsp::update_contact_times", "worlds", "make both with the same {.worlds = n}",
                          detail::Count{"state", state.worlds}, detail::Count{"contacts of bodies", of.worlds});
  Kokkos::parallel_for("gsp::sensor::update_contact_times", Kokkos::RangePolicy<Exec>(exec, 0, of.worlds * of.count()),
                       detail::CountContactTimes<R, Mem, BodyContacts<R, Mem>>{state.status, of, R(dt)});
}

/// All of the worlds of the mask to zero, times and history too: with `reset` of the state.
/// @param mask  callable with a world, such as a View<bool*> on the device
/// One launch; does not allocate, does not fence. Errors: std::invalid_argument for a mask of another size.
template <ExecutionSpace Exec, class R, class Mem, class Mask>
requires requires(Mask const& mask) { bool(mask(0)); }
void reset_body_contacts(Exec const& exec, BodyContacts<R, Mem>& of, Mask const& mask) {
  Region const region("gsp::sensor::reset_body_contacts");
  detail::expects_mask("gsp::reset_body_contacts", mask, "contacts of bodies", of.worlds);
  Kokkos::parallel_for("gsp::sensor::reset_body_contacts", Kokkos::RangePolicy<Exec>(exec, 0, of.worlds * of.count()),
                       detail::ResetBodyContacts<BodyContacts<R, Mem>, Mask>{of, mask});
}

/// `to` goes on as `from` would have, to the bit: all that is read and remembered, of all worlds. Beside `save` and `restore` of a
/// simulation. Does not allocate, does not fence a device. Errors: std::invalid_argument for another number of worlds, bodies, partners or
/// updates that are kept.
template <ExecutionSpace Exec, class R, class Mem>
void copy_body_contacts(Exec const& exec, BodyContacts<R, Mem> const& from, BodyContacts<R, Mem>& to) {
  Region const region("gsp::sensor::copy_body_contacts");
  expects(from.worlds == to.worlds && from.count() == to.count() && from.partners.extent(0) == to.partners.extent(0) &&
              from.force_history.extent(1) == to.force_history.extent(1),
          "gsp::copy_body_contacts", "the two differ in worlds, bodies, partners or history: make both with the same options");
  auto const copy = [&](auto const& a, auto const& b) { detail::copy_view(exec, a, b); };
  copy(from.force, to.force);
  copy(from.friction, to.friction);
  copy(from.force_matrix, to.force_matrix);
  copy(from.force_history, to.force_history);
  copy(from.position, to.position);
  copy(from.found, to.found);
  copy(from.air_time, to.air_time);
  copy(from.contact_time, to.contact_time);
  copy(from.last_air_time, to.last_air_time);
  copy(from.last_contact_time, to.last_contact_time);
  copy(from.load, to.load);
}

/// Whether a body's touch (or flight) has begun within the last dt seconds: of contact_time(w, i), or air_time(w, i). For kernels of yours:
/// first_contact(of, w, i, dt).
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION bool first_contact(BodyContacts<R, Mem> const& of, int world, int i, std::type_identity_t<R> dt) {
  return of.contact_time(world, i) > R(0) && of.contact_time(world, i) < dt * R(1.000001);
}
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION bool first_air(BodyContacts<R, Mem> const& of, int world, int i, std::type_identity_t<R> dt) {
  return of.air_time(world, i) > R(0) && of.air_time(world, i) < dt * R(1.000001);
}

}  // namespace gsp
