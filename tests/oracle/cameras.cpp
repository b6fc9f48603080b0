// Cameras of a model, in all modes, against MuJoCo: places and axes (cam_xpos, cam_xmat), what a picture shows (mjv_cameraFrustum), and
// where in pictures things are (camprojection).
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/dynamics/kinematics.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/io/write_mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/sensor/camera_sensor.hpp>
#include <limits>

#include "dynamics/random_tree.hpp"
#include "oracle/load.hpp"
#include "support/kernels.hpp"

namespace {
using Exec = Kokkos::DefaultHostExecutionSpace;

char const* const text =
    R"(<mujoco><worldbody><camera name="world" pos="0 -3 1" xyaxes="1 0 0 0 .3 1" fovy="60" resolution="640 480"/>
    <body name="a" pos="0 0 1"><freejoint/><geom type="box" size=".1 .2 .05" pos=".02 .01 0"/>
      <camera name="sensor" pos=".1 0 .2" euler="90 10 0" sensorsize=".004 .003" focal=".002 .0025" resolution="320 200"/>
      <camera name="off" pos=".1 0 .2" euler="90 10 0" sensorsize=".004 .003" focal=".002 .0025" principal=".0003 -.0002" resolution="320 200"/>
      <camera name="pixels" euler="90 10 0" sensorsize=".004 .003" focalpixel="150 170" principalpixel="11 7" resolution="320 200"/>
      <camera name="track" mode="track" pos="0 -2 .5" euler="60 0 0"/><camera name="trackcom" mode="trackcom" pos="0 -2 .5" euler="60 0 0"/>
      <body name="b" pos=".2 0 0"><joint axis="0 1 0"/><geom type="capsule" size=".03 .1" pos="0 .02 .1"/></body></body>
    <body name="e" pos="1 0 1"><camera name="target" mode="targetbody" target="b" pos=".1 2 .3"/><camera name="targetcom" mode="targetbodycom" target="a" pos=".1 2 .3"/>
      <joint type="slide" axis="0 0 1"/><geom type="sphere" size=".1" pos="0 .03 0"/></body></worldbody></mujoco>)";
}  // namespace

