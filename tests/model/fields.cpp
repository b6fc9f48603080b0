// The table of the model's fields: complete, and what make_model, world values and the page say is what it says.
#include <doctest/doctest.h>

#include <algorithm>
#include <fstream>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/model/world_values.hpp>
#include <set>
#include <sstream>

#include "support/kernels.hpp"

namespace {
using gsp::ModelField;
using gsp::ModelItem;
using M = gsp::Model<double, Kokkos::HostSpace>;

constexpr std::pair<ModelItem, char const*> items[] = {
    {ModelItem::world, "the world"},   {ModelItem::body, "body"},         {ModelItem::joint, "joint"},   {ModelItem::position, "position"},
    {ModelItem::dof, "dof"},           {ModelItem::term, "term"},         {ModelItem::tendon, "tendon"}, {ModelItem::wrap, "wrap"},
    {ModelItem::actuator, "actuator"}, {ModelItem::equality, "equality"}, {ModelItem::geom, "geom"},     {ModelItem::site, "site"},
    {ModelItem::camera, "camera"}};

/// The rows of the page's table: what may be per world. *: constants follow from it; in italics: these constants.
std::vector<std::string> page_rows() {
  std::vector<std::string> rows;
  for (auto const& [item, name] : items) {
    std::string list;
    for (ModelField const field : gsp::model_fields()) {
      auto const f = gsp::info(field);
      if (f.item != item || !f.use.per_world) continue;
      list +=
          (list.empty() ? "" : ", ") + (f.use.follows ? "_" + std::string(f.name) + "_" : std::string(f.name) + (f.use.decides ? "*" : ""));
      if (f.components > 1) list += " " + std::to_string(f.components);
    }
    if (!list.empty()) rows.push_back("| " + std::string(name) + " | " + list + " |");
  }
  return rows;
}
}  // namespace

TEST_CASE("each field of the model has one row") {
  std::set<ModelField> fields;
  std::set<std::string> names;
  std::vector<char const*> places;
  M const model;
  for (auto const& row : gsp::detail::field_table<M>()) {
    fields.insert(row.field);
    names.insert(row.name);
    places.push_back(reinterpret_cast<char const*>(&(model.*row.member)));
    CHECK(gsp::find_field(row.name) == row.field);
    CHECK(gsp::info(row.field).name == std::string(row.name));
  }
  std::size_t const n = places.size();
  CHECK(fields.size() == n);
  CHECK(names.size() == n);
  // the fields lie in the model one after the other: a member without a row would leave a gap, two rows of a member would meet
  std::sort(places.begin(), places.end());
  for (std::size_t i = 1; i < n; ++i) CHECK(places[i] - places[i - 1] == sizeof(gsp::Field<double>));
  CHECK(places.back() + sizeof(gsp::Field<double>) == reinterpret_cast<char const*>(&model.archetypes));
  auto const has_row = [&](void const* member) {
    return std::binary_search(places.begin(), places.end(), static_cast<char const*>(member));
  };
  CHECK(has_row(&model.gravity));
  CHECK(has_row(&model.body_slider));
  CHECK_THROWS_WITH_AS(gsp::find_field("body_colour"), doctest::Contains("no field 'body_colour'"), gsp::Error);
}

TEST_CASE("the model holds as many numbers of a field as the table says") {
  Kokkos::DefaultHostExecutionSpace const exec;
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const model = gsp::make_model<double>(exec, compiled);
  // fields are one after the other in Model::reals, in the order of the table
  double const* next = model.reals.data();
  for (auto const& row : gsp::detail::field_table<M>()) {
    CAPTURE(std::string(row.name));
    CHECK((model.*row.member).data == next);
    int const n = gsp::detail::count(model, row.item);
    next += n < 0 ? int(row.item == ModelItem::term ? compiled.term_coef.size() : compiled.wrap_divisor.size()) : n * row.components;
  }
  CHECK(model.body_mass(0, 3) == compiled.body_mass[3]);
  CHECK(model.geom_size(0, 3 * 2 + 1) == compiled.geom_size[2][1]);
  CHECK(model.act_gear(0, 6) == compiled.act_gear[1][0]);

  auto wrong = compiled;
  wrong.jnt_margin.push_back(0);
  CHECK_THROWS_WITH_AS(gsp::make_model<double>(exec, wrong), doctest::Contains("numbers for jnt_margin"), gsp::Error);
  wrong = compiled;
  wrong.body_gravcomp.clear();
  CHECK(gsp::make_model<double>(exec, wrong).body_gravcomp(0, compiled.nbody - 1) == 0);  // what is left empty is zero
}

TEST_CASE("what cannot be per world is refused") {
  Kokkos::DefaultHostExecutionSpace const exec;
  auto model = gsp::make_model<double>(exec, gsp::compile(gsp::samples::quadruped()));
  for (ModelField const field : gsp::model_fields()) {
    auto const f = gsp::info(field);
    CAPTURE(std::string(f.name));
    if (f.use.per_world)
      CHECK_NOTHROW(gsp::make_per_world(exec, model, {field}, 2));
    else
      CHECK_THROWS_WITH_AS(gsp::make_per_world(exec, model, {field}, 2), doctest::Contains("is the same for all worlds"),
                           std::invalid_argument);
    auto const& row = gsp::detail::field_row<M>(field);
    bool const any = gsp::detail::count(model, row.item) > 0;
    CHECK((model.*row.member).stride == (f.use.per_world && any ? gsp::detail::count(model, row.item) * f.components : 0));
  }
}

TEST_CASE("the page lists what the table holds") {
  std::ifstream file(std::string(GSP_TEST_DIR) + "/../docs/model/world_values.md");
  REQUIRE(file);
  std::stringstream page;
  page << file.rdbuf();
  for (auto const& row : page_rows()) {
    CAPTURE(row);  // what belongs there
    CHECK(page.str().find(row) != std::string::npos);
  }
}
