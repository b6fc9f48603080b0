#pragma once
#include <cmath>
#include <cstdio>
#include <gsp/math/scalar.hpp>
#include <gsp/model/fields.hpp>
#include <limits>
#include <string>

/// Which numbers of a compiled model precision R cannot hold. Host.
namespace gsp::detail {

/// "body 'arm'", "dof 3 (joint 'elbow')"
inline std::string item_text(CompiledModel const& m, ModelItem item, int i) {
  auto const named = [&](char const* what, auto const& names, int k) {
    bool const has_name = k < int(names.size()) && !names[std::size_t(k)].empty();
    return std::string(what) + " " + (has_name ? "'" + names[std::size_t(k)] + "'" : std::to_string(k));
  };
  auto const dof = [&](int d) { return "dof " + std::to_string(d) + " (" + named("joint", m.jnt_name, m.dof_jnt[std::size_t(d)]) + ")"; };
  auto const joint_of_position = [&](int q) {
    int j = 0;
    while (j + 1 < m.njnt && m.jnt_qposadr[std::size_t(j) + 1] <= q) ++j;
    return named("joint", m.jnt_name, j);
  };
  switch (item) {
    case ModelItem::world:
      return "option";
    case ModelItem::body:
      return named("body", m.body_name, i);
    case ModelItem::joint:
      return named("joint", m.jnt_name, i);
    case ModelItem::position:
      return joint_of_position(i);
    case ModelItem::dof:
      return dof(i);
    case ModelItem::tendon:
      return named("tendon", m.tendon_name, i);
    case ModelItem::actuator:
      return named("actuator", m.act_name, i);
    case ModelItem::equality:
      return named("equality", m.eq_name, i);
    case ModelItem::geom:
      return named("geom", m.geom_name, i);
    case ModelItem::site:
      return named("site", m.site_name, i);
    case ModelItem::camera:
      return named("camera", m.cam_name, i);
    case ModelItem::term:
      return "term " + std::to_string(i) + " of the fixed tendons";
    case ModelItem::wrap:
      break;
  }
  return "point " + std::to_string(i) + " of the tendons' paths";
}

/// Whether 1 / x is taken of the field's numbers: one that is not 0 may not become 0, nor so small that it has lost its digits.
inline bool divides(ModelField field) {
  return field == ModelField::body_mass || field == ModelField::body_inertia || field == ModelField::wrap_divisor ||
         field == ModelField::cam_focal;
}

/// Refuses a number that R cannot hold. @param where  callable, for the sentence
template <class R, class Where>
void expects_held(double x, bool divides, char const* name, Where const& where) {
  using Limits = std::numeric_limits<real_t<R>>;
  bool const beyond = std::isfinite(x) && std::abs(x) > double(Limits::max()),
             lost = divides && x != 0 && std::abs(x) < double(Limits::min());
  if (!beyond && !lost) return;
  char number[32], bound[32];
  std::snprintf(number, sizeof number, "%.6g", x);
  std::snprintf(bound, sizeof bound, "%.2g", double(beyond ? Limits::max() : Limits::min()));
  throw Error(where() + ": " + name + " " + number + (beyond ? " is beyond " : " is divided by, and is less than ") + bound +
              (sizeof(real_t<R>) == 4 ? ", which float holds: take double precision, or give " : ": give ") +
              (beyond ? "a smaller number" : "a larger number"));
}

/// All numbers of a field.
template <class R>
void expects_held(CompiledModel const& m, ModelFieldInfo const& field, std::vector<double> const& values) {
  if (field.use.keeps_infinite) return;  // no limit, then
  for (std::size_t k = 0; k < values.size(); ++k)
    expects_held<R>(values[k], divides(field.field), field.name,
                    [&] { return item_text(m, field.item, int(k / std::size_t(field.components))); });
}

/// What is of no field: options, and what geoms bring to contacts.
template <class R>
void expects_held(CompiledModel const& m, double timestep) {
  auto const option = [] { return std::string("option"); };
  expects_held<R>(timestep, true, "timestep", option);
  expects_held<R>(m.option.density, false, "density", option);
  expects_held<R>(m.option.viscosity, false, "viscosity", option);
  expects_held<R>(m.option.impratio, true, "impratio", option);
  auto const geoms = [&](char const* name, auto const& values) {
    for (std::size_t g = 0; g < values.size(); ++g) {
      auto const check = [&](double x) { expects_held<R>(x, false, name, [&] { return item_text(m, ModelItem::geom, int(g)); }); };
      if constexpr (requires { values[g].size(); })
        for (double const x : values[g]) check(x);
      else
        check(values[g]);
    }
  };
  geoms("friction", m.geom_friction);
  geoms("solref", m.geom_solref);
  geoms("solimp", m.geom_solimp);
  geoms("solmix", m.geom_solmix);
  geoms("margin", m.geom_margin);
  geoms("gap", m.geom_gap);
}

}  // namespace gsp::detail
