#include <doctest/doctest.h>

#include <gsp/model/compile.hpp>
#include <gsp/model/names.hpp>
#include <gsp/model/samples.hpp>

using namespace gsp;

TEST_CASE("indices by name, and what is near where there is none") {
  auto d = samples::quadruped();
  d.sensors.push_back({.type = "clock"});
  d.sensors.push_back({.name = "time", .type = "clock"});
  d.sensors.push_back({.name = "base_link_clock", .type = "clock"});
  auto const m = compile(d);
  for (int i = 0; i < m.nbody; ++i) CHECK(body_id(m, m.body_name[i]) == i);
  for (int i = 0; i < m.njnt; ++i) CHECK(joint_id(m, m.jnt_name[i]) == i);
  for (int i = 0; i < m.nu; ++i) CHECK(actuator_id(m, m.act_name[i]) == i);
  CHECK(sensor_id(m, "time") == 1);
  CHECK(keyframe_id(m, m.keyframes.at(0).name) == 0);
  CHECK_THROWS_WITH_AS(body_id(m, "trank"), doctest::Contains("gsp::body_id: the model has no body 'trank'; nearest: 'trunk', "), Error);
  CHECK_THROWS_WITH_AS(sensor_id(m, "tme"), "gsp::sensor_id: the model has no sensor 'tme'; nearest: 'time', 'base_link_clock'", Error);
  CHECK_THROWS_WITH_AS(sensor_id(m, "base"), doctest::Contains("nearest: 'base_link_clock', 'time'"), Error);  // what it is a part of
  CHECK_THROWS_WITH_AS(sensor_id(m, ""), doctest::Contains("no sensor ''"), Error);                            // an empty name is nobody's
  CHECK_THROWS_WITH_AS(tendon_id(m, "front"), "gsp::tendon_id: the model has no tendon 'front': none of its 0 has a name; give an index",
                       Error);
}

TEST_CASE("edits are insertions, deletions and replacements") {
  CHECK(detail::edits("kitten", "sitting") == 3);
  CHECK(detail::edits("", "abc") == 3);
  CHECK(detail::edits("flaw", "lawn") == 2);
}
