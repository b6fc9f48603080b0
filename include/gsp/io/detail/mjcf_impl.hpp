#pragma once
#include <filesystem>
#include <functional>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/convex_parts.hpp>
#include <gsp/io/detail/mjcf_reader.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/mesh_hull.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/description.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>

namespace gsp::io {

namespace detail::mjcf {

/// The tree in depth-first order, keyframes of attached models spread over the whole, ranges inherited: what a Description holds.
class Finish {
 public:
  Finish(Session& session, ModelDraft draft, MjcfOptions const& options) : s_(session), draft_(std::move(draft)), options_(options) {}

  Description run() {
    d_.name = draft_.name;
    d_.option = draft_.option;
    d_.compiler = draft_.compiler;
    d_.bodies.clear();
    add(draft_.world, -1, false);
    auto& lists = draft_.lists;
    d_.meshes = std::move(draft_.meshes);
    d_.hfields = std::move(draft_.hfields);
    d_.tendons = std::move(lists.tendons);
    d_.equalities = std::move(lists.equalities);
    d_.sensors = std::move(lists.sensors);
    d_.pairs = std::move(lists.pairs);
    d_.excludes = std::move(lists.excludes);
    for (auto& act : lists.actuators) {
      if (act.inheritrange > 0) inherit(act);
      actuator_at_[act.id] = d_.actuators.size();
      act_at_[act.id] = na_;
      na_ += static_cast<std::size_t>(act_size(act.actuator));
      d_.actuators.push_back(std::move(act.actuator));
    }
    for (auto& key : draft_.keys) {
      if (key.attached) spread(key);
      d_.keyframes.push_back(std::move(key.key));
    }
    for (auto const& place : s_.files.stray_text)
      s_.report.add(ReportLine::Kind::no_effect, s_.files.names[std::size_t(place.file)], place.line, "text between elements");
    d_.files = s_.files.names;
    if (options_.convex_decomposition) split_into_convex_parts(d_);
    add_hulls(d_);
    d_.report = s_.report.take();
    return std::move(d_);
  }

 private:
  void add(BodyDraft& b, int parent, bool moves) {
    int const index = static_cast<int>(d_.bodies.size());
    moves = moves || !b.body.joints.empty();
    auto const& c = draft_.compiler;
    if (moves && b.needs_mesh.file >= 0 && (c.inertia_from_geom_always || (!b.body.has_inertial && !c.inertia_from_geom_never)))
      s_.files.fail(b.needs_mesh, "the mass of body " + in_quotes(b.body.name) +
                                      " comes from this visual mesh, which MjcfOptions::skip_visuals (--skip-visuals) leaves out; give the "
                                      "body an <inertial> or the geom mass=\"0\"");
    for (std::size_t i = 0; i < b.body.joints.size(); ++i) {
      auto const& j = b.body.joints[i];
      joint_at_[b.joint_ids[i]] = {qpos0_.size(), nv_};
      nv_ += static_cast<std::size_t>(qvel_size(j.type));
      if (j.type == JointType::free) qpos0_.insert(qpos0_.end(), b.body.pos.begin(), b.body.pos.end());
      auto const q = j.type == JointType::free ? b.body.quat : Double4{1, 0, 0, 0};
      if (j.type <= JointType::ball)
        qpos0_.insert(qpos0_.end(), q.begin(), q.end());
      else
        qpos0_.push_back(j.ref);
    }
    if (b.body.mocap) {
      mocap_at_[b.id] = mpos0_.size() / 3;
      mpos0_.insert(mpos0_.end(), b.body.pos.begin(), b.body.pos.end());
      mquat0_.insert(mquat0_.end(), b.body.quat.begin(), b.body.quat.end());
    }
    b.body.parent = parent;
    d_.bodies.push_back(std::move(b.body));
    for (auto& child : b.children) add(child, index, moves);
  }