// Matrices are rounded to float: 2^-24 relative, of places up to 4 m; MuJoCo's frustum is float too.
TEST_CASE("cameras in all modes, in 20 worlds") {
  auto const description = gsp::io::parse_mjcf(text, "cameras.xml");
  auto const oracle = gsp_test::load_oracle("cameras.xml", text);
  auto const written = gsp_test::load_oracle("written.xml", gsp::io::format_mjcf(description));
  mjModel* const m = oracle.m();
  mjData* const d = oracle.d();
  auto const compiled = gsp::compile(description);
  REQUIRE(compiled.ncam == m->ncam);
  Exec const exec;
  int const worlds = 20, width = 300, height = 170;
  auto const model = gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco});
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  std::vector<gsp::CameraMount> list;
  for (auto const& name : compiled.cam_name) list.push_back({.camera = name});
  auto mounts = gsp::make_camera_mounts(exec, model, compiled, list, {.worlds = worlds, .width = width, .height = height});
  auto cameras = gsp::make_cameras(exec, mounts.images());
  gsp_test::Random r;
  std::vector<double> xpos, xmat;
  for (int w = 0; w < worlds; ++w) {
    mj_resetData(m, d);
    std::vector<double> move(m->nv);
    for (auto& x : move) x = r();
    mj_integratePos(m, d->qpos, move.data(), 0.7);
    for (int i = 0; i < m->nq; ++i) state.qpos(w, i) = d->qpos[i];
    mj_forward(m, d);
    xpos.insert(xpos.end(), d->cam_xpos, d->cam_xpos + 3 * m->ncam);
    xmat.insert(xmat.end(), d->cam_xmat, d->cam_xmat + 9 * m->ncam);
  }
  gsp::forward_kinematics(exec, model, state, poses, dynamics);
  gsp::cameras_of(exec, model, poses, mounts, cameras);
  exec.fence();
  double worst = 0;
  for (int image = 0; image < mounts.images(); ++image) {
    double const *p = &xpos[3 * image], *R = &xmat[9 * image];
    double const sign[] = {1, -1, -1};
    for (int i = 0; i < 3; ++i) {
      double t = 0;
      for (int j = 0; j < 3; ++j) {
        double const axis = sign[i] * R[3 * j + i];
        t -= axis * p[j];
        worst = std::fmax(worst, std::abs(cameras.viewmats(image, i, j) - axis));
      }
      worst = std::fmax(worst, std::abs(cameras.viewmats(image, i, 3) - t) / 4);
    }
  }
  CHECK(worst < 1.2e-7);

  for (int c = 0; c < m->ncam; ++c) {
    CAPTURE(compiled.cam_name[c]);
    for (mjModel const* of : {static_cast<mjModel const*>(m), static_cast<mjModel const*>(written.m())}) {
      mjvCamera view;
      mjv_defaultCamera(&view);
      view.type = mjCAMERA_FIXED;
      view.fixedcamid = c;
      float zver[2], zhor[2], zclip[2];
      mjv_cameraFrustum(zver, zhor, zclip, of, &view);
      // the frustum at the near plane: to the bottom, top; left, right. Without a sensor it is as wide as the picture
      double const K[] = {cameras.Ks(c, 0, 0), cameras.Ks(c, 1, 1), cameras.Ks(c, 0, 2), cameras.Ks(c, 1, 2)};
      double const near = zclip[0];
      CHECK(K[3] / K[1] == doctest::Approx(zver[1] / near).epsilon(1e-6));             // above the axis
      CHECK((height - K[3]) / K[1] == doctest::Approx(zver[0] / near).epsilon(1e-6));  // below it
      if (compiled.cam_sensor_size[c][0] > 0) {
        CHECK(K[2] / K[0] == doctest::Approx(zhor[0] / near).epsilon(1e-6));  // left of it
        CHECK((width - K[2]) / K[0] == doctest::Approx(zhor[1] / near).epsilon(1e-6));
      } else {
        CHECK(K[0] == K[1]);
        CHECK(K[2] == 0.5 * width);
      }
    }
  }
}

