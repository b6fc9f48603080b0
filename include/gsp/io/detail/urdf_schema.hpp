#pragma once
#include <string_view>

/// What the reader does with every element and attribute of URDF (wiki.ros.org/urdf/XML). Whatever stands in no list is unknown and an
/// error, except elements and attributes of other namespaces (drake:..., xmlns:...), which are listed as without effect.
namespace gsp::io::detail::urdf {

struct ElementSchema {
  std::string_view element;
  std::string_view honoured;   // attributes that are read
  std::string_view no_effect;  // attributes that mean nothing here
  std::string_view children;   // elements that may stand inside and are read
  std::string_view ignored;    // elements that may stand inside and mean nothing here, with all that they hold
};

inline constexpr ElementSchema schema[] = {
    {"robot", "name", "version", "link joint material mujoco",
     "transmission gazebo ros2_control sensor plugin group disable_collisions joint_properties self_collision_checking loop_joint"},
    {"mujoco", "", "", "compiler", "option size"},
    {"compiler", "balanceinertia boundmass boundinertia", "angle meshdir strippath discardvisual fusestatic inertiafromgeom autolimits", "",
     "lengthrange"},
    {"link", "name", "type", "inertial visual collision", "contact gazebo sensor self_collision_checking verbose"},
    {"inertial", "", "", "origin mass inertia", ""},
    {"mass", "value", "", "", ""},
    {"inertia", "ixx ixy ixz iyy iyz izz", "", "", ""},
    {"visual", "name", "", "origin geometry material", "gazebo"},
    {"collision", "name", "group", "origin geometry", "verbose contact_coefficients material gazebo"},
    {"origin", "xyz rpy quat_xyzw", "", "", ""},
    {"geometry", "", "", "box sphere cylinder capsule mesh", ""},
    {"box", "size", "", "", ""},
    {"sphere", "radius", "", "", ""},
    {"cylinder", "radius length", "", "", ""},
    {"capsule", "radius length", "", "", ""},
    {"mesh", "filename scale", "", "", ""},
    {"material", "name", "", "color", "texture"},
    {"color", "rgba", "", "", ""},
    {"joint", "name type", "", "origin parent child axis limit dynamics mimic", "calibration safety_controller gazebo hardwareInterface"},
    {"parent", "link", "", "", ""},
    {"child", "link", "", "", ""},
    {"axis", "xyz", "", "", ""},
    {"limit", "lower upper effort", "velocity acceleration deceleration jerk", "", ""},
    {"dynamics", "damping friction", "", "", ""},
    {"mimic", "joint multiplier offset", "", "", ""},
};

constexpr ElementSchema const* find_schema(std::string_view element) {
  for (auto const& e : schema)
    if (e.element == element) return &e;
  return nullptr;
}

}  // namespace gsp::io::detail::urdf