  // The range of the control (of the activation, where that is integrated) = the target's range, scaled about its middle. For servos
  // whose setpoint is a length of the target only: others have no inheritrange by now.
  void inherit(ActuatorDraft& act) {
    auto& a = act.actuator;
    bool const integrates = a.dynamics == ActuatorDynamics::integrator;
    if (!integrates && a.dynamics != ActuatorDynamics::none && a.dynamics != ActuatorDynamics::filter_exact)
      s_.files.fail(a.place, "actuator " + in_quotes(a.name) + " has inheritrange, which is for position and intvelocity; remove it");
    std::array<double, 2> const* range = nullptr;
    if (a.target == Transmission::tendon) {
      for (auto const& t : d_.tendons)
        if (t.name == a.target_name && t.range[0] < t.range[1]) range = &t.range;
    } else if (a.target == Transmission::joint) {
      if (joint_range_.empty())
        for (auto const& b : d_.bodies)
          for (auto const& j : b.joints)
            if (j.type == JointType::hinge || j.type == JointType::slide) joint_range_[j.name] = &j.range;
      auto const found = joint_range_.find(a.target_name);
      if (found != joint_range_.end() && (*found->second)[0] < (*found->second)[1]) range = found->second;
    }
    if (!range)
      s_.files.fail(a.place, "actuator " + in_quotes(a.name) + " inherits a range that " + in_quotes(a.target_name) +
                                 " does not have; give " + (integrates ? "actrange" : "ctrlrange"));
    double const middle = ((*range)[0] + (*range)[1]) / 2, radius = act.inheritrange * ((*range)[1] - (*range)[0]) / 2;
    (integrates ? a.act_range : a.ctrl_range) = {middle - radius, middle + radius};
    (integrates ? a.act_limited : a.ctrl_limited) = true;
  }

  void spread(KeyDraft& key) {
    auto const put = [](auto const& parts, auto const& place_of, std::vector<double> initial, std::vector<double>& all) {
      if (parts.empty()) return;
      all = std::move(initial);
      for (auto const& [id, part] : parts)
        if (auto const at = place_of(id)) std::copy(part.begin(), part.end(), all.begin() + static_cast<std::ptrdiff_t>(*at));
    };
    auto const in = [](auto const& map, auto const& value) {
      return [&map, value](int id) -> std::optional<std::size_t> {
        auto const found = map.find(id);
        return found == map.end() ? std::nullopt : std::optional<std::size_t>(value(found->second));
      };
    };
    auto const same = [](std::size_t at) { return at; };
    auto& k = key.key;
    put(key.qpos, in(joint_at_, [](auto const& at) { return at.first; }), qpos0_, k.qpos);
    put(key.qvel, in(joint_at_, [](auto const& at) { return at.second; }), std::vector<double>(nv_, 0.), k.qvel);
    put(key.act, in(act_at_, same), std::vector<double>(na_, 0.), k.act);
    put(key.ctrl, in(actuator_at_, same), std::vector<double>(d_.actuators.size(), 0.), k.ctrl);
    put(key.mpos, in(mocap_at_, [](std::size_t at) { return 3 * at; }), mpos0_, k.mpos);
    put(key.mquat, in(mocap_at_, [](std::size_t at) { return 4 * at; }), mquat0_, k.mquat);
  }

  Session& s_;
  ModelDraft draft_;
  MjcfOptions const& options_;
  Description d_;
  std::vector<double> qpos0_, mpos0_, mquat0_;
  std::size_t nv_ = 0, na_ = 0;
  std::unordered_map<int, std::pair<std::size_t, std::size_t>> joint_at_;  // id -> place in qpos and qvel
  std::unordered_map<int, std::size_t> actuator_at_, act_at_, mocap_at_;   // id -> place among controls, activations, mocap bodies
  std::unordered_map<std::string, std::array<double, 2> const*> joint_range_;
};

}  // namespace detail::mjcf

GSP_INLINE Description parse_mjcf(std::string_view text, std::string const& name, MjcfOptions const& options) {
  detail::mjcf::Session session;
  session.files.read = options.read ? options.read : [](std::filesystem::path const& path) { return read_file(path); };
  session.skip_visuals = options.skip_visuals;
  session.list_refusals = options.list_refusals;
  int const file = session.files.add(name);
  detail::mjcf::XmlReader xml(session.files);
  auto const root = xml.parse(detail::as_bytes(text), file);
  auto draft = detail::mjcf::read_document(session, file, root).draft;
  return detail::mjcf::Finish(session, std::move(draft), options).run();
}

GSP_INLINE Description read_mjcf(std::filesystem::path const& path, MjcfOptions const& options) {
  auto const bytes = options.read ? options.read(path) : read_file(path);
  return parse_mjcf(detail::as_text(bytes), path.string(), options);
}

}  // namespace gsp::io
