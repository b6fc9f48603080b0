#pragma once
#include <cmath>
#include <gsp/core/detail/views.hpp>
#include <gsp/model/names.hpp>
#include <gsp/model/state.hpp>
#include <string>
#include <string_view>
#include <vector>

/// Worlds to a keyframe of the model, as MuJoCo's mj_resetDataKeyframe.
namespace gsp {

namespace detail {
/// All numbers of a view of one world. Fences.
template <class Exec, class View>
void upload_numbers(Exec const& exec, std::vector<double> const& from, View const& to) {
  using R = typename View::value_type;
  std::vector<R> const numbers(from.begin(), from.end());
  upload_bytes(exec, to.data(), numbers.data(), numbers.size() * sizeof(R));
  exec.fence("gsp::model::keyframe: the host array may go now");
}

/// The key as a state of one world.
template <class R, class Mem, class Exec>
State<R, Mem> keyframe_state(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled, int key) {
  std::string const where = "gsp::set_keyframe: ";
  auto const n = int(compiled.keyframes.size());
  expects(n > 0, where + "the model has no keyframes: give it one, or call reset");
  expects(key >= 0 && key < n, where + "the model has " + std::to_string(n) + (n == 1 ? " keyframe" : " keyframes") + ", and number " +
                                   std::to_string(key) + " is asked for: give 0" + (n == 1 ? "" : " to " + std::to_string(n - 1)) +
                                   ", or a name");
  expects(model.nq == compiled.nq && model.nv == compiled.nv && model.na == compiled.na && model.nu == compiled.nu &&
              model.nmocap == compiled.nmocap,
          where + "the model was made of another compiled model: give the one that make_model had");
  auto const& k = compiled.keyframes[std::size_t(key)];
  auto const bounded = [&](char const* what, std::vector<double> const& numbers) {
    for (std::size_t i = 0; i < numbers.size(); ++i)
      if (!(std::abs(numbers[i]) <= state_bound))
        throw Error(where + "number " + std::to_string(i) + " of the " + what + " of keyframe " + std::to_string(key) +
                    " is beyond 1e10, where worlds stop: correct it");
  };
  bounded("qpos", k.qpos);
  bounded("qvel", k.qvel);
  bounded("act", k.act);
  auto state = make_state(exec, model, {.worlds = 1});
  std::vector<double> low(k.qpos.size());
  for (std::size_t i = 0; i < low.size(); ++i) low[i] = k.qpos[i] - double(real_t<R>(k.qpos[i]));
  upload_numbers(exec, k.qpos, state.qpos);
  upload_numbers(exec, low, state.qpos_low);
  upload_numbers(exec, k.qvel, state.qvel);
  upload_numbers(exec, k.act, state.act);
  upload_numbers(exec, k.ctrl, state.ctrl);
  upload_numbers(exec, k.mpos, state.mocap_pos);
  upload_numbers(exec, k.mquat, state.mocap_quat);
  return state;
}
}  // namespace detail

/// Worlds of the mask to a keyframe: its qpos, qvel, act, ctrl and mocap poses (what the file leaves out: the model's initial values), and
/// all else as `reset` does: no forces, equalities as the model says, no status bits, time 0 (the key's own is
/// compiled.keyframes[key].time), no impulses of the last step. Also what rounding takes from the positions (qpos_low), as the program's
/// --keyframe. Allocates a state of one world, waits. Again and again: once into a state of one world, from which `reset`
/// starts without either.
/// Errors: std::invalid_argument for an index that is not there and for those of reset; Error for a name that is not there, with the
/// nearest ones, and for numbers beyond state_bound.
/// @param compiled  of which make_model made the model
/// @param key       index from 0, or name
/// @param mask      callable with a world, such as a View<bool*> on the device; the other worlds keep all they have
template <class R, ExecutionSpace Exec, class Mem, class Mask>
requires requires(Mask const& mask) { bool(mask(0)); }
void set_keyframe(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled, int key, State<R, Mem>& state,
                  Mask const& mask) {
  auto const start = detail::keyframe_state(exec, model, compiled, key);
  reset(exec, model, state, mask, start);
  exec.fence("gsp::model::set_keyframe: the state of one world may go now");
}
template <class R, ExecutionSpace Exec, class Mem, class Mask>
requires requires(Mask const& mask) { bool(mask(0)); }
void set_keyframe(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled, std::string_view key, State<R, Mem>& state,
                  Mask const& mask) {
  set_keyframe(exec, model, compiled, compiled.keyframes.empty() ? 0 : keyframe_id(compiled, key), state, mask);
}

/// All worlds.
template <class R, ExecutionSpace Exec, class Mem>
void set_keyframe(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled, int key, State<R, Mem>& state) {
  set_keyframe(exec, model, compiled, key, state, detail::AllWorlds{});
}
template <class R, ExecutionSpace Exec, class Mem>
void set_keyframe(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled, std::string_view key, State<R, Mem>& state) {
  set_keyframe(exec, model, compiled, key, state, detail::AllWorlds{});
}

}  // namespace gsp