// A red, a green and a blue ball of 2 mm stand on three sites, one on each link and one in the world: in pictures of cameras in all modes
// the centre of each colour's light is where MuJoCo's camprojection has the site (which leaves the principal point out: K has it). A ball
// is 0.55 pixels wide by the blur of projection and less than two by its own size; its centre of light is off by the square of its
// half angle of view, 1e-5, and by tails cut at 1/255 of unequal pixels: 0.02 pixels.
TEST_CASE("sites are in pictures where camprojection has them, in 20 worlds") {
  std::string model_text = text, sensors = "<sensor>";
  auto const put = [&](std::string const& behind, std::string const& what) {
    auto const at = model_text.find(behind);
    REQUIRE(at != std::string::npos);
    model_text.insert(at + behind.size(), what);
  };
  put("<worldbody>", "<site name='red' pos='.3 -.2 .6'/>");
  put("<freejoint/>", "<site name='green' pos='.1 .3 .15'/>");
  put("<joint axis=\"0 1 0\"/>", "<site name='blue' pos='.1 -.2 .2'/>");
  auto const without = gsp::io::parse_mjcf(text, "cameras.xml");
  std::vector<std::string> names;
  for (auto const& body : without.bodies)
    for (auto const& camera : body.cameras) names.push_back(camera.name);
  char const* const sites[] = {"red", "green", "blue"};
  for (auto const& name : names)
    for (char const* const site : sites) sensors += "<camprojection site='" + std::string(site) + "' camera='" + name + "'/>";
  for (auto at = model_text.find("mode="); at != std::string::npos; at = model_text.find("mode=", at + 40))
    model_text.insert(at, "resolution=\"320 240\" ");
  model_text.replace(model_text.find("</mujoco>"), 9, sensors + "</sensor></mujoco>");
  auto const compiled = gsp::compile(gsp::io::parse_mjcf(model_text, "cameras.xml"));
  auto const oracle = gsp_test::load_oracle("cameras.xml", model_text);
  mjModel* const m = oracle.m();
  mjData* const d = oracle.d();
  Exec const exec;
  int const worlds = 20;
  auto const model = gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco});
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  gsp_test::Random r;
  std::vector<double> expected, places;
  for (int w = 0; w < worlds; ++w) {
    mj_resetData(m, d);
    std::vector<double> move(std::size_t(m->nv));
    for (auto& x : move) x = r();
    mj_integratePos(m, d->qpos, move.data(), 0.5);
    for (int i = 0; i < m->nq; ++i) state.qpos(w, i) = d->qpos[i];
    mj_forward(m, d);
    expected.insert(expected.end(), d->sensordata, d->sensordata + m->nsensordata);
    for (char const* const site : sites) {
      double const* const x = d->site_xpos + 3 * mj_name2id(m, mjOBJ_SITE, site);
      places.insert(places.end(), x, x + 3);
    }
  }
  gsp::forward_kinematics(exec, model, state, poses, dynamics);
  gsp::GaussianSet set;
  for (int i = 0; i < 3; ++i) {
    int const s = mj_name2id(m, mjOBJ_SITE, sites[i]);
    for (int c = 0; c < 3; ++c) {
      set.positions.push_back(float(m->site_pos[3 * s + c]));
      set.scales.push_back(0.002f);
      set.sh.push_back(c == i ? 1.7f : -1.8f);
    }
    set.body.push_back(m->site_bodyid[s]);
    for (float const q : {1.f, 0.f, 0.f, 0.f}) set.quats.push_back(q);
    set.opacities.push_back(0.99f);
  }
  auto const cloud = gsp::make_gaussians(exec, set);
  int compared = 0;
  double worst = 0;
  for (std::size_t k = 0; k < names.size(); ++k) {
    CAPTURE(names[k]);
    auto eye = gsp::make_camera_sensor(exec, model, compiled, cloud, {{.camera = names[k]}}, {.worlds = worlds});
    auto const& f = eye.frames;
    REQUIRE(f.width == m->cam_resolution[2 * k]);
    REQUIRE(f.height == m->cam_resolution[2 * k + 1]);
    gsp::see(exec, model, poses, cloud, eye);
    int here = 0;
    for (int w = 0; w < worlds; ++w)
      for (int i = 0; i < 3; ++i) {
        double const* const pixel = &expected[std::size_t(w * m->nsensordata + int(6 * k) + 2 * i)];
        double const u = pixel[0] + eye.cameras.Ks(w, 0, 2) - 0.5 * f.width, v = pixel[1] + eye.cameras.Ks(w, 1, 2) - 0.5 * f.height;
        double z = eye.cameras.viewmats(w, 2, 3), light = 0, row = 0, column = 0;
        for (int c = 0; c < 3; ++c) z += eye.cameras.viewmats(w, 2, c) * places[std::size_t(9 * w + 3 * i + c)];
        if (z < 0.1 || !(u > 8 && u < f.width - 8 && v > 8 && v < f.height - 8)) continue;
        for (int y = 0; y < f.height; ++y)
          for (int x = 0; x < f.width; ++x) {
            double const a = f.rgb(w, y, x, i);
            light += a;
            row += a * (y + 0.5);
            column += a * (x + 0.5);
          }
        CHECK(light > 0);
        ++here;
        worst = std::fmax(worst, std::fmax(std::abs(column / light - u), std::abs(row / light - v)));
      }
    CHECK(here > 5);
    compared += here;
  }
  MESSAGE(compared << " sites, " << worst << " pixels");
  CHECK(worst < 0.02);
}
